"""What every bake measures: certificate, checks and convergence."""
