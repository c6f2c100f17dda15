"""The 2D model of a drive: tooth sectors, contact, equilibria and stresses."""
