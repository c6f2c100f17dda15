"""Compiled versions of the slowest loops of finite elements, maps and environments.

The numpy version of each loop is the reference. It explains the method, it runs if the
package was built without a compiler, and the tests compare the compiled loop with it.
The environment variable ``SWGJOINT_KERNELS=numpy`` selects the numpy versions.
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
    """Module of the compiled loops; None if the numpy versions are to be used."""
    return None if os.environ.get("SWGJOINT_KERNELS") == "numpy" else _compiled
