"""Map coefficients from sampled equilibria, measurements and stated figures."""
