"""Recordings of runs for the rerun viewer."""
