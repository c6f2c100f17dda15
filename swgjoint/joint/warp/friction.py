# mypy: ignore-errors
"""Friction of a drive in MuJoCo Warp, as in ``friction.cc`` of the plugin."""

import warp as wp

from swgjoint.joint.warp.potential import HALF, ONE, ZERO, WarpDrive, real


@wp.struct
class Rub:
    """Friction of one step, as :class:`~swgjoint.joint.friction_step.FrictionStep`."""

    stretch: real
    reach: real
    offset: real
    rate: real
    force: real
    metric: real
    predicted: real


@wp.func
def scale_losses(drive: WarpDrive, losses: real):
    """Drive with all torques of its friction multiplied.

    Args:
        drive: Drive of the map.
        losses: Factor [-].
    """
    out = drive
    out.bristle = losses * drive.bristle
    out.creep = losses * drive.creep
    out.coulomb = losses * drive.coulomb
    out.stiction = losses * drive.stiction
    out.viscous = losses * drive.viscous
    out.load = losses * drive.load
    return out


@wp.func
def rub_over(
    drive: WarpDrive,
    stretch: real,
    yield_torque: real,
    speed: real,
    free: real,
    response: real,
    h: real,
):
    """Friction torque for the predicted step of a rotor-link pair, as a :class:`Rub`.

    Args:
        drive: Drive with the parameters of friction.
        stretch: Bristle stretch before the step [rad].
        yield_torque: Yield torque in this step [N·m].
        speed: Relative speed at the beginning of the step [rad/s].
        free: Change of that speed without friction [rad/s].
        response: Reduction of that speed per friction torque [rad/s per N·m].
        h: Step h [s].
    """
    out = Rub()
    sigma = drive.bristle
    out.reach = yield_torque / sigma
    z = wp.clamp(stretch, -out.reach, out.reach)
    out.stretch = z
    d = h * (speed + HALF * free)
    k = HALF * h * response
    m = ONE + HALF * response * drive.viscous
    out.offset = sigma * z
    out.rate = HALF * sigma + drive.creep / h
    dx = (d - k * out.offset) / (m + k * out.rate)
    if wp.abs(z + dx) > out.reach:
        # sticks over the distance a, then slips; mean torque times dx is the exact work
        sign = wp.where(dx > ZERO, ONE, -ONE)
        a = out.reach - sign * z
        creep = drive.creep * a / h
        b = sign * d - k * (yield_torque + creep)
        c = k * sigma * a * a
        root = wp.sqrt(b * b + real(2.0) * m * c)
        way = wp.where(b > ZERO, HALF * (b + root) / m, c / (root - b))
        mean = sign * (yield_torque - HALF * sigma * a * a / way + creep)
        dx = sign * way
        # linear in the true dx, and cannot return more energy than is stored
        out.rate = HALF * sigma
        out.offset = mean - out.rate * dx
        if wp.abs(out.offset) > sigma * wp.abs(z):
            out.offset = ZERO
            out.rate = mean / dx
    slope = out.rate + drive.viscous / h
    out.force = out.offset + slope * h * speed
    out.metric = HALF * slope
    out.predicted = out.offset + slope * dx
    return out


@wp.func
def stretch_after(drive: WarpDrive, rub: Rub, dx: real):
    """Bristle stretch after the actual rotation of the step [rad].

    Args:
        drive: Drive with the parameters of friction.
        rub: Linearised friction of the step.
        dx: Actual relative rotation in the step [rad].
    """
    end = wp.clamp(rub.stretch + dx, -rub.reach, rub.reach)
    work = (rub.offset + rub.rate * dx) * dx
    stored = rub.stretch * rub.stretch + real(2.0) * work / drive.bristle
    most = wp.sqrt(wp.max(ZERO, stored))
    return wp.clamp(end, -most, most)
