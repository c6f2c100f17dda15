"""Scenes that run within a fraction of a second."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.run import Run
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

BENCH = """
name = "bench test"
arm = "bench"
[defaults]
drive = "map"
level = "full"
rotor_inertia_kgm2 = 1e-4
[trajectory]
kind = "constant_speed"
[trajectory.speed_deg_s]
joint = 3.0
[load.joint]
torque_Nm = 20.0
[simulation]
duration_s = 0.5
"""


@pytest.fixture
def bench() -> Callable[..., Run]:
    """Run the one-joint bench with a map and changed keys."""

    def run(drive: DriveMap, **overrides: object) -> Run:
        dotted = {key.replace("__", "."): value for key, value in overrides.items()}
        return run_scene(
            Scene.from_toml(BENCH), overrides=dotted, drives={"map": drive}
        )

    return run


@pytest.fixture
def plain_map(synthetic_map: DriveMap) -> DriveMap:
    """The synthetic map without any dependence on the angles."""
    kept = synthetic_map.with_harmonics([False] * len(synthetic_map.orders))
    return replace(kept, kinematic_error=0.0 * kept.kinematic_error)
