"""Compiled loops of the finite elements, next to the numpy code that they repeat.

The numpy code is the reference: it explains the method, runs wherever the package was
built without a compiler, and every kernel is tested against it. The environment
variable ``SWGJOINT_KERNELS=numpy`` selects it everywhere.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType

try:
    from swgjoint.kernels import compiled as _compiled
except ImportError:  # built without a compiler or the headers of Python
    _compiled = None  # type: ignore[assignment]


def kernels() -> ModuleType | None:
    """Module of the compiled loops; None to use numpy."""
    return None if os.environ.get("SWGJOINT_KERNELS") == "numpy" else _compiled
