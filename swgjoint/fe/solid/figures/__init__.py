"""Figures of the 3D model: fatigue, radial stiffness, torsion, load cases."""
