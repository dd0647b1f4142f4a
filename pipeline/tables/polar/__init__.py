"""The polar table: quadrature, spectral integral, splines, compression."""
