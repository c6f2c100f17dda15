"""Stability of the joint in stiff and extreme cases."""
