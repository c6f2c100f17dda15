"""Drives with manufacturing errors, superposed on linearised equilibria."""
