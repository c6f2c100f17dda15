"""Multi-objective search for designs."""
