"""Sweeps over designs and scenes, resumable and distributed."""
