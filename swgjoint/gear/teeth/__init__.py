"""Tooth profiles, how they are generated, and the paths of rigid teeth."""
