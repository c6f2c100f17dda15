"""Growth of the run time with the size of the problem."""
