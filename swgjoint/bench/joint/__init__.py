"""Error against run time of the joint levels, integrators and steps."""
