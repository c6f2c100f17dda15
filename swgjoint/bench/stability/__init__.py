"""Stability of the joint on stiff and extreme cases."""
