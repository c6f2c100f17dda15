"""Runs as recordings for the rerun viewer."""
