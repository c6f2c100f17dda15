"""Comparisons with sources: one function a study, plugged into ``swgjoint study``."""
