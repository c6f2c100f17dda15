"""Pictures drawn with matplotlib, one module per kind of result."""
