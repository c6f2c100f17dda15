"""Error against run time of the finite element models."""
