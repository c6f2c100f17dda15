r"""Ratcheting torque: the largest torque that the teeth carry at a locked input.

The output is turned back step by step while the wave generator is locked, so that the
torque is a result and may decrease. At its maximum,

.. math:: \frac{dT}{d\psi} = 0,

the teeth begin to ratchet: no equilibrium exists at a larger torque. The rim stands on
the bearing of the wave generator if the 2D model represents it, otherwise on a rigid
surface, which holds the teeth in mesh at larger torques. The wave generator is locked
and centred, or free to move sideways as in an Oldham coupling, where the teeth hold
about half of the torque (size 25). The torsion of a cup acts in series and has no
effect. Its coning is not modelled.

The result depends on the outside of the circular spline. If it is free (design key
``circular_spline.outer_rim = "free"``), the circular spline becomes oval and releases
the teeth. If it is fixed, the teeth jam. The torque at which the search ends is then a
lower bound in this model, at stresses far above the strength of steel.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.arrays import frozen_array
from swgjoint.errors import ComputationError, Outcome
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.equilibrium import NewtonSolver
from swgjoint.fe.plane.figures.floating import FloatingGenerator
from swgjoint.fe.plane.state import State
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import without_errors
from swgjoint.gear.wave_generators.wave_generator import lobe_height
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array
from swgjoint.units import um

STEP = 0.04
"""Step of the output, in tooth pitches [-]."""
SHORTEST = 1e-3
"""Step of the output below which the search ends, in tooth pitches [-]."""
FALL = 0.02
"""Fall of the torque in one step, relative to the torque, above which the step is
halved, so that the largest torque is found [-]."""
CIRCULAR_SPLINE_RANGE = 2.0
"""Largest accepted displacement of the circular spline, in lobe heights [-]. The error
of its linear model is of second order in its rotation. A displacement of one lobe
height at the pitch radius is a rotation of 0.02 to 0.04 rad, and the displacement of
second order amounts to a few percent of the tooth depth."""
ITERATIONS = 200
"""Largest number of iterations per equilibrium. A map needs at most 120, but close to
the largest torque the contacts settle slowly."""
AWAY = 1e-3
"""Offset at which the search for the place of a floating wave generator starts, in lobe
heights [-]: its centre may be a saddle."""
TOLERANCE = 1e-4
"""Increment of the nodes below which the iteration ends, in lobe heights [-]. Below it
conforming flanks exchange contact points for many iterations while the torque remains
almost constant."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RatchetingPath:
    """Equilibria at which the output is turned back with the wave generator locked."""

    turned: Array
    """Angle by which the output is turned back, increasing from zero (n,) [rad]."""
    torque: Array
    """Output torque T (n,) [N·m]."""
    energy: Array
    """Strain energy of the whole drive (n,) [J]."""
    pairs: NDArray[np.int64]
    """Number of flexspline teeth in contact, whole drive (n,)."""
    offset: Array
    """Offset of the wave generator's centre (n, 2) [m]."""
    pitch: float
    """Tooth pitch of the flexspline [rad]."""
    on_bearing: bool = False
    """Whether the rim stands on the bearing of the wave generator."""
    outcome: Outcome
    """Outcome of the failed solve that ended the path; ``CONVERGED`` if none failed."""

    def __post_init__(self) -> None:
        turned = frozen_array(self.turned, "turned [rad]", ndim=1)
        object.__setattr__(self, "turned", turned)
        offset = frozen_array(self.offset, "offset [m]", shape=(turned.size, 2))
        object.__setattr__(self, "offset", offset)
        for key in ("torque", "energy"):
            values = frozen_array(getattr(self, key), key, shape=turned.shape)
            object.__setattr__(self, key, values)

    @property
    def passed(self) -> bool:
        """Whether the path goes beyond the largest torque that the teeth carry.

        A maximum without teeth in contact does not count: within the backlash the
        torque is only round-off.
        """
        k = int(self.torque.argmax())
        return bool(self.pairs[k] > 0 and self.torque[-1] < self.torque[k])

    @property
    def limit(self) -> float:
        """Largest torque of the path [N·m].

        It is the ratcheting torque if :attr:`passed`, otherwise a lower bound on it. A
        parabola through the largest value and its neighbours gives the maximum.
        """
        k = int(self.torque.argmax())
        if not 0 < k < self.torque.size - 1:
            return float(self.torque[k])
        x, y = self.turned[k - 1 : k + 2], self.torque[k - 1 : k + 2]
        a, b, c = np.polyfit(x - x[1], y, 2)
        return float(c - b**2 / (4.0 * a)) if a < 0.0 else float(y[1])

    def as_dict(self) -> dict[str, Any]:
        """The path as a JSON-compatible dictionary."""
        parts, k = self.turned / self.pitch, int(self.torque.argmax())
        return {
            "limit_Nm": self.limit,
            "passed": self.passed,
            "at_largest_pitches": float(parts[k]),
            "at_largest_pairs": int(self.pairs[k]),
            "turned_pitches": parts.tolist(),
            "torque_Nm": self.torque.tolist(),
            "pairs": self.pairs.tolist(),
            "on_bearing": self.on_bearing,
            "offset_um": float(np.hypot(*self.offset[k])) / um,
            "outcome": self.outcome.name.lower(),
        }


def ratcheting_path(
    design: Design,
    *,
    input_angle: float = 0.0,
    bearing: bool = True,
    floating: bool = False,
    step: float = STEP,
    upto: float = 1.0,
    progress: Progress = silent,
) -> RatchetingPath:
    """Path of equilibria until the torque decreases, or up to a given output rotation.

    The teeth have neither errors nor friction.

    Args:
        design: The drive. The result depends on whether the outside of its circular
            spline is fixed or free.
        input_angle: Locked input angle [rad].
        bearing: Whether the rim stands on the bearing, see
            :func:`~swgjoint.fe.plane.drive2d.sector_model`.
        floating: Whether the wave generator is free to move sideways, see
            :mod:`swgjoint.fe.plane.figures.floating`, instead of centred.
        step: Largest step of the output, in tooth pitches [-].
        upto: Rotation of the output at which the search ends at the latest, in tooth
            pitches [-].
        progress: Called with the stage, the rotation of the output in percent of a
            pitch, and 100.

    Returns:
        The path. It may also end early because a solve failed, see its ``outcome``.

    Raises:
        DesignError: If the design cannot be built.
        ComputationError: If the start without load cannot be solved.
    """
    follow = path_follower(design, bearing=bearing, whole=floating)
    pitch = 2.0 * pi / design.drive.teeth_flexspline
    state = follow.engage(follow.deflect(input_angle))
    if not state.outcome.ok:
        raise ComputationError(f"{design.drive.name}: {state.outcome.value}")
    first = follow.output_angle(state)
    start = np.array([0.0, AWAY * follow.model.lobe_height])
    place = FloatingGenerator(offset=start) if floating else None
    states, turned, offsets = [state], [0.0], [np.zeros(2)]
    part, increment, outcome = 0.0, step, Outcome.CONVERGED
    while part < upto - 1e-9:
        begun = follow.rotate_output(state, first - (part + increment) * pitch)
        if place is None:
            tried, there = follow.hold_output(begun), None
        else:
            tried, there = place.settle(follow, begun)
        steep = _pairs(state) and tried.torque < (1.0 - FALL) * state.torque
        if not tried.outcome.ok or (steep and increment > 4.0 * SHORTEST):
            increment *= 0.5
            if increment < SHORTEST:
                outcome = tried.outcome
                break
            continue
        state, place, part = tried, there, part + increment
        increment = min(step, 1.5 * increment)
        states.append(state)
        offsets.append(np.zeros(2) if place is None else place.offset)
        turned.append(part * pitch)
        progress(f"{design.drive.name}: ratcheting", round(100 * part), 100)
        if _pairs(states[-2]) and state.torque < states[-2].torque:
            break
    return RatchetingPath(
        turned=np.array(turned),
        torque=np.array([s.torque for s in states]),
        energy=np.array([s.energy for s in states]),
        pairs=np.array([follow.model.copies * _pairs(s) for s in states]),
        offset=np.array(offsets),
        pitch=pitch,
        on_bearing=follow.model.race is not None,
        outcome=outcome,
    )


def path_follower(
    design: Design, *, bearing: bool = True, whole: bool = False
) -> Continuation:
    """Continuation of a drive without errors and friction, for large torques.

    Args:
        design: The drive.
        bearing: As in :func:`ratcheting_path`.
        whole: Whether to model the whole drive even if it is symmetric.
    """
    perfect = without_errors(design)
    small = TOLERANCE * lobe_height(design)
    solver = NewtonSolver(
        max_iterations=ITERATIONS,
        step_tolerance=small,
        thorough_below=10.0 * small,
        circular_spline_range=CIRCULAR_SPLINE_RANGE,
    )
    return Continuation(
        model=sector_model(
            perfect,
            half=False if whole else "auto",
            friction=False,
            bearing=bearing,
        ),
        ratio=design.ratio,
        layout=design.drive.layout,
        solver=solver,
    )


def _pairs(state: State) -> int:
    """Number of flexspline teeth in contact, in the model."""
    if state.contacts is None:
        return 0
    return int(np.unique(state.contacts.sector).size)
