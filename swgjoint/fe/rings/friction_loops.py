r"""Torque loops of the thin rings with friction, for the hysteresis of a map.

:func:`swgjoint.fe.rings.friction.friction_path` provides the frictionless torque
:math:`T_0(x)` and the torque mu R of contacts that all slide. In between, the contacts
stick and act like a spring k in series with a slider, whose torque is t:

.. math:: T = T_0(x) + t, \quad dt = k\,dx, \quad |t| \le \mu R(T_0) .

All contacts are thus assumed to start sliding at the same torsion after a reversal; in
a drive the less loaded ones slide first. Without load the contacts of the teeth carry
no force, so that R is zero there; the clearance belongs to the elastic torsion.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import copysign
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from swgjoint.errors import ComputationError, Outcome
from swgjoint.fe.plane.figures.friction_loop import whole_path
from swgjoint.fe.rings.friction import POSITIONS, RubbedPath, friction_path
from swgjoint.fe.rings.loading import positions
from swgjoint.fe.rings.model import thin_ring
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import without_errors
from swgjoint.maps.fit.friction_loop import FrictionLoop
from swgjoint.maps.unfinished import Unfinished
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array

HELD = 0.1
"""Torque at the ends of a clearance as a fraction of the torque that takes it up [-].
It determines the stiffness of the elastic torsion in the clearance."""


def ring_friction_loops(
    design: Design,
    *,
    top: float,
    rated: float | None = None,
    progress: Progress = silent,
    keep: Unfinished | None = None,
) -> tuple[FrictionLoop, ...]:
    """Torque loops at a few locked input positions, with friction of teeth and race.

    Manufacturing errors are not included.

    Args:
        design: A drive with a coefficient of friction.
        top: Largest torque [N·m].
        rated: Rated torque, which adds the small loops of
            :func:`swgjoint.fe.plane.figures.friction_loop.small_loop_torques` [N·m];
            None adds none.
        progress: Called with the stage, the number of finished loops and their total.
        keep: Store of the loading paths, which drives with other errors and another
            coefficient of friction share; None stores none.

    Returns:
        One loop per position, followed by its small loops.

    Raises:
        DesignError: If the design cannot be built or has features that the model lacks.
        ComputationError: If the largest torque cannot be reached.
    """
    perfect, name = without_errors(design), design.drive.name
    torque, ends = whole_path(top, rated)
    stage = f"{name}: friction loops of the thin rings"
    outward = np.unique(np.abs(torque))[1:]
    loops = []
    places = positions(thin_ring(perfect), POSITIONS).tolist()
    for k, angle in enumerate(places):
        progress(stage, k, len(places))
        path = _loading_path(perfect, outward, angle, k, keep)
        if not path.outcome.ok:
            raise ComputationError(
                f"{name}: no equilibrium of the thin rings above {path.torque[-1]:.4g}"
                f" N·m at input angle {angle:.4g} rad: {path.outcome.value}"
            )
        loop = path_loop(
            path, torque, design.friction.tooth_coefficient, angle, ends[-1][1]
        )
        loops += [loop.cut_path(end, quarter) for end, quarter in ends]
    progress(stage, len(places), len(places))
    return tuple(loops)


def _loading_path(
    perfect: Design, torques: Array, angle: float, number: int, keep: Unfinished | None
) -> RubbedPath:
    """Loading path at an input angle, read from the store or computed and stored."""
    name = f"friction-path-{number:04d}"
    stored = None if keep is None else keep.read(name, partial(_stored, torques, angle))
    if stored is not None:
        return stored
    path = friction_path(perfect, torques, angles=[angle])
    if keep is not None and path.outcome.ok:
        content = {
            k: v for k, v in vars(path).items() if k not in ("outcome", "shares")
        }
        names = {f"share_{part}": share for part, share in path.shares.items()}
        keep.write(name, {"angle": angle, "wanted": torques, **content, **names})
    return path


def _stored(torques: Array, angle: float, arrays: Mapping[str, Any]) -> RubbedPath:
    """Loading path of another map.

    Raises:
        ValueError: If it has other torques or another input angle, or is not finite.
    """
    content = {key: np.asarray(value, float) for key, value in arrays.items()}
    if not all(np.isfinite(value).all() for value in content.values()):
        raise ValueError("a stored loading path is not finite")
    wanted = content.pop("wanted")
    if content.pop("angle") != angle or not np.array_equal(wanted, torques):
        raise ValueError("a stored loading path has another angle or other torques")
    begin = "share_"
    named = [key for key in content if key.startswith(begin)]
    shares = {key.removeprefix(begin): content.pop(key) for key in named}
    return RubbedPath(
        series=float(content.pop("series")),
        shares=shares,
        outcome=Outcome.CONVERGED,
        **content,
    )


def path_loop(
    path: RubbedPath, torque: Array, mu: float, input_angle: float, quarter: int
) -> FrictionLoop:
    """Torque loop of a drive from its frictionless loading path.

    Args:
        path: Loading path with the stiffness of sticking contacts. Its torques include
            all positive torques of the loop.
        torque: Torques of the loop, see :class:`FrictionLoop` (n,) [N·m].
        mu: Coefficient of friction [-].
        input_angle: Locked input angle theta [rad].
        quarter: Number of steps in each quarter of the last round.
    """
    assert path.sticking is not None
    # the torques of the path without the one that only takes up the clearance
    on = np.isin(path.torque, torque)
    load, torsion, stiff = path.torque[on], path.torsion[on], 1.0 / path.compliance[on]
    half, first = path.torsion_at(0.0), 1.0 / float(path.compliance[0])
    held = min(first, HELD * float(path.torque[0]) / half) if half > 0.0 else first
    knots = np.concatenate([-torsion[::-1], [0.0], torsion])
    slopes = np.concatenate([stiff[::-1], [held], stiff])
    loads = np.concatenate([-load[::-1], [0.0], load])
    elastic = CubicHermiteSpline(knots, loads, slopes)

    middle = 0.5 * (path.torque[:-1] + path.torque[1:])
    # friction per load at the ends is that of the outermost intervals
    share = path.torque_per_mu / middle

    def limit(elastic_torque: float) -> float:
        """Friction torque of sliding contacts [N·m]."""
        size = abs(elastic_torque)
        return mu * size * float(np.interp(size, middle, share))

    def stick(elastic_torque: float) -> float:
        """Stiffness of sticking contacts [N·m/rad]."""
        assert path.sticking is not None
        return float(np.interp(abs(elastic_torque), middle, path.sticking))

    def rubbed(x: float, x_0: float, t_0: float) -> float:
        """Friction torque at a torsion, after that at an earlier torsion [N·m]."""
        at = float(elastic(x))
        most, t = limit(at), t_0 + stick(at) * (x - x_0)
        return t if abs(t) <= most else copysign(most, t)

    def excess(x: float, x_0: float, t_0: float, wanted: float) -> float:
        """Torque at a torsion minus the wanted one [N·m]."""
        return float(elastic(x)) + rubbed(x, x_0, t_0) - wanted

    x, t, work = 0.0, 0.0, 0.0
    rows = [(x, work)]
    # the largest torque is reached at the last torsion up to rounding
    reach = (1.0 + 1e-9) * float(torsion[-1])
    for wanted in torque[1:].tolist():
        x_0, t_0 = x, t
        x = float(brentq(excess, -reach, reach, args=(x_0, t_0, wanted), xtol=1e-15))
        t = rubbed(x, x_0, t_0)
        slid = x - x_0 - (t - t_0) / stick(float(elastic(x)))
        work += max(0.0, t * slid)
        rows.append((x, work))
    place = np.searchsorted(loads, torque)
    torsions, works = np.array(rows).T
    return FrictionLoop(
        input_angle=input_angle,
        quarter=quarter,
        torque=torque,
        torsion=torsions,
        elastic_torsion=knots[place],
        stiffness=slopes[place],
        work=works,
    )
