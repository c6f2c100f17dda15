"""Where a drive's integration holds, and into how many parts a step is cut elsewhere.

Bounds of the discrete scheme, with n the orders per input turn, e and V the amplitudes
of kinematic error and of cogging energy, T the repeated peak torque, K the stiffness, J
the rotor, C = T sum n²e + sum n²V the curvature that the metric does not hold, w the
torsion frequency of rotor against link:

- h <= 5 ms, tested no further;
- h n |theta rate| <= 0.5: a shorter wave is not carried by the step;
- h² C <= 0.5 (J + J_link/i²) and C <= 0.5 (K/i² + J/h²): beyond, the rotor snaps
  between several positions of equilibrium within a step and gains energy;
- i sum n e <= 0.56 and K_max <= 30 K: tested no further. K_max has the hysteresis that
  sticks;
- T/(i J), T/J_link <= 1e10 rad/s²: the engine itself takes more for a divergence;
- where contacts or joint limits may act, h sqrt(K/J_link) <= 2.5: the engine pushes a
  link out of a contact along a prescribed path, and a light link that vibrates faster
  than the steps drags its rotor along;
- without any loss, h w <= 0.25 where an order can meet the torsion: there nothing but
  the steps takes energy from the resonance. Of what a damping ratio of 0.02 takes they
  take less than a hundredth even at h w = 0.5.

Contacts of the engine feed the torsion of chains that bounce on them, at any step and
also under RK4. So a drive that has neither friction nor a damping ratio of 0.001 gets a
damping ratio of 0.05 while contacts or limits act, see
:data:`~swgjoint.joint.drive.CONTACT_DAMPING_RATIO`; in free motion it has no losses.

A step outside is cut into equal parts that lie inside with a :data:`MARGIN`. RK4 and
the others are bounded by the fastest frequency, that of a friction bristle that sticks
and its decay included.

Tested on random joints (K 1e2..1e7 N·m/rad, rotor 1e-7..1e-3, link 1e-4..1e2 kg·m²,
i 30..160, low orders and tooth order with side bands, ripple 2-5 %, hardening to 26 K,
steps 0.5-5 ms, no physical damping, 2 s): of 2302 runs inside none diverged and one
gained more than 5 % of its energy. With one to three elements of hysteresis, 0.1 to
20 K stiff: of 2254 runs inside (1 s) none diverged and two gained more than 5 %, the
springs of the elements counted. Cut right to the edge, 2 of about 600 gained, with the
margin none of 228.

Dropped on a floor, 9 of 5480 gained 5 % more than the floor of the engine gives by
itself, none of the 582 with h sqrt(K/J_link) from 2 to 2.5; without that bound 12 of
3090 did, up to three times their energy. Turning freely for 10 s near resonance at
1 ms, 804 catalogue drives lost 1.5 % at most; without the last bound 83 of 1217 lost
more than 5 %. ``swgjoint stability --full`` runs a grid of all this: of 6300 runs none
gains energy, 155 are refused. Of 792 chains of two links that lie on a floor or press
against limits with damping ratios of 0, 0.001 and 0.02, none gains and none is refused.
Of the 264 without losses, 12 would gain more than the contacts of a finer run without
the contact damping, up to 2.3 times the energy of their fall; 13 with a ratio of 0.001,
2 with 0.02, none with 0.05, and of the 132 on floors none with 0.025. Under RK4 at
25 µs three of these chains gain up to 9 times that energy.
Not a proof: the step is one linearised solve with two evaluations.
`tests/joint/test_random_joints.py` runs a sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor, inf, log10, sqrt

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.joint.drive import JointDrive, input_orders

MAX_SUB_STEPS = 64
"""Parts of a step beyond which a run is refused instead of sub-stepped: an arm at 1 ms
still runs in real time with that many, and who needs more should choose the step."""
MAX_PHASE_STEP = 0.5
"""Of the highest order in one step, h n |theta rate| [rad]."""
MARGIN = 1.4
"""Longest step inside over one that is cut: cut steps would all lie at the edge."""


@dataclass(frozen=True, kw_only=True)
class RegionBound:
    """One inequality, value <= limit."""

    what: str
    value: float
    limit: float
    timestep: float | None
    """Largest step that meets it [s]; None if no step does."""

    @property
    def ok(self) -> bool:
        """Whether it is met."""
        return self.value <= self.limit * (1.0 + 1e-9)


@dataclass(frozen=True, kw_only=True)
class Region:
    """Whether one joint is inside the region at a step."""

    joint: str
    timestep: float
    bounds: tuple[RegionBound, ...]

    @property
    def ok(self) -> bool:
        """Whether every bound is met."""
        return all(bound.ok for bound in self.bounds)

    @property
    def suggested_timestep(self) -> float | None:
        """Largest step to two digits that meets every bound [s]; None if none does."""
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
        """Equal parts of the step that lie well inside, 1 if it is inside itself.

        None if no step does. In a loop of one's own, with the largest of all joints::

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
        """What is exceeded, with value and limit; empty inside."""
        return "; ".join(
            f"{b.what} = {b.value:.3g} > {b.limit:.3g}" for b in self.bounds if not b.ok
        )

    @property
    def message(self) -> str:
        """One line: ``ok``, or what is exceeded and the step that would do."""
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
            f"outside the integrator's region: {what}; {way_out}"
        )

    def require(self, max_sub_steps: int = 1) -> int:
        """Sub-steps with which the integration holds, 1 inside the region.

        Args:
            max_sub_steps: Largest number that is accepted; 1 refuses what is outside.

        Raises:
            ComputationError: With :attr:`message` if it takes more.
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
    """Whether a joint's integration holds at a step; see the module for the bounds.

    Args:
        drive: What :func:`swgjoint.joint.attach.attach` returned.
        timestep: Step h [s].
        max_input_speed: Largest speed of the rotor [rad/s].
        max_torque: Largest torque at the output [N·m]; the repeated peak torque if None
            or smaller.
        contacts: Whether contacts or limits may act on the link.
        integrator: ``discrete``; for ``RK4`` and the others, which take the drive as an
            explicit force, the bound is on h times the fastest torsion frequency.
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
    sticking = sum(element.stiffness for element in m.hysteresis)
    n = input_orders(m)[1:]
    e = np.hypot(*m.kinematic_error[1:].T)
    energy = np.hypot(*np.moveaxis(m.coefficients(m.torsion_knots), -1, 0))[:, 1:]
    curvature = float(
        m.ratings.repeated_peak * np.sum(n**2 * e) + np.sum(n**2 * energy.max(axis=0))
    )
    order = float(n.max(initial=0.0))
    inertia = rotor + drive.link_inertia / i**2
    held = drive.stiffness / i**2
    surplus = 2.0 * curvature - held  # what J/h² has to carry
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
            value=i * float(np.sum(n * e)),
            limit=0.56,
            timestep=None,
        ),
        RegionBound(
            what="largest over mean stiffness",
            value=(m.max_stiffness + sticking) / drive.stiffness,
            limit=30.0,
            timestep=None,
        ),
    )


def _acceleration_bound(drive: JointDrive, torque: float) -> RegionBound:
    rotor = abs(drive.ratio) * drive.rotor_inertia
    return RegionBound(
        what="acceleration of rotor or link by the largest torque [rad/s²]",
        value=torque / min(rotor, drive.link_inertia),
        limit=1e10,  # mjMAXVAL: the engine takes more for a divergence
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
    # a kept order meets the torsion, or comes near, at or below this speed
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
        stiffness += sum(element.stiffness for element in drive.drive.hysteresis)
    elif drive.native is not None:
        peak = drive.drive.mean_torsion(drive.drive.ratings.momentary_peak)
        stiffness = drive.native.largest_slope(abs(peak))
        stiffness += sum(element.stiffness for element in drive.native.hysteresis)
    rotor = drive.ratio**2 * drive.rotor_inertia
    frequency = sqrt(stiffness * (1.0 / rotor + 1.0 / drive.link_inertia))
    # stability ends at 2.8 for RK4 and 2 for a semi-implicit step, in free oscillation
    rk4 = integrator.upper() == "RK4"
    limit, what = 2.0 if rk4 else 1.0, "the fastest torsion frequency"
    damped: tuple[RegionBound, ...] = ()
    law = drive.friction
    if law is not None:
        # a bristle that sticks: beyond it creeps below its yield torque, or diverges
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
