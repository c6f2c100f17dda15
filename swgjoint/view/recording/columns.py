"""Columns of a recording that are passed to the encoder without conversion.

The ``columns`` methods of the rerun archetypes convert, copy and partition their
arguments, which takes longer than the encoding itself.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Column:
    """Values of one component for all rows of one ``send_columns`` call."""

    def __init__(
        self, descriptor: Any, values: NDArray[Any], dtype: Any, *, each: int = 1
    ) -> None:
        """Store the values in the number type of the component.

        Args:
            descriptor: Descriptor of the component, such as
                ``rr.Scalars.descriptor_scalars()``.
            values: Numbers of shape (n_rows * each,), or vectors of shape
                (n_rows * each, size).
            dtype: Number type of the component.
            each: Number of values per row.
        """
        self._descriptor = descriptor
        self._values = np.ascontiguousarray(values, dtype=dtype)
        self._each = each

    def component_descriptor(self) -> Any:
        """Descriptor of the component, part of the column protocol of rerun."""
        return self._descriptor

    def as_arrow_array(self) -> Any:
        """One list per row, part of the column protocol of rerun."""
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
        """Store the numbers of shape (n,)."""
        self._values = np.ascontiguousarray(values, dtype=np.float64)

    def as_arrow_array(self) -> Any:
        """One tensor, part of the component protocol of rerun."""
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
    """Parts of an empty rerun tensor.

    Returns:
        Fields, names, arrays by number type, index of the array for 64-bit floats, and
        buffers of the union of the number types.
    """
    import rerun as rr

    empty = rr.components.TensorDataBatch(np.zeros(0)).as_arrow_array()
    _, names, buffer = (empty.field(k) for k in range(3))
    kinds = [buffer.field(k) for k in range(buffer.type.num_fields)]
    number = buffer[0].type_code
    return list(empty.type), names, kinds, number, buffer.buffers()[:3]
