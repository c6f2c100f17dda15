"""Life of the drives of a scene over its duty cycle."""
