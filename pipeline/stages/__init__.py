"""The stages: the inputs of each from config and store, and the artifact that it makes."""
