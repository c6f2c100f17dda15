"""Common parts of the 2D and 3D models: contact, algebra, load paths, sampling."""
