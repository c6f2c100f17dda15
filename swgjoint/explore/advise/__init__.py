"""The cheapest level, integrator and step within a wanted error."""
