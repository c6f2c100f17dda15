"""Design files: tables, defaults, feasibility checks, families and outlines."""
