"""The drive in three dimensions: face width, cup, micro-geometry."""
