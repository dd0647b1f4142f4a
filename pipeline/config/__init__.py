"""The TOML that describes one material: its models, and reading it with all its faults."""
