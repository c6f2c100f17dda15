"""Parts that the 2D and 3D models share: contact, algebra, load paths, sampling."""
