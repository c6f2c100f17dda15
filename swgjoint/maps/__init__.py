"""The reduced drive: samples, potential map, file format."""
