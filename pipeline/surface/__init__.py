"""Height fields: read from scans or made from recipes, conditioned and measured."""
