"""Steps a second in MuJoCo Warp, with drives against the rigid arm.

    python tests/benchmarks/warp_speed.py [--worlds 256,4096] [--device cuda:0] [--json]

A 7-joint arm (iiwa 14) falls from a bent pose, which differs from world to world. The
drives are one from the catalogue and one with the harmonics of a finite-element map
(``--map``), with specimens that differ from world to world. On a CUDA device a captured
graph runs the step. Ratios are medians of interleaved rounds. Before, the first world
is compared with the engine plugin over 100 steps.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp

import swgjoint
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.warp import install, without_plugin
from swgjoint.maps.drive_map import DriveMap
from swgjoint.models_path import models_path

MAP = Path(__file__).parents[2] / "notebooks/maps/reference-2d.swg"
ROTOR = 1e-4
"""Inertia of every rotor [kg·m²]."""
CHECKED = 100
"""Steps after which the first world is compared with the plugin."""
POSE = (0.2, 0.5, -0.2, -1.2, 0.3, 0.8, 0.1)
"""Angles of the links [rad]."""
SPREAD = 0.05
"""Standard deviation of the specimens' stiffness, error and losses [-]."""


def start(
    model: mujoco.MjModel, drives: list[JointDrive], size: float = 1.0
) -> np.ndarray:
    """Positions of a bent pose without torsion, multiplied by a factor. Shape (nq,)."""
    qpos = model.qpos0.copy()
    for k, angle in enumerate(size * np.array(POSE), start=1):
        qpos[model.joint(f"joint_{k}").qposadr[0]] = angle
    for one in drives:
        link = qpos[model.joint(one.joint).qposadr[0]]
        qpos[model.joint(one.rotor).qposadr[0]] = one.motor_angle(link)
    return qpos


class Worlds:
    """One model on a device, with a step that runs all worlds."""

    def __init__(self, spec: mujoco.MjSpec, drives: list[JointDrive], worlds: int):
        self.model = without_plugin(spec)
        self.m = mjw.put_model(self.model)
        self.d = mjw.make_data(self.model, nworld=worlds)
        rng = np.random.default_rng(0)
        if drives:
            call = install(self.m, self.d, self.model, drives)
            specimens = rng.normal(0, SPREAD, (worlds, len(drives), 5))
            specimens[0] = 0.0
            call.specimens.assign(specimens)
        self.d.qpos.assign(
            [start(self.model, drives, size) for size in np.linspace(1, 0.5, worlds)]
        )
        self.graph = None
        mjw.step(self.m, self.d)  # compiles the kernels
        if wp.get_device().is_cuda:
            with wp.ScopedCapture() as capture:
                mjw.step(self.m, self.d)
            self.graph = capture.graph

    def step(self) -> None:
        """Advance all worlds by one step."""
        if self.graph is None:
            mjw.step(self.m, self.d)
        else:
            wp.capture_launch(self.graph)

    def rate(self, seconds: float) -> float:
        """Steps a second, summed over the worlds."""
        wp.synchronize()
        begin, steps = time.perf_counter(), 0
        while time.perf_counter() - begin < seconds:
            for _ in range(10):
                self.step()
            wp.synchronize()
            steps += 10
        return steps * self.d.nworld / (time.perf_counter() - begin)


def arm(drive: DriveMap | None) -> tuple[mujoco.MjSpec, list[JointDrive]]:
    """The arm with a drive in every joint, or rigid."""
    spec = mujoco.MjSpec.from_file(str(models_path() / "arms/iiwa14.xml"))
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    joints = [joint.name for joint in spec.joints]
    if drive is None:
        return spec, []
    drives = [
        swgjoint.attach(spec, joint=name, drive=drive, rotor_inertia=ROTOR)
        for name in joints
    ]
    return spec, drives


def apart(drive: DriveMap) -> float:
    """Largest difference of a link angle from the plugin [rad]."""
    spec, drives = arm(drive)
    model = spec.compile()
    data = mujoco.MjData(model)
    worlds = Worlds(spec, drives, 1)
    mjw.reset_data(worlds.m, worlds.d)
    data.qpos[:] = start(model, drives)
    worlds.d.qpos.assign(data.qpos[None])
    for _ in range(CHECKED):
        mujoco.mj_step(model, data)
        worlds.step()
    links = [int(model.joint(one.joint).qposadr[0]) for one in drives]
    return float(np.abs(worlds.d.qpos.numpy()[0] - data.qpos)[links].max())


def measure(
    worlds: int, maps: dict[str, DriveMap], rounds: int
) -> list[dict[str, Any]]:
    """One row per drive: rates, and their ratio to the rigid arm."""
    rigid = Worlds(*arm(None), worlds)
    rows = []
    for name, drive in maps.items():
        one = Worlds(*arm(drive), worlds)
        pairs = [(rigid.rate(0.5), one.rate(0.5)) for _ in range(rounds)]
        finite = bool(np.isfinite(one.d.qpos.numpy()).all())
        rows.append(
            {
                "worlds": worlds,
                "drive": name,
                "harmonics": len(drive.orders),
                "rigid_steps_per_s": median(a for a, _ in pairs),
                "steps_per_s": median(b for _, b in pairs),
                "of_rigid": median(b / a for a, b in pairs),
                "finite": finite,
            }
        )
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", default="256,4096")
    parser.add_argument("--map", type=Path, default=MAP)
    parser.add_argument("--device", default=None, help="Warp's default without it")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    maps = {
        "catalogue": DriveMap.from_catalogue("CHA-25-100"),
        "finite elements": DriveMap.load(given.map),
    }
    wp.config.quiet = True
    with wp.ScopedDevice(given.device):
        out: dict[str, Any] = {
            "device": wp.get_device().name,
            "apart_rad": {name: apart(drive) for name, drive in maps.items()},
            "rows": [],
        }
        for worlds in map(int, given.worlds.split(",")):
            out["rows"] += measure(worlds, maps, given.rounds)
    if given.json:
        print(json.dumps(out, indent=1))
        return
    print(f"device: {out['device']}")
    for name, value in out["apart_rad"].items():
        print(f"{name}: {value:.1e} rad from the plugin after {CHECKED} steps")
    shown: dict[str, Callable[[dict[str, Any]], str]] = {
        "worlds": lambda row: str(row["worlds"]),
        "drive": lambda row: row["drive"],
        "harmonics": lambda row: str(row["harmonics"]),
        "rigid [1/s]": lambda row: f"{row['rigid_steps_per_s']:.3g}",
        "drives [1/s]": lambda row: f"{row['steps_per_s']:.3g}",
        "of rigid": lambda row: f"{row['of_rigid']:.2f}",
    }
    print(" | ".join(shown))
    for row in out["rows"]:
        print(" | ".join(text(row) for text in shown.values()))


if __name__ == "__main__":
    main()
