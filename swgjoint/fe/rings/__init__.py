"""A fast 2D model of thin rings with the ball bearing of the wave generator."""
