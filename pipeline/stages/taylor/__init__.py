"""Stages of the layout of the paper: Taylor stack and table."""
