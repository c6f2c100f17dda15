"""From measurements to a map: bench logs and measured torque-torsion loops."""
