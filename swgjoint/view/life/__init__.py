"""Life over a duty cycle for display: table and picture."""
