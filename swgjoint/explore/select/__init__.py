"""Selection of the cheapest drives that meet a specification, one per joint."""
