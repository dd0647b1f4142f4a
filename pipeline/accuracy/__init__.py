"""Errors that every bake measures against the exact reference: certificate, checks and convergence."""
