"""Outlines of wave generators, with one module per kind."""
