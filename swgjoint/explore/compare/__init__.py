"""Drives and levels side by side in one scene."""
