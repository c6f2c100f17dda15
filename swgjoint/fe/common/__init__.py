"""What the 2D and 3D models share: contact, linear algebra, load paths, sampling."""
