# mypy: ignore-errors
"""The potential of a map in Warp: sums over harmonics, and secants."""

import warp as wp

real = wp.float64


vec5 = wp.types.vector(length=5, dtype=real)
"""Coefficients of a quartic of the torsion, for powers k = 0 to 4 [N·m/rad^k]."""


ZERO = wp.constant(real(0.0))


HALF = wp.constant(real(0.5))


ONE = wp.constant(real(1.0))


@wp.struct
class WarpDrive:
    """One drive: its addresses in the model, and its rows in the arrays of the maps."""

    tendon: int
    """Index of the tendon."""
    q_rotor: int
    q_link: int
    """Addresses of rotor and link in ``qpos``."""
    v_rotor: int
    v_link: int
    """Addresses of rotor and link in ``qvel``."""
    entry_rotor: int
    entry_link: int
    """Addresses of rotor and link in ``ten_J``, in the row of the tendon."""
    harmonic: int
    """Index of the first harmonic; ``harmonics`` is the number of harmonics."""
    harmonics: int
    segment: int
    """Index of the first segment; segments are below, between and above the knots."""
    segments: int
    row: int
    """First row of the polynomials, ordered by segment, harmonic, then A and B."""
    element: int
    """Index of the first hysteresis element; ``elements`` is their number."""
    elements: int
    curve: int
    """Index of the first point of the yield curves; ``curves`` is their number."""
    curves: int
    ratio: real
    """Signed ratio i [-]."""
    damping: real
    """Damping torque per torsion rate [N·m·s/rad]."""
    contact_damping: real
    """Smallest damping while a contact or a limit acts [N·m·s/rad]."""
    friction: int
    """Index of the friction tendon; -1 without friction."""
    b_theta: real
    b_psi: real
    """Derivatives of the friction angle beta by theta and psi [-]."""
    bristle: real
    """Stiffness of the bristle [N·m/rad]."""
    creep: real
    """Damping of the bristle [N·m·s/rad]."""
    coulomb: real
    """Coulomb torque including the bending torque [N·m]."""
    stiction: real
    """Static torque including the bending torque [N·m]."""
    stribeck: real
    """Stribeck speed [rad/s]."""
    viscous: real
    """Viscous friction coefficient [N·m·s/rad]."""
    load: real
    """Friction torque per output torque [-]."""


@wp.struct
class Sums:
    """Harmonics of one segment over a step: coefficients in powers of the torsion."""

    mean: vec5
    """Potential with every harmonic at the mean of its values at both ends."""
    by_theta: vec5
    by_psi: vec5
    """Secants of the potential by theta and psi at fixed torsion."""
    g_theta: real
    g_psi: real
    """Secants of the torsion by theta and psi [-]."""


@wp.struct
class Secant:
    """Discrete gradient of V over a step, including hysteresis."""

    begin: real
    """Torsion at the beginning of the step [rad]."""
    change: real
    """Change of the torsion in the step [rad]."""
    g_theta: real
    g_psi: real
    """Secants of the torsion by theta and psi [-]."""
    torque: real
    """Secant of V by the torsion, i.e. mean torque of the step [N·m]."""
    slope: real
    """Derivative of this torque by the torsion at the end of the step [N·m/rad]."""
    k0: real
    k1: real
    """Tangent stiffness at beginning and end of the step [N·m/rad]."""
    e_theta: real
    e_psi: real
    """Secants of V by theta and psi at fixed torsion [N·m]."""


@wp.struct
class Maps:
    """All maps, concatenated."""

    harmonic: wp.array2d(dtype=real)
    """Orders n_theta and n_psi [-], cosine and sine amplitude of e0 [rad]."""
    segment: wp.array2d(dtype=real)
    """Begin, end and base of the polynomial of each segment, as torsions [rad]."""
    row: wp.array(dtype=vec5)
    """Polynomials A and B (factors of cosine and sine), see :class:`WarpDrive`."""
    element: wp.array2d(dtype=real)
    """Stiffness [N·m/rad] and yield torsion without load [rad] of each hysteresis
    element, then the first and the end index of its yield curve."""
    curve: wp.array2d(dtype=real)
    """Points of the yield curves: elastic torque [N·m] and yield torsion [rad]."""


@wp.func
def value(w: vec5, d: real):
    """Value of a polynomial of the torsion.

    Args:
        w: Coefficients for powers 0 to 4.
        d: Torsion from the base of the segment [rad].
    """
    return w[0] + d * (w[1] + d * (w[2] + d * (w[3] + d * w[4])))


@wp.func
def slope(w: vec5, d: real):
    """First derivative of a polynomial of the torsion.

    Args:
        w: Coefficients for powers 0 to 4.
        d: Torsion from the base of the segment [rad].
    """
    return w[1] + d * (real(2.0) * w[2] + d * (real(3.0) * w[3] + d * real(4.0) * w[4]))


@wp.func
def curvature(w: vec5, d: real):
    """Second derivative of a polynomial of the torsion.

    Args:
        w: Coefficients for powers 0 to 4.
        d: Torsion from the base of the segment [rad].
    """
    return real(2.0) * w[2] + d * (real(6.0) * w[3] + d * real(12.0) * w[4])


@wp.func
def divided_difference(w: vec5, a: real, b: real):
    """Divided difference (w(b) - w(a))/(b - a), without cancellation.

    Args:
        w: Coefficients for powers 0 to 4.
        a: First torsion from the base of the segment [rad].
        b: Second torsion [rad].
    """
    both = a + b
    squares = a * a + b * b
    return w[1] + w[2] * both + w[3] * (squares + a * b) + w[4] * both * squares


@wp.func
def divided_slope(w: vec5, a: real, b: real):
    """Derivative of the divided difference with respect to b.

    Args:
        w: Coefficients for powers 0 to 4.
        a: First torsion from the base of the segment [rad].
        b: Second torsion [rad].
    """
    return (
        w[2]
        + w[3] * (a + real(2.0) * b)
        + w[4] * (a * a + real(2.0) * a * b + real(3.0) * b * b)
    )


@wp.func
def segment_at(drive: WarpDrive, maps: Maps, torsion: real):
    """Index of the segment that contains a torsion.

    Args:
        drive: The drive.
        maps: Maps of all drives.
        torsion: Torsion [rad].
    """
    low = int(0)  # noqa: RUF046, UP018  # a literal is a constant to Warp
    high = int(drive.segments)
    while high - low > 1:
        middle = (low + high) // 2
        if torsion >= maps.segment[drive.segment + middle, 0]:
            low = middle
        else:
            high = middle
    return low


@wp.func
def torsion_at(drive: WarpDrive, maps: Maps, by: vec5, theta: real, psi: real):
    """Torsion theta/i + (1 + r) e0(theta + a, psi + b) - psi [rad].

    Args:
        drive: The drive.
        maps: Maps of all drives.
        by: Deviations of the specimen, see :mod:`swgjoint.joint.variation`.
        theta: Rotor angle [rad].
        psi: Link angle [rad].
    """
    at_theta, at_psi = theta + by[2], psi + by[3]
    error = real(0.0)
    for k in range(drive.harmonic, drive.harmonic + drive.harmonics):
        phase = maps.harmonic[k, 0] * at_theta + maps.harmonic[k, 1] * at_psi
        error += maps.harmonic[k, 2] * wp.cos(phase)
        error += maps.harmonic[k, 3] * wp.sin(phase)
    return theta / drive.ratio + (ONE + by[1]) * error - psi


@wp.func
def weigh(
    drive: WarpDrive,
    maps: Maps,
    by: vec5,
    segment: int,
    theta: real,
    psi: real,
    dtheta: real,
    dpsi: real,
):
    """Sums over the harmonics: means of both ends of a step, and secants by the angles.

    Args:
        drive: The drive.
        maps: Maps of all drives.
        by: Deviations of the specimen, of which the potential's is not applied here.
        segment: Segment whose coefficients are used.
        theta: Rotor angle at the beginning of the step [rad].
        psi: Link angle at the beginning of the step [rad].
        dtheta: Change of the rotor angle [rad].
        dpsi: Change of the link angle [rad].
    """
    out = Sums()
    out.g_theta = ONE / drive.ratio
    out.g_psi = -ONE
    at_theta, at_psi = theta + by[2], psi + by[3]
    for k in range(drive.harmonics):
        n_theta = maps.harmonic[drive.harmonic + k, 0]
        n_psi = maps.harmonic[drive.harmonic + k, 1]
        eta = HALF * (n_theta * dtheta + n_psi * dpsi)
        phase = n_theta * at_theta + n_psi * at_psi + eta  # middle of the step
        sinc = ONE - eta * eta / real(6.0)
        if wp.abs(eta) > real(1e-4):
            sinc = wp.sin(eta) / eta
        c, s = wp.cos(phase), wp.sin(phase)
        row = drive.row + 2 * (segment * drive.harmonics + k)
        a, b = maps.row[row], maps.row[row + 1]
        out.mean += wp.cos(eta) * (c * a + s * b)
        secant = sinc * (c * b - s * a)
        out.by_theta += n_theta * secant
        out.by_psi += n_psi * secant
        error = (
            (ONE + by[1])
            * sinc
            * (
                c * maps.harmonic[drive.harmonic + k, 3]
                - s * maps.harmonic[drive.harmonic + k, 2]
            )
        )
        out.g_theta += n_theta * error
        out.g_psi += n_psi * error
    return out


@wp.func
def secant_over(
    drive: WarpDrive,
    maps: Maps,
    by: vec5,
    begin: real,
    theta: real,
    psi: real,
    dtheta: real,
    dpsi: real,
):
    """Discrete gradient of V over a step of the angles, as in ``drive_map.cc``.

    Args:
        drive: The drive.
        maps: Maps of all drives.
        by: Deviations of the specimen, see :mod:`swgjoint.joint.variation`.
        begin: Torsion at the beginning of the step [rad].
        theta: Rotor angle there [rad].
        psi: Link angle there [rad].
        dtheta: Change of the rotor angle [rad].
        dpsi: Change of the link angle [rad].
    """
    out = Secant()
    out.begin = begin
    j0 = segment_at(drive, maps, out.begin)
    d0 = out.begin - maps.segment[drive.segment + j0, 2]
    sums = weigh(drive, maps, by, j0, theta, psi, dtheta, dpsi)
    out.g_theta = sums.g_theta
    out.g_psi = sums.g_psi
    out.change = sums.g_theta * dtheta + sums.g_psi * dpsi
    x1 = out.begin + out.change
    j1 = segment_at(drive, maps, x1)
    d1 = x1 - maps.segment[drive.segment + j1, 2]
    last = sums
    if j0 == j1:
        out.torque = divided_difference(sums.mean, d0, d1)
        out.slope = divided_slope(sums.mean, d0, d1)
    else:
        # sum the work segment by segment, to avoid differences of large energies
        last = weigh(drive, maps, by, j1, theta, psi, dtheta, dpsi)
        work = real(0.0)
        at = real(begin)
        j = int(j0)
        for _ in range(wp.abs(j1 - j0) + 1):
            piece = weigh(drive, maps, by, j, theta, psi, dtheta, dpsi)
            base = maps.segment[drive.segment + j, 2]
            to = x1
            if j < j1:
                to = maps.segment[drive.segment + j, 1]
            if j > j1:
                to = maps.segment[drive.segment + j, 0]
            work += divided_difference(piece.mean, at - base, to - base) * (to - at)
            at = to
            j += wp.where(j1 > j0, 1, -1)
        out.torque = work / out.change
        out.slope = (slope(last.mean, d1) - out.torque) / out.change
    out.k0 = curvature(sums.mean, d0)
    out.k1 = curvature(last.mean, d1)
    low, high = HALF * wp.min(out.k0, out.k1), HALF * wp.max(out.k0, out.k1)
    size = ONE + by[0]
    out.torque *= size
    out.slope = size * wp.clamp(out.slope, low, high)
    out.k0 *= size
    out.k1 *= size
    out.e_theta = HALF * size * (value(sums.by_theta, d0) + value(last.by_theta, d1))
    out.e_psi = HALF * size * (value(sums.by_psi, d0) + value(last.by_psi, d1))
    return out
