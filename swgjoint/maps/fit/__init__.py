"""Fits of maps to sampled equilibria, measurements and catalogue figures."""
