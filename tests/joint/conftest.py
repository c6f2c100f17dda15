"""Two-mass models of one joint, and maps that move with both angles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest

from swgjoint.joint.attach import attach
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.hysteresis_step import move_rests
from swgjoint.joint.reference import (
    TwinMotion,
    metric_of,
    other_acceleration,
    relax_state,
    rest_after,
    scheme_force,
)
from swgjoint.joint.response import responses
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import vary_with_load
from swgjoint.maps.sliders import Sliders

TWO_MASS = """
<mujoco>
  <option timestep="{step}" integrator="{integrator}" gravity="0 0 0"/>
  <worldbody>
    <body name="link" pos="0 0 .5">
      <joint name="j" axis="0 0 1" {joint}/>
      <inertial pos="0 0 0" mass="3" diaginertia="{link} {link} {link}"/>
    </body>
  </worldbody>
  {equality}
</mujoco>
"""


@dataclass(frozen=True, eq=False)
class Twin:
    """Where the scheme in numpy ends."""

    q: np.ndarray
    v: np.ndarray
    rest: tuple[float, ...]
    relaxed: float | None
    rubs: list
    """Friction of every step; none without."""


@dataclass(frozen=True, eq=False)
class Bench:
    """A compiled model with one driven joint."""

    model: mujoco.MjModel
    data: mujoco.MjData
    drive: JointDrive
    q: np.ndarray
    """qpos addresses of rotor and link."""
    v: np.ndarray

    def place(self, theta: float, psi: float, *rates: float) -> None:
        """Set the state of rotor and link."""
        self.data.qpos[self.q] = theta, psi
        if rates:
            self.data.qvel[self.v] = rates

    def energy(self, *, midpoint: bool = False) -> float:
        """Kinetic energy and V, at q or half a step back where the scheme lives."""
        d = self.data
        inertia = np.array([self.drive.rotor_inertia, self.drive.link_inertia])
        v = d.qvel[self.v]
        x = d.qpos[self.q] - 0.5 * midpoint * self.model.opt.timestep * v
        drive = self.drive.drive
        torsion = drive.torsion(*x)
        potential = drive.energy(torsion, *x)
        if drive.hysteresis and self.drive.plugin:
            # the slip of the last step, with its yield torsions
            count = len(drive.hysteresis)
            limit = d.plugin_state[-count:] if vary_with_load(drive.hysteresis) else ()
            limit = tuple(x or np.inf for x in limit)  # 0: there was no step
            rest = move_rests(self.rest, limit, float(torsion))
            sliders = replace(Sliders.relax(drive.hysteresis), rest=np.array(rest))
            elastic = drive.torque(torsion, *x)
            potential += sliders.energy(torsion, elastic)
        if drive.friction and self.drive.plugin and self.bristle[1]:
            stretch = float(np.dot(drive.friction_direction, x)) - self.bristle[0]
            potential += 0.5 * drive.friction.stiffness * stretch**2
        return float(0.5 * np.sum(inertia * v**2) + potential)

    def motion(self, **history: object) -> TwinMotion:
        """What the twin sees where the engine stands, after mj_forward."""
        d = self.data
        (theta, psi), rates = d.qpos[self.q], d.qvel[self.v]
        weight = responses(self.model, d.qLD, d.qLDiagInv, self.v)
        other = d.plugin_state[:2]
        return TwinMotion(
            theta=theta,
            psi=psi,
            theta_rate=rates[0],
            psi_rate=rates[1],
            rotor_weight=weight[0],
            link_weight=weight[1],
            rotor_acceleration=other[0],
            link_acceleration=other[1],
            **history,  # type: ignore[arg-type]
        )

    def twin(self, steps: int) -> Twin:
        """Steps of the scheme in numpy from where the engine stands; it stays there."""
        drive, h = self.drive.drive, self.model.opt.timestep
        inertia = np.array([self.drive.rotor_inertia, self.drive.link_inertia])
        q, v = self.data.qpos[self.q].copy(), self.data.qvel[self.v].copy()
        state, rest, relaxed = (0.0, 0.0), (0.0,) * len(drive.hysteresis), None
        limit: tuple[float, ...] = ()
        rubs = []
        for _ in range(steps):
            motion = TwinMotion(
                theta=q[0],
                psi=q[1],
                theta_rate=v[0],
                psi_rate=v[1],
                rotor_weight=1 / inertia[0],
                link_weight=1 / inertia[1],
                rotor_acceleration=state[0],
                link_acceleration=state[1],
                rest=rest,
                limit=limit,
                relaxed=relaxed,
            )
            f = scheme_force(drive, motion, timestep=h, damping=self.drive.damping)
            total = np.array([f.theta, f.psi]) + self.data.qfrc_applied[self.v]
            metric = np.diag(inertia) + metric_of(drive, f, timestep=h)
            v = v + np.linalg.solve(metric, h * total)
            q = q + h * v
            rates = {"timestep": h, "theta_rate": v[0], "psi_rate": v[1]}
            state = other_acceleration(drive, motion, f, **rates)
            rest, limit = rest_after(drive, motion, f, **rates), f.reach
            if drive.friction is not None:
                relaxed = relax_state(drive, motion, f, **rates)
                rubs.append(f.friction)
        return Twin(q=q, v=v, rest=rest, relaxed=relaxed, rubs=rubs)

    @property
    def rest(self) -> np.ndarray:
        """Plugin state of the hysteresis: torsions at which elements are relaxed."""
        return self.data.plugin_state[2 : 2 + len(self.drive.drive.hysteresis)]

    @property
    def bristle(self) -> np.ndarray:
        """Plugin state of the friction: where it is relaxed, whether that is known."""
        return self.data.plugin_state[2 + len(self.drive.drive.hysteresis) :]


def make_bench(
    drive: DriveMap,
    *,
    step: float = 1e-3,
    integrator: str = "discrete",
    link: float = 0.4,
    joint: str = "",
    equality: str = "",
    **keys: object,
) -> Bench:
    text = TWO_MASS.format(
        step=step, integrator=integrator, link=link, joint=joint, equality=equality
    )
    spec = mujoco.MjSpec.from_string(text)
    keys = {"rotor_inertia": 4e-5, "damping_ratio": 0.0, "friction": True, **keys}
    got = attach(spec, joint="j", drive=drive, **keys)  # type: ignore[arg-type]
    model = spec.compile()
    joints = [model.joint(name) for name in (got.rotor, "j")]
    return Bench(
        model,
        mujoco.MjData(model),
        got,
        np.array([int(j.qposadr[0]) for j in joints]),
        np.array([int(j.dofadr[0]) for j in joints]),
    )


@pytest.fixture
def bench() -> Callable[..., Bench]:
    return make_bench


@pytest.fixture(
    params=["circular_spline_fixed", "flexspline_fixed", "wave_generator_fixed"]
)
def any_layout(request: pytest.FixtureRequest, synthetic_map: DriveMap) -> DriveMap:
    """The synthetic map with side bands, in each layout: moves with theta and psi.

    Below its sampled torsion it goes on less stiffly than above it.
    """
    ends = synthetic_map.end_stiffness * [0.7, 1.0]
    return replace(synthetic_map, layout=request.param, end_stiffness=ends)
