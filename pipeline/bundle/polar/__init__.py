"""Polar tables in bundles: textures of spline coefficients, their storage and their look-up."""
