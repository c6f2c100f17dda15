"""Scene files: their tables, checks and text."""
