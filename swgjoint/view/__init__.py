"""Pictures, reports and recordings of results."""
