"""The literature's algorithms from a height field to diffraction's colour, behind one interface."""
