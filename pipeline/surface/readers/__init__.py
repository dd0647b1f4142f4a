"""Readers of scan files. `read_scan` reads one under limits of time and memory."""

from pipeline.surface.readers.limited import read_scan, require_file

__all__ = ["read_scan", "require_file"]
