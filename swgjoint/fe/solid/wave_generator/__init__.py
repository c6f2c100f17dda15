"""The wave generator in 3D: surface, bearing race, elastic cam."""
