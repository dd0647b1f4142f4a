"""Bundles: tables published as a folder that stands alone, can be checked and says how it was made."""
