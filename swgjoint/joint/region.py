"""Region of stable integration of a drive, and sub-steps for steps outside it.

Bounds of the discrete scheme. Here h is the step, n are the orders per input turn, e
and V the amplitudes of kinematic error and cogging energy, T the repeated peak torque,
K the mean stiffness, J the rotor inertia, C = T sum n²e + sum n²V the curvature that
the metric does not include, and w the torsion frequency of rotor against link:

- h <= 5 ms: longer steps are untested;
- h n |theta rate| <= 0.5: beyond this bound the step does not resolve the harmonic;
- h² C <= 0.5 (J + J_link/i²) and C <= 0.5 (K/i² + J/h²): beyond these bounds the rotor
  snaps between several equilibrium positions within a step and gains energy;
  of more than 128 harmonics, C and the next bound contain the largest value of the sum
  at any phases, see :mod:`swgjoint.maps.phase_bounds`;
- i sum n e <= 0.56 and K_max <= 30 K: larger values are untested. K_max includes the
  stiffness of hysteresis elements that can stick together;
- T/(i J), T/J_link <= 1e10 rad/s², here with T at least ``max_torque``: the engine
  treats larger accelerations as a divergence;
- if contacts or joint limits may act, h sqrt(K/J_link) <= 2.5: the engine pushes a
  link out of a contact along a prescribed path, and a light link that vibrates faster
  than the steps drags its rotor along;
- for drives without losses, h w <= 0.25 if an order can excite the torsion: in such a
  resonance only the numerical damping takes energy from the vibration. Even at
  h w = 0.5 it takes less than a hundredth of the energy that a damping ratio of 0.02
  dissipates.

Contacts of the engine feed energy into the torsion of chains that bounce on them, at
any step size and also under RK4. A drive without friction and with a damping ratio
below 0.001 therefore gets a damping ratio of 0.05 while contacts or limits act, see
:data:`~swgjoint.joint.drive.CONTACT_DAMPING_RATIO`; in free motion it has no losses.

A step outside the region is divided into equal sub-steps that are inside it by a
:data:`MARGIN`. Under RK4 and the other integrators, h times the fastest frequency is
bounded, including that of a sticking friction bristle, and h times the decay rate of
the bristle.

The bounds were tested on random joints (K 1e2..1e7 N·m/rad, rotor 1e-7..1e-3 kg·m²,
link 1e-4..1e2 kg·m², i 30..160, low orders and tooth order with side bands, ripple
2-5 %, hardening to 26 K, steps 0.5-5 ms, no physical damping). None of the runs in the
first two rows diverged:

=========================================  =====  ======  =========================
runs                                       number failed  criterion of failure
=========================================  =====  ======  =========================
free, 2 s                                  2302   1       gains > 5 % energy
one to three hysteresis elements of        2254   2       gains > 5 %, elements
0.1 to 20 K stiffness, 1 s                                included
same, yield torques that depend on         820    0       same; largest gain 2.8 %
the load
elements fitted to loops, up to 25 K       756    0       same; largest gain 1e-5
step divided to the edge of the region     ~600   2       gains energy
step divided with the margin               228    0       gains energy
dropped on a floor                         5480   9       gains > 5 % more than the
                                                          engine's floor supplies
same, h sqrt(K/J_link) from 2 to 2.5       582    0       same
same, without the bound of 2.5             3090   12      same; up to three times
                                                          the energy
catalogue drives near resonance,           804    0       loses > 5 %; largest loss
10 s at 1 ms                                              1.5 %
same, without the last bound               1217   83      loses > 5 %
=========================================  =====  ======  =========================

``swgjoint stability --full`` runs a grid of these cases: of 6300 runs none gains energy
and 155 are rejected. Of 792 chains of two links that rest on a floor or press against
limits, with damping ratios of 0, 0.001 and 0.02, none gains energy and none is
rejected. Without the contact damping, some chains would gain more energy than the
contacts of a finer run supply: 12 of the 264 without losses (up to 2.3 times the energy
of their fall), 13 with a damping ratio of 0.001, 2 with 0.02 and none with 0.05. Of the
132 on floors, none would with 0.025. Under RK4 at 25 µs, three of these chains gain up
to 9 times that energy.

These tests are no proof: the step is one linearised solve with two evaluations.
`tests/joint/test_random_joints.py` runs a sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor, inf, log10, sqrt
from weakref import WeakKeyDictionary

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.joint.drive import JointDrive, input_orders
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import sticking_stiffness
from swgjoint.maps.phase_bounds import MANY, largest_sums, largest_total, max_stiffness
from swgjoint.typing import Array

MAX_SUB_STEPS = 64
"""Largest number of sub-steps; runs that need more are rejected. With this number, an
arm at a step of 1 ms still runs in real time; for more, choose a smaller step."""
MAX_PHASE_STEP = 0.5
"""Largest phase step of the highest order, h n |theta rate| [rad]."""
HARDEST = 30.0
"""Largest ratio of the largest to the mean stiffness [-]."""
MARGIN = 1.4
"""Smallest ratio of the longest step inside the region to a sub-step [-]; without a
margin, sub-steps could be at the edge of the region."""


@dataclass(frozen=True, kw_only=True)
class RegionBound:
    """Bound value <= limit, in the unit of ``what``; a met value may be too large."""

    what: str
    """Description of the bounded quantity."""
    value: float
    limit: float
    timestep: float | None
    """Largest step that meets the bound [s]; None if no step does."""

    @property
    def ok(self) -> bool:
        """Whether the bound is met."""
        return self.value <= self.limit * (1.0 + 1e-9)


@dataclass(frozen=True, kw_only=True)
class Region:
    """Bounds of one joint at one step size."""

    joint: str
    """Name of the joint."""
    timestep: float
    """Step h [s]."""
    bounds: tuple[RegionBound, ...]
    """Bounds that apply to the level and the integrator."""

    @property
    def ok(self) -> bool:
        """Whether every bound is met."""
        return all(bound.ok for bound in self.bounds)

    @property
    def suggested_timestep(self) -> float | None:
        """Largest step that meets all bounds, to two digits [s]; None if none does."""
        steps = [bound.timestep for bound in self.bounds if not bound.ok]
        if None in steps:
            return None
        step = min([self.timestep, *(s for s in steps if s is not None)])
        if step == self.timestep:
            return step
        digit = 10.0 ** (floor(log10(step)) - 1)
        return floor(step / digit) * digit

    @property
    def sub_steps(self) -> int | None:
        """Number of equal sub-steps that are inside the region with the margin.

        It is 1 if the step itself is inside, and None if no step is. In a simulation
        loop of your own, use the largest number of all joints::

            n = check_region(drive, timestep=h, max_input_speed=speed).sub_steps
            model.opt.timestep = h / n  # attach keeps the harmonics that h carries
            mujoco.mj_step(model, data, nstep=n)  # one step of h
        """
        steps = [bound.timestep for bound in self.bounds if not bound.ok]
        if None in steps:
            return None
        if not steps:
            return 1
        longest = min(s for s in steps if s is not None)
        return ceil(MARGIN * self.timestep / longest * (1.0 - 1e-9))

    @property
    def exceeded(self) -> str:
        """Text of the exceeded bounds with value and limit; empty inside the region."""
        return "; ".join(
            f"{b.what} = {b.value:.3g} > {b.limit:.3g}" for b in self.bounds if not b.ok
        )

    @property
    def message(self) -> str:
        """One line: ``ok``, or the exceeded bounds and a step that meets them."""
        what = self.exceeded
        if not what:
            return "ok"
        step = self.suggested_timestep
        way_out = (
            "no step helps: use a drive with less kinematic error, or level linear"
            if step is None
            else f"a step of {1e3 * step:.2g} ms would do"
        )
        return (
            f"joint {self.joint!r} at a step of {1e3 * self.timestep:.3g} ms is "
            f"outside the stability region of the integrator: {what}; {way_out}"
        )

    def require(self, max_sub_steps: int = 1) -> int:
        """Number of sub-steps for a stable integration, 1 inside the region.

        Args:
            max_sub_steps: Largest accepted number; 1 rejects steps outside the region.

        Raises:
            ComputationError: If more sub-steps are needed or no step is inside, with
                :attr:`message`.
        """
        parts = self.sub_steps
        if parts is not None and parts <= max_sub_steps:
            return parts
        tail = ""
        if parts is not None and max_sub_steps > 1:
            tail = f" ({parts} sub-steps; accepted: at most {max_sub_steps})"
        raise ComputationError(self.message + tail)


def check_region(
    drive: JointDrive,
    *,
    timestep: float,
    max_input_speed: float = 0.0,
    max_torque: float | None = None,
    contacts: bool = False,
    integrator: str = "discrete",
) -> Region:
    """Check whether a step integrates a joint stably; see the module for the bounds.

    Args:
        drive: Drive that :func:`swgjoint.joint.attach.attach` returned.
        timestep: Step h [s].
        max_input_speed: Largest speed of the rotor [rad/s].
        max_torque: Largest output torque [N·m]; at least the repeated peak torque is
            used.
        contacts: Whether contacts or limits may act on the link.
        integrator: ``discrete``; ``RK4`` and the other integrators treat the drive as
            an explicit force, so h times the fastest frequency is bounded.

    Returns:
        The bounds that apply; none without a rotor or for a native spring under
        ``discrete``.
    """
    native = drive.level in ("linear", "native")
    if drive.rotor is None or (native and integrator == "discrete"):
        bounds: tuple[RegionBound, ...] = ()
    elif integrator == "discrete":
        torque = max(max_torque or 0.0, drive.drive.ratings.repeated_peak)
        bounds = _discrete_bounds(drive, timestep, abs(max_input_speed))
        bounds += (_acceleration_bound(drive, torque),)
        if contacts:
            bounds += (_contact_bound(drive, timestep),)
        if drive.damping == 0.0 and drive.drive.friction is None:
            bounds += (_lossless_bound(drive, timestep, abs(max_input_speed)),)
    else:
        bounds = _explicit_bounds(drive, timestep, integrator)
    return Region(joint=drive.joint, timestep=timestep, bounds=bounds)


def _discrete_bounds(
    drive: JointDrive, h: float, speed: float
) -> tuple[RegionBound, ...]:
    m, i, rotor = drive.drive, abs(drive.ratio), drive.rotor_inertia
    sticking = sticking_stiffness(m.hysteresis)
    n = input_orders(m)[1:]
    if m not in _known_bounds:
        _known_bounds[m] = _map_bounds(m, n)
    slope, curvature, bound = _known_bounds[m]
    met = bound + sticking <= HARDEST * drive.stiffness
    order = float(n.max(initial=0.0))
    inertia = rotor + drive.link_inertia / i**2
    held = drive.stiffness / i**2
    surplus = 2.0 * curvature - held  # part that J/h² has to balance
    return (
        RegionBound(what="step h [s]", value=h, limit=5e-3, timestep=5e-3),
        RegionBound(
            what="phase step h n |theta rate| [rad]",
            value=h * order * speed,
            limit=MAX_PHASE_STEP,
            timestep=MAX_PHASE_STEP / (order * speed) if order * speed else inf,
        ),
        RegionBound(
            what="h² C/(J + J_link/i²)",
            value=h**2 * curvature / inertia,
            limit=0.5,
            timestep=sqrt(0.5 * inertia / curvature) if curvature else inf,
        ),
        RegionBound(
            what="C/(K/i² + J/h²)",
            value=curvature / (held + rotor / h**2),
            limit=0.5,
            timestep=sqrt(rotor / surplus) if surplus > 0.0 else inf,
        ),
        RegionBound(
            what="slope of the kinematic error at the rotor, i sum n e",
            value=i * slope,
            limit=0.56,
            timestep=None,
        ),
        RegionBound(
            what="largest over mean stiffness",
            value=((bound if met else m.max_stiffness) + sticking) / drive.stiffness,
            limit=HARDEST,
            timestep=None,
        ),
    )


# the joints of an arm, and runs of them, share their maps
_known_bounds: WeakKeyDictionary[DriveMap, tuple[float, ...]] = WeakKeyDictionary()


def _map_bounds(drive: DriveMap, n: Array) -> tuple[float, ...]:
    """Bounds of the slope of e0 by theta [-], of C and of the stiffness [N·m/rad].

    Args:
        drive: Map as simulated.
        n: Orders of its harmonics per input turn, without the mean [-].
    """
    peak, error = drive.ratings.repeated_peak, drive.kinematic_error[1:]
    energy = drive.coefficients(drive.torsion_knots)[:, 1:]
    stiffness = max_stiffness(drive, enough=HARDEST * drive.mean_stiffness)
    if n.size <= MANY:
        e, v = (np.hypot(*np.moveaxis(pairs, -1, 0)) for pairs in (error, energy))
        curvature = peak * np.sum(n**2 * e) + np.sum(n**2 * v.max(axis=0))
        return float(np.sum(n * e)), float(curvature), stiffness
    orders = drive.orders[1:]
    # the derivative of a cos + b sin is b cos - a sin, times the order with its sign
    n = (drive.angle_orders[1:] @ [1.0, 1.0 / drive.ratio])[:, None]
    by_theta = n * error[:, ::-1] * [1.0, -1.0]
    slope, of_error = largest_sums(orders, np.stack([by_theta, n**2 * error]))
    of_energy = largest_total(orders, n**2 * energy, np.zeros(len(energy)))
    return float(slope), float(peak * of_error + of_energy), stiffness


def _acceleration_bound(drive: JointDrive, torque: float) -> RegionBound:
    rotor = abs(drive.ratio) * drive.rotor_inertia
    return RegionBound(
        what="acceleration of rotor or link by the largest torque [rad/s²]",
        value=torque / min(rotor, drive.link_inertia),
        limit=1e10,  # mjMAXVAL: the engine treats larger values as a divergence
        timestep=None,
    )


def _contact_bound(drive: JointDrive, h: float) -> RegionBound:
    frequency = sqrt(drive.stiffness / drive.link_inertia)
    return RegionBound(
        what="h times the frequency of the link on its held rotor, with contacts",
        value=h * frequency,
        limit=2.5,
        timestep=2.5 / frequency,
    )


def _lossless_bound(drive: JointDrive, h: float, speed: float) -> RegionBound:
    frequency = drive.natural_frequency
    order = float(input_orders(drive.drive).max(initial=0.0))
    # whether a kept order excites the torsion mode at or below this speed
    resonant = order * speed >= 0.5 * frequency
    return RegionBound(
        what="h times the torsion frequency, without losses at resonance",
        value=h * frequency if resonant else 0.0,
        limit=0.25,
        timestep=0.25 / frequency,
    )


def _explicit_bounds(
    drive: JointDrive, h: float, integrator: str
) -> tuple[RegionBound, ...]:
    stiffness = drive.stiffness
    if drive.level == "full":
        stiffness = drive.drive.max_stiffness
        stiffness += sticking_stiffness(drive.drive.hysteresis)
    elif drive.native is not None:
        peak = drive.drive.mean_torsion(drive.drive.ratings.momentary_peak)
        stiffness = drive.native.largest_slope(abs(peak))
        stiffness += sticking_stiffness(drive.native.hysteresis)
    rotor = drive.ratio**2 * drive.rotor_inertia
    frequency = sqrt(stiffness * (1.0 / rotor + 1.0 / drive.link_inertia))
    # a free vibration is stable up to 2.8 for RK4 and 2 for a semi-implicit step
    rk4 = integrator.upper() == "RK4"
    limit, what = 2.0 if rk4 else 1.0, "the fastest torsion frequency"
    damped: tuple[RegionBound, ...] = ()
    law = drive.friction
    if law is not None:
        # beyond the limit, a sticking bristle creeps below its yield torque or diverges
        mobility = 1.0 / drive.rotor_inertia
        mobility += abs(drive.drive.friction_direction[1]) / drive.link_inertia
        frequency = sqrt(frequency**2 + law.stiffness * mobility)
        what = "the fastest frequency of torsion and friction bristle"
        rate, most = (law.damping + law.viscous) * mobility, 2.5 if rk4 else 1.0
        damped = (
            RegionBound(
                what=f"h times the decay rate of friction under {integrator}",
                value=h * rate,
                limit=most,
                timestep=most / rate if rate else inf,
            ),
        )
    return (
        RegionBound(
            what=f"h times {what} under {integrator}",
            value=h * frequency,
            limit=limit,
            timestep=limit / frequency,
        ),
        *damped,
    )
