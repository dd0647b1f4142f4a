"""Configs: the TOML document that describes one material, and its reader."""
