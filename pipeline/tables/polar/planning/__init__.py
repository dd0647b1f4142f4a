"""The choice of a polar table's grid, terms and nodes for an error budget."""
