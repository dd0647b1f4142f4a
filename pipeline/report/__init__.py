"""Image files, and text from templates."""
