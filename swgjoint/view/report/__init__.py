"""Runs and other results as one self-contained HTML file."""
