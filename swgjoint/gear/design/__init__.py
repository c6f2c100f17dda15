"""The design file: its tables, defaults, feasibility, families and outlines."""
