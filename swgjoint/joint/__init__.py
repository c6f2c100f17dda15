"""The drive as a compliant transmission of a MuJoCo joint."""
