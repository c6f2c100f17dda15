"""Columns of equilibria over torque and input angle."""
