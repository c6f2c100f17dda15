"""The condensed strip of the flexspline: one sector over the face width."""
