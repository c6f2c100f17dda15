"""Trilinear hexahedron with incompatible modes."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from skfem import ElementHex1

from swgjoint.fe.common.element import IncompatibleModes


class ElementHexIncompatible(IncompatibleModes, ElementHex1):  # type: ignore[misc]
    """Eight-node hexahedron with three incompatible modes per component.

    The thesis uses an element of the same type (C3D8I).
    """

    corners = 8
    interior_dofs = 3
    dofnames: ClassVar[list[str]] = ["u", "bx", "by", "bz"]
    doflocs = np.concatenate([ElementHex1.doflocs, np.full((3, 3), 0.5)])
