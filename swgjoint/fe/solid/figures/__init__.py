"""Figures from the 3D model: fatigue, radial stiffness, torsion, coning, tooth play."""
