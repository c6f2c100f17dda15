"""Finite elements of the drive; the only place where scikit-fem is imported."""
