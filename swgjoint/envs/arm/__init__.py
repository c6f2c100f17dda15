"""Episodes of an arm: scene, paths, payloads."""
