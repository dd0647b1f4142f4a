"""The command line: click commands, and all text that is printed."""
