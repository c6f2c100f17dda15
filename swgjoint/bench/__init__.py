"""Benchmarks: error against run time, scaling, stability."""
