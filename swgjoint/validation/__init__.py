"""Comparisons with published sources, one function per study."""
