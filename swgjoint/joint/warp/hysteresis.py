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
    begin = s.begin - rest
    if limit > ZERO:
        begin = wp.clamp(begin, -limit, limit)
    begin = wp.clamp(begin, -reach, reach)
    free = begin + s.change
    end = wp.clamp(free, -reach, reach)
    sticks = real(1.0)
    if end != free:
        sticks = (end - begin) / s.change
    s.torque += stiffness * (HALF * (begin + end) * sticks + end * (ONE - sticks))
    s.slope += HALF * stiffness * sticks * sticks
    s.k0 += stiffness * sticks
    s.k1 += stiffness * sticks
    return s


@wp.func
def relax(
    drive: WarpDrive,
    maps: Maps,
    world: int,
    torsion: real,
    elastic: real,
    state: wp.array2d(dtype=real),
):
    """Update the state of the elements of one drive after a step.

    Args:
        drive: The drive.
        maps: Maps of all drives.
        world: Index of the world.
        torsion: Torsion at the beginning of the step [rad].
        elastic: Mean elastic torque of the step [N·m].
        state: State of all elements, see above [rad].
    """
    count = maps.element.shape[0]
    for j in range(drive.element, drive.element + drive.elements):
        rest = real(state[world, j])
        limit = real(state[world, count + j])
        if limit > ZERO:
            rest = wp.clamp(rest, torsion - limit, torsion + limit)
        reach = reach_at(drive, maps, j, elastic)
        state[world, j] = wp.clamp(rest, torsion - reach, torsion + reach)
        if maps.element[j, 3] > maps.element[j, 2]:
            # positive even without reach, because zero means that there was no step
            state[world, count + j] = wp.max(reach, real(1e-300))
