"""Bundles: folders with published tables that need no other file, can be verified, and state their origin."""
