"""Figures of a drive from its 2D model: friction, ratcheting, motion of teeth."""
