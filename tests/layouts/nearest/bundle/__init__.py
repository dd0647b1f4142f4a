"""Its part of a bundle."""
