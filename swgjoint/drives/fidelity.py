"""Default fidelity of the finite element model of a design."""

from __future__ import annotations

from typing import Literal

from swgjoint.gear.design.design import Design


def default_model(design: Design) -> Literal["2d", "3d"]:
    """Return ``3d`` for a design with a cup, otherwise ``2d``.

    >>> from swgjoint import Design
    >>> [default_model(Design.load(name)) for name in ("reference-2d", "reference-3d")]
    ['2d', '3d']
    """
    return "2d" if design.cup is None else "3d"
