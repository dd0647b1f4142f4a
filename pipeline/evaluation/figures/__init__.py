"""The validation bench: a module for every figure and table of the literature, each a page with its verdict."""
