r"""One joint of the stability study: rotor, drive and link, and their energy.

The load applies a constant torque T and the motor a torque T/i. Without damping, the
energy

.. math::
    E = \tfrac12 J\dot\theta^2 + \tfrac12 J_l\dot\psi^2 + V(\Delta)
        - \frac{T}{i}\theta + T\psi

is then constant; the last two terms subtract the work of both torques. The discrete
scheme is a midpoint rule for the positions half a step before those of the engine, so E
is evaluated at these earlier positions.
"""

from __future__ import annotations

from collections.abc import Sequence
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
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.typing import Array
from swgjoint.units import arcmin

RATIO = 100
"""Magnitude of the ratio of the drive [-]."""
ORDERS = (2, 4)
"""Orders of the kinematic error per input turn."""
ERROR = 1.0 * arcmin
"""Amplitude of each order [rad]."""
REACH = 4e-3
"""Torsion at full torque, which is the repeated peak torque [rad]. For comparison, a
CSG-25-100 has 204 N·m and 5e4 N·m/rad, which also gives about 4 mrad."""
HARDENING = 2.0
"""Relative increase of the stiffness from zero to full torque [-]."""
FRICTION = 0.05
"""Friction torque at the output over the load [-]; the tooth friction of size 25 with a
coefficient of 0.1 takes about as much."""
ELEMENTS = 8
"""Number of elements that share the hysteresis."""
STICKING = 25.0
"""Stiffness of the elements that stick at a load over the mean stiffness [-], the
largest of fitted maps."""
SAMPLES = 400
"""Default number of energy samples along a run."""
GAIN = 0.05
"""Relative rise of the energy above which a run counts as an energy gain [-]."""

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
    """Mean torsion curve of a drive with the kinematic error of this study.

    The map has neither hysteresis nor friction; its damping ratio is kept.
    """
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
    """Map of a spring with hardening stiffness and kinematic error.

    Args:
        stiffness: Stiffness at zero torque [N·m/rad].
    """
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


def with_friction_of_teeth(drive: DriveMap) -> DriveMap:
    """The map with hysteresis as fitted to computed loops.

    The yield torque is :data:`FRICTION` times the load. Each element carries torque
    around one load, and two of them stick together.

    Args:
        drive: A map without hysteresis.
    """
    loads = np.linspace(0.0, drive.ratings.repeated_peak, ELEMENTS + 1)[1:]
    elements = tuple(
        Jenkin(
            stiffness=0.5 * STICKING * drive.mean_stiffness,
            yield_torque=0.0,
            yield_curve=tuple(
                (float(at), FRICTION * float(at) * float(at == load)) for at in loads
            ),
        )
        for load in loads
    )
    return replace(drive, hysteresis=elements)


@dataclass(frozen=True, kw_only=True)
class Start:
    """Initial conditions and load of a run."""

    torque: float = 0.0
    """Initial torque of the drive on the link [N·m]."""
    load: float = 0.0
    """Constant load torque T on the link during the run [N·m]; the motor applies T/i.
    """
    speed: float = 0.0
    """Initial rotor speed [rad/s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """Sampled states of a run, including the initial one."""

    time: Array
    """Sample times [s], shape (n,)."""
    position: Array
    """Angles of rotor and link at which the scheme evaluates forces [rad], shape
    (n, 2); for arms, all positions, shape (n, nq)."""
    velocity: Array
    """Speeds of rotor and link [rad/s], shape (n, 2); for arms (n, nv)."""
    energy: Array
    """Energy minus the work of the applied torques [J], shape (n,)."""
    scale: float
    """Energy by which gains are divided [J]: the initial kinetic and torsion energy
    plus the energy that the load stores in the drive; for falling arms, the largest
    kinetic and torsion energy."""
    diverged: bool
    """Whether the engine warned, or a state is not finite or too fast."""
    sub_steps: int
    """Number of parts of a time step."""

    @property
    def balance(self) -> float:
        """Mean change of energy in the last tenth, divided by the scale [-].

        The change is relative to the initial energy, and infinite if the run diverged.
        """
        return self._tenths()[-1]

    @property
    def gain(self) -> float:
        """Largest mean gain over a tenth of the run, divided by the scale, >= 0 [-]."""
        return max(0.0, *self._tenths())

    def _tenths(self) -> list[float]:
        if self.diverged:
            return [inf]
        excess = (self.energy[1:] - self.energy[0]) / self.scale
        return [float(part.mean()) for part in np.array_split(excess, 10)]


@dataclass(frozen=True, kw_only=True, eq=False)
class Joint:
    """A compiled joint of rotor, drive and link."""

    model: mujoco.MjModel
    attached: JointDrive
    """Elements of the drive in the model."""
    law: DriveMap
    """Map that acts between rotor and link."""
    q: NDArray[np.intp]
    """Indices of rotor and link in the position vector."""
    v: NDArray[np.intp]
    """Indices of rotor and link in the velocity vector."""
    midpoint: bool
    """Whether the scheme evaluates forces at positions half a step earlier."""

    def region(
        self, speed: float, *, torque: float = 0.0, contacts: bool = False
    ) -> Region:
        """Stability region of the joint at its time step, checked for a run.

        Args:
            speed: Largest rotor speed [rad/s].
            torque: Largest output torque [N·m].
            contacts: Whether the link touches other bodies.
        """
        return check_region(
            self.attached,
            timestep=float(self.model.opt.timestep),
            max_input_speed=speed,
            max_torque=torque,
            contacts=contacts,
        )

    def energy(self, position: Array, velocity: Array) -> Array:
        """Kinetic and torsion energy [J], shape (n,).

        Args:
            position: Angles of rotor and link [rad], shape (n, 2).
            velocity: Speeds of rotor and link [rad/s], shape (n, 2).
        """
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
        """Run the joint.

        Args:
            start: Initial conditions and load.
            duration: Duration [s].
            sub_steps: Number of equal parts of a time step.
            samples: Largest number of samples after the initial one.

        Returns:
            Sampled states and energy.
        """
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


def torsion_energy(drives: Sequence[JointDrive], theta: Array, psi: Array) -> Array:
    """Energy that the drives of a chain store [J], shape (n,).

    Args:
        drives: Drives of the chain.
        theta: Rotor angles [rad], shape (n, n_drives).
        psi: Link angles [rad], shape (n, n_drives).
    """
    total = np.zeros(len(theta))
    for one, rotor, link in zip(drives, theta.T, psi.T, strict=True):
        total += one.drive.energy(one.drive.torsion(rotor, link), rotor, link)
    return total


def make_joint(
    drive: DriveMap,
    *,
    rotor: float,
    link: float,
    step: float,
    level: str = "full",
    integrator: str = "discrete",
) -> Joint:
    """Build a joint without damping.

    Args:
        drive: Map of the drive.
        rotor: Inertia of rotor and wave generator [kg·m²].
        link: Inertia of the link about the joint [kg·m²].
        step: Time step [s].
        level: Level of the joint, see :func:`swgjoint.joint.attach.attach`.
        integrator: Name of the integrator in MJCF.
    """
    text = _XML.format(step=step, integrator=integrator, link=link)
    midpoint = level == "full" and integrator == "discrete"
    return compile_joint(text, drive, rotor=rotor, level=level, midpoint=midpoint)


def compile_joint(
    text: str, drive: DriveMap, *, rotor: float, level: str, midpoint: bool
) -> Joint:
    """Attach a drive without damping to the hinge of a model.

    Args:
        text: Model in MJCF whose only hinge is called ``joint``.
        drive: Map of the drive.
        rotor: Inertia of rotor and wave generator [kg·m²].
        level: Level of the joint.
        midpoint: See :class:`Joint`.
    """
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
        midpoint=midpoint,
    )
