"""Arguments that are True or False: a text such as "no" must not count as true."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import swgjoint
from swgjoint.drives.build_map import build_map
from swgjoint.errors import InputError
from swgjoint.explore.tune.result import TuneSettings
from swgjoint.explore.tune.tune import tune
from swgjoint.flags import check_flags
from swgjoint.models_path import models_path
from swgjoint.sim.arm.scene import scene_of_arm

DESIGN = swgjoint.Design.load("reference-2d")
SCENE = swgjoint.Scene.load_file("bench")


def attached(**flag: object) -> None:
    """Attach a drive to the arm of the bench."""
    import mujoco

    spec = mujoco.MjSpec.from_file(str(models_path() / "arms" / "bench.xml"))
    swgjoint.attach(spec, joint="joint", drive="CSG-25-100", **flag)  # type: ignore[call-overload]


CALLS: list[tuple[str, Callable[..., object]]] = [
    ("friction", attached),
    ("variable", attached),
    ("friction", lambda **flag: swgjoint.linearise(SCENE, **flag)),
    ("friction", lambda friction: SCENE.with_friction(friction)),
    (
        "motors",
        lambda **flag: swgjoint.export_mjcf(
            "bench", Path("/nowhere/a.xml"), "CSG-25-100", **flag
        ),
    ),
    ("nonlinear", lambda **flag: swgjoint.simulate_meshing(DESIGN, **flag)),
    ("half", lambda **flag: swgjoint.simulate_meshing(DESIGN, **flag)),
    ("cache", lambda **flag: build_map(DESIGN, **flag)),
    ("balance_inertia", lambda **flag: scene_of_arm("two-link", **flag)),
    (
        "resume",
        lambda **flag: tune(TuneSettings(environment="JointTracking-v0"), **flag),
    ),
]


@pytest.mark.parametrize(("name", "call"), CALLS)
def test_only_a_bool_is_a_flag(name, call):
    """One line names the argument, its value and both accepted values."""
    with pytest.raises(InputError) as caught:
        call(**{name: "no"})
    text = str(caught.value)
    assert "\n" not in text
    for part in (name, "'no'", "True", "False"):
        assert part in text


def test_bools_of_numpy_are_flags():
    """The result of a comparison of arrays is accepted, a number or None is not."""
    check_flags(friction=np.bool_(True), variable=False)
    for value in (0, 1, None, np.array([True])):
        with pytest.raises(InputError, match="friction"):
            check_flags(friction=value)
