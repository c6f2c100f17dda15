"""Error and run time of the joint levels, integrators and time steps."""
