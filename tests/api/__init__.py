"""The public API and its examples."""
