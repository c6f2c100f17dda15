"""Acceptance tests of one drive, simulated or from measured logs."""
