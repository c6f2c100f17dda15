"""Finite-element models of the drive; only this package imports scikit-fem."""
