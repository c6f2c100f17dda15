"""From sampled equilibria and stated figures to the coefficients of a map."""
