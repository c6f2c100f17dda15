"""Scenes, trajectories, runs and metrics."""
