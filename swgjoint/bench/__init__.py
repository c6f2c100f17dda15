"""Benchmarks: error and run time, scaling, stability."""
