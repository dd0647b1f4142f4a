"""Tests of the registry of layouts."""
