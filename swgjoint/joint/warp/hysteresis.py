# mypy: ignore-errors
"""Hysteresis elements of a drive in MuJoCo Warp, as in ``hysteresis.h`` of the plugin.

The state of the elements of all drives is an array with one row per world. Its first
half contains the torsions at which the elements are relaxed, its second half their
yield torsions in the last step, which are zero if there was none. The second half is
used only by elements whose yield torque depends on the load.
"""

import warp as wp

from swgjoint.joint.warp.potential import (
    HALF,
    ONE,
    ZERO,
    Maps,
    Secant,
    WarpDrive,
    real,
)


@wp.func
def reach_at(drive: WarpDrive, maps: Maps, j: int, elastic: real):
    """Yield torsion of one element [rad] at an elastic torque [N·m].

    Args:
        drive: Drive of the element.
        maps: Maps of all drives.
        j: Index of the element.
        elastic: Elastic torque [N·m].
    """
    reach = real(maps.element[j, 1])
    first = drive.curve + int(maps.element[j, 2])
    end = drive.curve + int(maps.element[j, 3])
    size = wp.abs(elastic)
    at = real(0.0)
    for k in range(first, end):
        if size > at:
            part = wp.min((size - at) / (maps.curve[k, 0] - at), ONE)
            reach += part * (maps.curve[k, 1] - reach)
        at = real(maps.curve[k, 0])
    return reach


@wp.func
def begin_at(torsion: real, rest: real, limit: real, reach: real):
    """Stretch of an element at the beginning of a step [rad].

    Args:
        torsion: Torsion at the beginning of the step [rad].
        rest: Torsion at which the element is relaxed [rad].
        limit: Yield torsion in the last step [rad]; zero if there was none.
        reach: Yield torsion in this step [rad].
    """
    begin = torsion - rest
    if limit > ZERO:
        begin = wp.clamp(begin, -limit, limit)
    return wp.clamp(begin, -reach, reach)


@wp.func
def sticking_part(begin: real, change: real, reach: real):
    """Fraction of the change of the torsion over which an element sticks [-].

    Args:
        begin: Stretch at the beginning of the step [rad].
        change: Change of the torsion [rad].
        reach: Yield torsion in this step [rad].
    """
    free = begin + change
    end = wp.clamp(free, -reach, reach)
    sticks = real(1.0)
    if end != free:
        sticks = (end - begin) / change
    return sticks


@wp.func
def mean_stretch(begin: real, change: real, reach: real, sticks: real):
    """Mean torque of an element over a step, divided by its stiffness [rad].

    Args:
        begin: Stretch at the beginning of the step [rad].
        change: Change of the torsion [rad].
        reach: Yield torsion in this step [rad].
        sticks: Result of :func:`sticking_part` [-].
    """
    end = wp.clamp(begin + change, -reach, reach)
    return HALF * (begin + end) * sticks + end * (ONE - sticks)


@wp.func
def passive_rate(begin: real, change: real, mean: real, sticks: real):
    """Rate of the applied torque, divided by the stiffness [-].

    Args:
        begin: Stretch at the beginning of the step [rad].
        change: Predicted change of the torsion [rad].
        mean: Result of :func:`mean_stretch` [rad].
        sticks: Result of :func:`sticking_part` [-].
    """
    rate = HALF * sticks * sticks
    if sticks != ONE:
        work, stored = mean * change, begin * begin
        total = work + stored + wp.abs(begin) * wp.sqrt(real(2.0) * work + stored)
        if total > ZERO:
            rate = wp.max(rate, mean * mean / total)
    return rate


@wp.func
def slip(
    s: Secant,
    drive: WarpDrive,
    maps: Maps,
    j: int,
    losses: real,
    elastic: real,
    rest: real,
    limit: real,
):
    """Secant with the mean torque of one hysteresis element over the step added.

    Args:
        s: Secant to which the element is added.
        drive: Drive of the element.
        maps: Maps of all drives.
        j: Index of the element.
        losses: Factor of the torques of all elements [-].
        elastic: Mean elastic torque of the step [N·m].
        rest: Torsion at which the element is relaxed [rad].
        limit: Yield torsion in the last step [rad]; zero if there was none.
    """
    stiffness = losses * maps.element[j, 0]
    reach = reach_at(drive, maps, j, elastic)
    begin = begin_at(s.begin, rest, limit, reach)
    sticks = sticking_part(begin, s.change, reach)
    mean = mean_stretch(begin, s.change, reach, sticks)
    rate = passive_rate(begin, s.change, mean, sticks)
    s.torque += stiffness * mean
    s.slope += stiffness * rate
    s.k0 += stiffness * sticks
    s.k1 += stiffness * sticks
    return s


@wp.func
def relax(
    drive: WarpDrive,
    maps: Maps,
    world: int,
    torsion: real,
    predicted: real,
    change: real,
    elastic: real,
    state: wp.array2d(dtype=real),
):
    """Update the state of the elements of one drive after a step.

    Args:
        drive: The drive.
        maps: Maps of all drives.
        world: Index of the world.
        torsion: Torsion at the beginning of the step [rad].
        predicted: Predicted change of the torsion [rad].
        change: Actual change of the torsion [rad].
        elastic: Mean elastic torque of the step [N·m].
        state: State of all elements, see above [rad].
    """
    count = maps.element.shape[0]
    for j in range(drive.element, drive.element + drive.elements):
        rest = real(state[world, j])
        limit = real(state[world, count + j])
        reach = reach_at(drive, maps, j, elastic)
        begin = begin_at(torsion, rest, limit, reach)
        if limit > ZERO:
            rest = wp.clamp(rest, torsion - limit, torsion + limit)
        rest = wp.clamp(rest, torsion - reach, torsion + reach)
        sticks = sticking_part(begin, predicted, reach)
        end = wp.clamp(begin + change, -reach, reach)
        if sticks != ONE:
            # an element stores at most its previous energy plus the work of the step
            mean = mean_stretch(begin, predicted, reach, sticks)
            rate = passive_rate(begin, predicted, mean, sticks)
            work = (mean - rate * predicted + rate * change) * change
            most = wp.sqrt(wp.max(ZERO, begin * begin + real(2.0) * work))
            end = wp.clamp(end, -most, most)
        state[world, j] = rest + (begin + change - end)
        if maps.element[j, 3] > maps.element[j, 2]:
            # positive even without reach, because zero means that there was no step
            state[world, count + j] = wp.max(reach, real(1e-300))
