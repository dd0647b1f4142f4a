"""The command line: thin click commands, and all text that people read."""
