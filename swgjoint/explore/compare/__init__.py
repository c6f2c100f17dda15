"""Comparison of drives and levels in one scene."""
