"""The drive as thin rings: fast, plane, with the bearing of the wave generator."""
