"""The studies of the thesis, computed again."""
