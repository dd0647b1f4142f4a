"""Closed forms of physical optics and colour, one equation a function."""
