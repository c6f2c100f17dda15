"""Geometry of the drive: design, tooth profiles, wave generators, kinematics."""
