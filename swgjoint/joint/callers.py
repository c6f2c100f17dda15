"""Stack depth at which warnings name the user's line instead of package code."""

from __future__ import annotations

import sys


def depth_of_caller() -> int:
    """``stacklevel`` of a warning that names the first line outside the package."""
    depth, frame = 1, sys._getframe(1)
    package = __name__.partition(".")[0]
    while frame.f_back is not None:
        if frame.f_globals.get("__name__", "").partition(".")[0] != package:
            break
        frame, depth = frame.f_back, depth + 1
    return depth
