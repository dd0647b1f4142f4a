"""The stages from a measured height field to a table of light, and the physics they share."""
