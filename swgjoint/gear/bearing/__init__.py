"""The thin-race ball bearing between wave generator and flexspline."""
