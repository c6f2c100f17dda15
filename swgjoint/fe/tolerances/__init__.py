"""Drives with manufacturing errors, which are superposed on linearised equilibria."""
