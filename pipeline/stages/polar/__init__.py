"""Stages of the polar layout: power spectrum and table."""
