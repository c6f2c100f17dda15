"""Drives by name, file or design, and the functions that return their maps."""
