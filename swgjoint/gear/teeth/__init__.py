"""Tooth profiles, their generation, and the paths of rigid teeth."""
