"""Height fields: read from scans or made from recipes, cleaned and measured."""
