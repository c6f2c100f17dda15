"""What tests of finite elements share: solved once in a run, by whoever needs it first.

All processes of a run share the run's cache folder (see ``scheduling``). A result lies
there under its name; a lock makes others wait for the process that computes it. The
name must say all that decides the result, down to the refinement.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from math import pi
from pathlib import Path
from typing import TypeVar

import pytest
from filelock import FileLock

from swgjoint.fe.rings import model as rings
from swgjoint.fe.rings.friction import RubbedPath, friction_path
from swgjoint.gear.design.design import Design
from swgjoint.maps.cache import code_version

T = TypeVar("T")

PITCH = 2.0 * pi / 122
"""Of the circular spline of the bundled plane designs [rad]."""
FEW_TEETH = 60
FEW_PITCH = 2.0 * pi / 62
"""The same of ``few_teeth`` [rad]."""

BEARING = {
    "wave_generator.bearing.balls": 12,
    "wave_generator.bearing.ball_diameter_mm": 4.0,
    "wave_generator.bearing.race_thickness_mm": 1.0,
    "wave_generator.bearing.clearance_um": 20.0,
    "wave_generator.bearing.race_width_mm": 8.0,
}
"""Changes of a design that put the small gears of the tests on a ball bearing."""


def kept(name: str, solve: Callable[[], T]) -> T:
    """The result of ``solve``, from the folder of the run or computed and put there."""
    key = hashlib.sha256(f"{code_version()} {name}".encode()).hexdigest()[:32]
    # not the cache in use, which a test may have replaced by another one
    path = Path(os.environ["SWGJOINT_TEST_CACHE"]) / "solved" / f"{key}.pickle"
    path.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(path.with_suffix(".lock")):
        if path.exists():
            return pickle.loads(path.read_bytes())
        result = solve()
        beside = path.with_suffix(".part")
        beside.write_bytes(pickle.dumps(result, pickle.HIGHEST_PROTOCOL))
        beside.replace(path)
    return result


def coarse(name: str = "reference-2d", **changes: object) -> Design:
    """A bundled plane design on half the elements a direction: half the time."""
    return Design.load(name).with_changes({"mesh.refinement": 0.5, **changes})


def few_teeth(name: str = "reference-2d", **changes: object) -> Design:
    """The same with 60 and 62 teeth under the same lobes: a quarter of the time.

    Its strains are far above those of steel. Laws do not mind; approximations do.
    """
    teeth = {"drive.teeth_flexspline": 60, "drive.teeth_circular_spline": 62}
    return coarse(name, **{**teeth, **changes})


def small_cup() -> Design:
    """``reference-3d`` with 60 and 62 teeth, its cup in proportion."""
    return Design.load("reference-3d").with_changes(
        {
            "drive.teeth_flexspline": 60,
            "drive.teeth_circular_spline": 62,
            "cup.length_mm": 20.0,
            "cup.bore_radius_mm": 10.0,
        }
    )


RING_TORQUES = (7.0, 14.0, 48.0, 96.0)
"""Of ``ring_path`` [N·m]; it puts a small one before them."""


@contextmanager
def hundred_elements() -> Iterator[None]:
    """Thin rings of one element a tooth of a hundred teeth, half as many as usual."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rings, "ELEMENTS", 100)
        yield


@cache
def ring_path() -> RubbedPath:
    """The thin rings of size 25 and ratio 100, loaded at an input angle of 0.1 rad."""
    design = Design.load("size-25-100")
    name = f"ring path {design.content_hash()} {RING_TORQUES}"
    return kept(name, lambda: friction_path(design, RING_TORQUES, angles=[0.1]))
