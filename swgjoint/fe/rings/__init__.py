"""Fast 2D model of a drive as thin rings, with the wave generator's ball bearing."""
