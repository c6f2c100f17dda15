"""The condensed strip of the flexspline: one tooth sector from open end to boss."""
