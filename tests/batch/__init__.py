"""Tests of several configs in one run."""
