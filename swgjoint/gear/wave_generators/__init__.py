"""Outlines of wave generators, one kind per module."""
