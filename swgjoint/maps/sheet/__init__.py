"""Catalogue-style spec sheet of a map, and the validity of its figures."""
