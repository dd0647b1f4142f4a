"""Plots of the evaluation."""
