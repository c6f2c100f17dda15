"""Checked, read-only arrays for frozen dataclasses."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def frozen_array(
    values: ArrayLike,
    what: str,
    *,
    ndim: int | None = None,
    shape: tuple[int | None, ...] | None = None,
) -> NDArray[np.float64]:
    """Copy ``values`` to a read-only float64 array and check shape and finiteness.

    Args:
        values: Anything that numpy converts to float64.
        what: Name and unit of the quantity, for the error message.
        ndim: Required number of axes; None accepts any number.
        shape: Required shape, where None for an axis accepts any length; None accepts
            any shape.

    Raises:
        ValueError: If the shape is wrong or a value is not finite.

    >>> frozen_array([1, 2, 3], "torque [N·m]", ndim=1)
    array([1., 2., 3.])
    """
    array = np.array(values, dtype=np.float64)
    if ndim is not None and array.ndim != ndim:
        raise ValueError(f"{what} has {array.ndim} axes, needs {ndim}")
    if shape is not None and (
        array.ndim != len(shape)
        or any(
            want is not None and have != want
            for have, want in zip(array.shape, shape, strict=True)
        )
    ):
        raise ValueError(f"{what} has shape {array.shape}, needs {shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{what} contains a value that is not finite")
    array.setflags(write=False)
    return array
