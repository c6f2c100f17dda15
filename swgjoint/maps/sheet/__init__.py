"""The catalogue-style sheet of a map and how far its figures hold."""
