r"""One joint for the stability study: rotor, drive and link, run and weighed.

.. math::
    E = \tfrac12 J\dot\theta^2 + \tfrac12 J_l\dot\psi^2 + V(\Delta)
        - \frac{T}{i}\theta + T\psi

is constant without damping when the load takes a constant torque T and the motor gives
T/i: the last two terms are their work, taken off. The discrete scheme is a midpoint
rule in positions half a step back, and E is measured there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.gear.ratings import Ratings
from swgjoint.joint.attach import attach
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.native import native_map
from swgjoint.joint.region import Region, check_region
from swgjoint.maps.drive_map import DriveMap
from swgjoint.typing import Array
from swgjoint.units import arcmin

RATIO = 100
ORDERS = (2, 4)
"""Orders of the kinematic error per turn of the input."""
ERROR = 1.0 * arcmin
"""Amplitude of each [rad]."""
REACH = 4e-3
"""Torsion at full torque, repeated peak [rad]; CSG-25-100: 204 N·m over 5e4 N·m/rad."""
HARDENING = 2.0
"""Rise of the stiffness from no torque to full torque over its value there, less 1."""
SAMPLES = 400
"""Samples of the energy along a run."""
GAIN = 0.05
"""Share of kinetic and torsion energy that counts as a gain."""

_XML = """
<mujoco>
  <option timestep="{step!r}" integrator="{integrator}" gravity="0 0 0"/>
  <worldbody>
    <body name="link">
      <joint name="joint" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="1" diaginertia="{link!r} {link!r} {link!r}"/>
    </body>
  </worldbody>
</mujoco>
"""


def with_kinematic_error(drive: DriveMap) -> DriveMap:
    """The mean curve of a drive, without losses, with the study's kinematic error."""
    count = len(ORDERS)
    potential = np.zeros((1 + count, *drive.potential.shape[1:]))
    ends = np.zeros((1 + count, 2, 2))
    potential[0], ends[0] = drive.potential[0], drive.end_stiffness[0]
    error = np.zeros((1 + count, 2))
    error[1:, 0] = ERROR
    return replace(
        drive,
        orders=np.array([(0, 0), *((n, 0) for n in ORDERS)]),
        potential=potential,
        end_stiffness=ends,
        kinematic_error=error,
        hysteresis=(),
        friction=None,
    )


def hardening_drive(stiffness: float) -> DriveMap:
    """A hardening spring with kinematic error; stiffness at no torque [N·m/rad]."""
    knots = np.linspace(-REACH, REACH, 9)
    quartic = stiffness * HARDENING / 12.0 / REACH**2
    # V = K s²/2 + c s⁴, expanded about every knot
    s = knots[:-1]
    spring = np.stack(
        [
            0.5 * stiffness * s**2 + quartic * s**4,
            stiffness * s + 4.0 * quartic * s**3,
            0.5 * stiffness + 6.0 * quartic * s**2,
            4.0 * quartic * s,
            quartic * np.ones_like(s),
        ],
        axis=-1,
    )
    potential, ends = np.zeros((1, 2, s.size, 5)), np.zeros((1, 2, 2))
    potential[0, 0] = spring
    ends[0, 0] = stiffness * (1.0 + HARDENING)
    full = stiffness * REACH * (1.0 + HARDENING / 3.0)
    spring_alone = DriveMap(
        name=f"K = {stiffness:g} N·m/rad",
        level="synthetic",
        layout="circular_spline_fixed",
        teeth_flexspline=2 * RATIO,
        teeth_circular_spline=2 * RATIO + 2,
        torsion_knots=knots,
        orders=np.zeros((1, 2), dtype=np.int64),
        potential=potential,
        end_stiffness=ends,
        kinematic_error=np.zeros((1, 2)),
        ratings=Ratings(
            rated_torque=full / 2.0,
            repeated_peak=full,
            momentary_peak=2.0 * full,
            T1=full / 10.0,
            T2=full / 3.0,
        ),
    )
    return with_kinematic_error(spring_alone)


@dataclass(frozen=True, kw_only=True)
class Start:
    """How a run starts."""

    torque: float = 0.0
    """Torque of the drive on the link at the start [N·m]."""
    load: float = 0.0
    """Torque of the load against the link from then on; the motor gives T/i [N·m]."""
    speed: float = 0.0
    """Speed of the rotor [rad/s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """States of a run, the first included, and what became of it."""

    time: Array
    """[s]. Shape (n,)."""
    position: Array
    """Rotor and link where the scheme lives [rad]. Shape (n, 2)."""
    velocity: Array
    """[rad/s]. Shape (n, 2)."""
    energy: Array
    """Less the work put in [J]. Shape (n,)."""
    scale: float
    """Kinetic and torsion energy at the start, with what the load winds up [J]."""
    diverged: bool
    sub_steps: int

    @property
    def balance(self) -> float:
        """Mean energy of the last tenth, less that at the start, over the scale."""
        return self._tenths()[-1]

    @property
    def gain(self) -> float:
        """Largest sustained gain: of the mean over a tenth of the run, at least 0."""
        return max(0.0, *self._tenths())

    def _tenths(self) -> list[float]:
        if self.diverged:
            return [inf]
        excess = (self.energy[1:] - self.energy[0]) / self.scale
        return [float(part.mean()) for part in np.array_split(excess, 10)]


@dataclass(frozen=True, kw_only=True, eq=False)
class Joint:
    """A compiled joint."""

    model: mujoco.MjModel
    attached: JointDrive
    law: DriveMap
    """What acts between rotor and link."""
    q: NDArray[np.intp]
    v: NDArray[np.intp]
    midpoint: bool
    """Whether the scheme lives half a step behind the positions."""

    def region(
        self, speed: float, *, torque: float = 0.0, contacts: bool = False
    ) -> Region:
        """Whether its integration holds at a speed of the rotor and a torque."""
        return check_region(
            self.attached,
            timestep=float(self.model.opt.timestep),
            max_input_speed=speed,
            max_torque=torque,
            contacts=contacts,
        )

    def energy(self, position: Array, velocity: Array) -> Array:
        """Kinetic and torsion energy [J]. Shape (n,)."""
        theta, psi = position.T
        inertia = np.array([self.attached.rotor_inertia, self.attached.link_inertia])
        torsion = self.law.torsion(theta, psi)
        kinetic = 0.5 * velocity**2 @ inertia
        return np.asarray(kinetic + self.law.energy(torsion, theta, psi))

    def run(
        self,
        start: Start,
        *,
        duration: float,
        sub_steps: int = 1,
        samples: int = SAMPLES,
    ) -> Course:
        """Run it for a time, with steps cut into equal parts."""
        model = self.model
        whole = float(model.opt.timestep)
        try:
            model.opt.timestep = whole / sub_steps
            steps = max(1, round(duration / whole))
            return self._run(start, steps, sub_steps, min(samples, steps))
        finally:
            model.opt.timestep = whole

    def _run(self, start: Start, steps: int, sub_steps: int, samples: int) -> Course:
        model, law, h = self.model, self.law, float(self.model.opt.timestep)
        data = mujoco.MjData(model)
        e0, slope, _ = law.error_at(law.phases(0.0, 0.0))
        x = np.array([0.0, float(e0) - law.mean_torsion(start.torque)])
        v = start.speed * np.array([1.0, 1.0 / law.ratio + float(slope)])
        behind = 0.5 * h if self.midpoint else 0.0
        data.qpos[self.q], data.qvel[self.v] = x + behind * v, v
        applied = np.zeros(2)
        applied[:] = start.load / law.ratio, -start.load
        data.qfrc_applied[self.v] = applied
        every = steps // samples
        q, rate = np.empty((samples + 1, 2)), np.empty((samples + 1, 2))
        q[0], rate[0] = x, v
        for k in range(1, samples + 1):
            mujoco.mj_step(model, data, every * sub_steps)
            rate[k] = data.qvel[self.v]
            q[k] = data.qpos[self.q] - behind * rate[k]
        bad = any(warning.number for warning in data.warning)
        bad = bad or not (np.isfinite(q).all() and np.abs(rate).max() < 1e9)
        stored = self.energy(q, rate) if not bad else np.full(samples + 1, inf)
        return Course(
            time=np.asarray(np.arange(samples + 1) * (every * sub_steps * h), float),
            position=q,
            velocity=rate,
            energy=stored - q @ applied,
            scale=float(self.energy(q[:1], rate[:1])[0])
            + abs(start.load * law.mean_torsion(start.load)),
            diverged=bad,
            sub_steps=sub_steps,
        )


def make_joint(
    drive: DriveMap,
    *,
    rotor: float,
    link: float,
    step: float,
    level: str = "full",
    integrator: str = "discrete",
) -> Joint:
    """A joint without damping.

    Args:
        drive: Map.
        rotor: Inertia of rotor and wave generator [kg·m²].
        link: Inertia of the link about the joint [kg·m²].
        step: Time step [s].
        level: As for :func:`swgjoint.joint.attach.attach`.
        integrator: MuJoCo's name.
    """
    text = _XML.format(step=step, integrator=integrator, link=link)
    spec = mujoco.MjSpec.from_string(text)
    attached = attach(
        spec,
        joint="joint",
        drive=drive,
        level=level,
        rotor_inertia=rotor,
        damping_ratio=0.0,
        friction=False,
    )
    model = spec.compile()
    joints = [model.joint(name) for name in (attached.rotor, "joint")]
    native = attached.native
    return Joint(
        model=model,
        attached=attached,
        law=attached.drive if native is None else native_map(drive, native),
        q=np.array([int(j.qposadr[0]) for j in joints], dtype=np.intp),
        v=np.array([int(j.dofadr[0]) for j in joints], dtype=np.intp),
        midpoint=level == "full" and integrator == "discrete",
    )
