r"""Scenes of ``swgjoint bench joint``, and the DOP853 solution of scene ``bench``.

The equations of motion of scene ``bench`` are

.. math::
    J\ddot\theta = \tau - \left(T(\Delta) + C\dot\Delta\right)(1/i + e_0'(\theta)),
    \qquad J_l\ddot\psi = T(\Delta) + C\dot\Delta - T_l

with :math:`\Delta = \theta/i + e_0(\theta) - \psi` and the motor torque :math:`\tau` of
the control loop. The solution uses neither the map nor the engine, and its inputs vary
continuously instead of being constant over a step.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import cos, sin

import numpy as np

from swgjoint.bench.stability.joint import (
    ERROR,
    HARDENING,
    ORDERS,
    REACH,
    hardening_drive,
    with_kinematic_error,
)
from swgjoint.errors import ComputationError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.assembly import Assembly
from swgjoint.sim.run import Run
from swgjoint.sim.scene.scene import Scene
from swgjoint.typing import Array

STIFFNESS = 3e4
"""Stiffness of the drive of scene ``bench`` at zero torque [N·m/rad]; rotor and link
oscillate at 39 Hz."""
DURATION = 1.6
"""Duration of all scenes [s]."""
TIMING = {"hold_s": 0.1, "ramp_s": 0.3, "settle_s": 0.1}
TRAVEL = 8.0
"""Travel of every joint [deg]; the links move at about 7 deg/s."""


@dataclass(frozen=True, kw_only=True)
class BenchScene:
    """A scene of the benchmark with its drives."""

    name: str
    scene: Scene
    drives: dict[str, DriveMap] = field(default_factory=dict)
    """Maps by drive reference."""

    @property
    def is_bench(self) -> bool:
        """Whether :func:`exact` can solve the scene."""
        return self.name == "bench"


def bench_scene(name: str) -> BenchScene:
    """Scene ``bench``, ``ur5e`` or ``iiwa14``: a short sweep at ordinary speed.

    Scene ``bench`` has a hardening drive, the arms have catalogue drives. All drives
    have a kinematic error of 1 arcmin at orders two and four per input turn. They have
    neither hysteresis nor friction, which would reduce the order of RK4.
    """
    if name == "bench":
        return BenchScene(
            name=name,
            scene=_bench(),
            drives={"hardening": hardening_drive(STIFFNESS)},
        )
    bundled = {"ur5e": "ur5e-catalogue", "iiwa14": "iiwa14-sweep"}[name]
    scene = Scene.load_file(bundled)
    start = scene.trajectory.start_deg
    end = scene.trajectory.model_dump()["end_deg"]
    short = {
        f"trajectory.end_deg.{joint}": angle
        + TRAVEL * float(np.sign(end[joint] - angle))
        for joint, angle in start.items()
    }
    timing = {f"trajectory.{key}": value for key, value in TIMING.items()}
    scene = scene.with_changes(short | timing | {"simulation.duration_s": DURATION})
    used = {joint.drive for joint in scene.joints.values() if joint.drive}
    drives = {
        one: with_kinematic_error(
            DriveMap.from_catalogue(one, kinematic_error_arcmin=0.0)
        )
        for one in sorted(used)
    }
    return BenchScene(name=name, scene=scene, drives=drives)


SCENES = ("ur5e", "iiwa14", "bench")
"""Scenes, the one with the longest run time first."""


def _bench() -> Scene:
    return Scene.from_data(
        {
            "name": "bench",
            "arm": "bench",
            "defaults": {"drive": "hardening", "rotor_inertia_kgm2": 1e-4},
            "trajectory": {
                "kind": "sweep",
                **TIMING,
                "start_deg": {"joint": 0.0},
                "end_deg": {"joint": TRAVEL},
            },
            "load": {"joint": {"rated_fraction": 0.5}},
            "controller": {
                "kind": "pd",
                "natural_frequency_Hz": 8.0,
                "damping_ratio": 1.0,
                "feedforward": "gravity",
            },
            "simulation": {"duration_s": DURATION},
        },
        where="bench",
    )


def exact(run: Run, whole: Assembly) -> Run:
    """Solve scene ``bench`` by DOP853, at the samples of another run.

    Args:
        run: Run at level ``full``, which defines start and sample times.
        whole: Assembled scene at a small step, with motion, gains, load and inertias.

    Returns:
        Copy of the run with angles, torsion, output torque and tool position of the
        solution.

    Raises:
        ComputationError: If the integration fails.
    """
    from scipy.integrate import solve_ivp
    from scipy.interpolate import CubicHermiteSpline

    drive = whole.transmissions[0].attached
    i, rotor, link = drive.ratio, drive.rotor_inertia, drive.link_inertia
    kp, kd = float(whole.loops.stiffness[0]), float(whole.loops.damping[0])
    path, load = whole.trajectory, float(whole.load[0])
    at = CubicHermiteSpline(path.time, path.position[:, 0], path.velocity[:, 0])
    rate_at = CubicHermiteSpline(
        path.time, path.velocity[:, 0], path.acceleration[:, 0]
    )
    cubic = STIFFNESS * HARDENING / 3.0 / REACH**2
    top = STIFFNESS * (1.0 + HARDENING)

    def spring(s: float) -> float:
        inside = min(max(s, -REACH), REACH)
        return inside * (STIFFNESS + cubic * inside**2) + top * (s - inside)

    def twisted(y: Array) -> tuple[float, float, float]:
        """Torsion, torque on the link, and derivative of the torsion by theta.

        ``y`` contains theta, psi and their rates.
        """
        theta, psi, theta_rate, psi_rate = y.tolist()
        error = ERROR * sum(cos(n * theta) for n in ORDERS)
        by = 1.0 / i - ERROR * sum(n * sin(n * theta) for n in ORDERS)
        torsion = theta / i + error - psi
        torque = spring(torsion) + drive.damping * (by * theta_rate - psi_rate)
        return torsion, torque, by

    def rates(t: float, y: Array) -> tuple[float, float, float, float]:
        _, torque, by = twisted(y)
        theta, _, theta_rate, psi_rate = y.tolist()
        motor = load / i + kp * (i * float(at(t)) - theta)
        motor += kd * (i * float(rate_at(t)) - theta_rate)
        return (
            theta_rate,
            psi_rate,
            (motor - torque * by) / rotor,
            (torque - load) / link,
        )

    begin = [
        float(values[0, 0])
        for values in (
            run.motor_position,
            run.position,
            run.motor_velocity,
            run.velocity,
        )
    ]
    found = solve_ivp(
        rates,
        (0.0, float(run.time[-1])),
        begin,
        method="DOP853",
        t_eval=run.time,
        rtol=1e-10,
        atol=1e-12,
        max_step=5e-3,
    )
    if not found.success:
        raise ComputationError(f"reference of scene 'bench': {found.message}")
    torsion, torque = np.array([twisted(y)[:2] for y in found.y.T]).T
    position = found.y[1][:, None]
    return replace(
        run,
        name="DOP853",
        position=position,
        motor_position=found.y[0][:, None],
        torsion=torsion[:, None],
        output_torque=torque[:, None],
        tool_position=whole.arm.tool_positions(position),
    )
