"""Recomputation of three articles on flexsplines."""
