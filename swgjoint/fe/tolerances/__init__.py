"""Drives with manufacturing errors of the teeth, in 2D."""
