"""Columns of a recording, handed to the encoder as they are.

The ``columns`` methods of rerun's archetypes convert, copy and partition what they are
given, which takes longer than encoding it.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Column:
    """Values of one component at the rows of a ``send_columns``."""

    def __init__(
        self, descriptor: Any, values: NDArray[Any], dtype: Any, *, each: int = 1
    ) -> None:
        """Keep the values in the type of the component.

        Args:
            descriptor: Of the component, such as ``rr.Scalars.descriptor_scalars()``.
            values: Numbers (n_rows * each,), or vectors (n_rows * each, size).
            dtype: Of the component's numbers.
            each: Values in every row.
        """
        self._descriptor = descriptor
        self._values = np.ascontiguousarray(values, dtype=dtype)
        self._each = each

    def component_descriptor(self) -> Any:
        """Which component it is, as rerun asks for it."""
        return self._descriptor

    def as_arrow_array(self) -> Any:
        """One list a row, as rerun asks for it."""
        import pyarrow as pa

        array = pa.array(self._values.ravel())
        if self._values.ndim == 2:
            item = pa.field("item", array.type, nullable=False)
            size = self._values.shape[1]
            array = pa.FixedSizeListArray.from_arrays(
                array, type=pa.list_(item, list_size=size)
            )
        starts = np.arange(0, len(array) + 1, self._each, dtype=np.int32)
        return pa.ListArray.from_arrays(starts, array)


class Numbers:
    """A row of numbers as one tensor, for a bar chart."""

    def __init__(self, values: NDArray[np.float64]) -> None:
        """Keep the numbers, shape (n,)."""
        self._values = np.ascontiguousarray(values, dtype=np.float64)

    def as_arrow_array(self) -> Any:
        """One tensor, as rerun asks for it."""
        import pyarrow as pa

        fields, names, kinds, number, union = _empty_tensor()
        ends = np.array([0, self._values.size])
        filled = pa.Array.from_buffers(
            kinds[number].type,
            1,
            [None, pa.py_buffer(ends.astype(np.int32))],
            children=[pa.array(self._values)],
        )
        kinds = [*kinds[:number], filled, *kinds[number + 1 :]]
        values = pa.Array.from_buffers(fields[2].type, 1, union, children=kinds)
        sizes = pa.array(ends[1:].astype(np.uint64))
        starts = pa.py_buffer(np.array([0, 1], dtype=np.int32))
        shape = pa.Array.from_buffers(
            fields[0].type, 1, [None, starts], children=[sizes]
        )
        return pa.StructArray.from_arrays([shape, names, values], fields=fields)


@cache
def _empty_tensor() -> tuple[list[Any], Any, list[Any], int, list[Any]]:
    """Rerun's tensor without numbers.

    Fields, names, arrays of the kinds of numbers, which of them holds 64-bit floats,
    buffers of the union of the kinds.
    """
    import rerun as rr

    empty = rr.components.TensorDataBatch(np.zeros(0)).as_arrow_array()
    _, names, buffer = (empty.field(k) for k in range(3))
    kinds = [buffer.field(k) for k in range(buffer.type.num_fields)]
    number = buffer[0].type_code
    return list(empty.type), names, kinds, number, buffer.buffers()[:3]
