"""Several configs in one run."""
