"""Scenes of one joint that controllers share."""

from collections.abc import Callable

import pytest

from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.controller import Controller
from swgjoint.sim.run import Run
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene


@pytest.fixture(scope="session")
def turn() -> Callable[..., Run]:
    """The bench joint at constant speed under a load, seen by two encoders."""

    def run(
        plant: DriveMap,
        known: DriveMap,
        controller: Controller,
        *,
        speed: float,
        duration: float,
        load: float = 20.0,
        step: float = 1e-3,
        **keys: object,
    ) -> Run:
        scene = Scene.from_data(
            {
                "name": "turn",
                "arm": "bench",
                "defaults": {
                    "drive": "map",
                    "level": "full",
                    "rotor_inertia_kgm2": 1e-4,
                },
                "trajectory": {
                    "kind": "constant_speed",
                    "speed_deg_s": {"joint": speed},
                },
                "load": {"joint": {"torque_Nm": load}},
                "controller": {"feedback": "link"},
                "simulation": {"duration_s": duration, "step_s": step},
            },
            overrides={key.replace("__", "."): value for key, value in keys.items()},
        )
        return run_scene(
            scene,
            drives={"map": plant},
            known_drives={"joint": known},
            controller=controller,
        )

    return run
