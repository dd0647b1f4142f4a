"""Evaluation of the product: methods of the literature, figures, speed, stability. Only cli imports it."""
