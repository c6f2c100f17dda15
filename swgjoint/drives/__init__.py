"""Drives by name, file or design: the one door to their maps."""
