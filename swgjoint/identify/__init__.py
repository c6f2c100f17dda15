"""Identification of a map from measurements: bench logs and torque-torsion loops."""
