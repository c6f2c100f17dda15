"""The 2D model of a drive: plane sectors, contact, equilibrium, stresses."""
