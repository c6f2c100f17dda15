"""Three articles on flexsplines, computed again."""
