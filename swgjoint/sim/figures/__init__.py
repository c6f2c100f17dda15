"""Figures of a run: ripple, orders, accuracy, energy, validity and verdict."""
