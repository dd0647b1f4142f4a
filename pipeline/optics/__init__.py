"""Closed forms of physical optics and colour, one function per equation."""
