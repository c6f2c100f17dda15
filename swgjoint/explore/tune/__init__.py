"""Tuning of controller gains in the environments."""
