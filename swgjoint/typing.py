"""Type aliases for the arrays that functions take and return."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Array of float64 numbers."""
Mask = NDArray[np.bool_]
"""Array of bools."""
Index = NDArray[np.int64]
"""Array of int64 indices."""
Complex = NDArray[np.complex128]
"""Array of complex128 numbers."""
