"""How run time grows with the size of the problem."""
