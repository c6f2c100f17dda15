"""Error and run time of the finite element models."""
