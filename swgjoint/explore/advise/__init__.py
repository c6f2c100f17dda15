"""The cheapest level, integrator and step that meet a required error."""
