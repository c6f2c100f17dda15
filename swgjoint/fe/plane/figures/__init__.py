"""Results of the 2D model: friction loops, ratcheting torque and tooth motion."""
