# mypy: ignore-errors
"""Kernels of :mod:`swgjoint.joint.warp`, written in Warp with its types.

They evaluate the same law as ``drive.cc``, ``drive_map.cc`` and ``friction.cc``, with
one thread per drive and world.
"""

import warp as wp

from swgjoint.joint import plugin
from swgjoint.joint.warp.friction import Rub, rub_over, scale_losses, stretch_after
from swgjoint.joint.warp.hysteresis import relax, slip
from swgjoint.joint.warp.potential import (
    HALF,
    ONE,
    ZERO,
    Maps,
    Secant,
    WarpDrive,
    real,
    secant_over,
    torsion_at,
    vec5,
)

_SPRING, _, _CUBIC = plugin.TENDON_STIFFNESS
SPRING, CUBIC = wp.constant(real(_SPRING)), wp.constant(real(_CUBIC))
FRICTION_CUBIC = wp.constant(real(plugin.FRICTION_STIFFNESS[2]))
NU1 = wp.constant(real(plugin.NUMERICAL_DAMPING))
LEAST_LOSSES = wp.constant(real(1e-6))  # keeps the bristle's stiffness above zero
PASSES = wp.constant(plugin.PASSES)


@wp.struct
class WarpStep:
    """State of one drive in one world, passed from one evaluation to the next.

    Speeds v [rad/s] and inverse inertias w [1/(kg·m²)] belong to rotor and link, angles
    are in rad; g, e, force and metric are those of the last step.
    """

    time: float
    v_rotor: real
    v_link: real
    w_rotor: real
    w_link: real
    g_theta: real
    g_psi: real
    e_theta: real
    e_psi: real
    force: real
    metric: real
    torsion: real
    predicted: real
    """Predicted change of the torsion [rad]."""
    elastic: real
    """Mean elastic torque [N·m]."""
    a_rotor: real
    """Rotor acceleration by all other forces, ``a_link`` likewise [rad/s²]."""
    a_link: real
    rub: Rub
    rotation: real
    """Angle beta at the beginning of the step [rad]."""
    relaxed: real
    """Angle beta at which the bristle is relaxed [rad]."""
    known: int
    """Whether ``relaxed`` is known."""


@wp.kernel
def factor_mass_matrix(
    M_rownnz: wp.array(dtype=int),
    M_rowadr: wp.array(dtype=int),
    M_colind: wp.array(dtype=int),
    M: wp.array2d(dtype=float),
    nv: int,
    out: wp.array2d(dtype=float),
):
    """Factor M by eliminating dofs from the leaves: D, and the rows of L times D.

    MuJoCo Warp has not factored M at the passive stage; its later factors differ.

    Args:
        M_rownnz: Number of entries in each row of M. Shape (nv,).
        M_rowadr: Address of each row of M. Shape (nv,).
        M_colind: Columns of the entries of M. Shape (nC,).
        M: Mass matrices [kg·m²]. Shape (worlds, nC).
        nv: Number of dofs.
        out: Result, D on the diagonal entries. Shape (worlds, nC).
    """
    world = wp.tid()
    for j in range(out.shape[1]):
        out[world, j] = M[world, j]
    for n in range(nv):
        k = nv - 1 - n
        row, ancestors = M_rowadr[k], M_rownnz[k] - 1
        for a in range(ancestors):
            factor = out[world, row + a] / out[world, row + ancestors]
            other = M_rowadr[M_colind[row + a]]
            for b in range(a + 1):
                out[world, other + b] -= factor * out[world, row + b]


@wp.kernel
def respond(
    M_rownnz: wp.array(dtype=int),
    M_rowadr: wp.array(dtype=int),
    M_colind: wp.array(dtype=int),
    factor: wp.array2d(dtype=float),
    column: wp.array2d(dtype=float),
    weight: wp.array2d(dtype=float),
):
    """Diagonal of the inverse of M, as in ``response.py``.

    Args:
        M_rownnz: Number of entries in each row of M. Shape (nv,).
        M_rowadr: Address of each row of M. Shape (nv,).
        M_colind: Columns of the entries of M. Shape (nC,).
        factor: Result of :func:`factor_mass_matrix`. Shape (worlds, nC).
        column: Work space for one column of L^-T. Shape (worlds, nv).
        weight: Result, the diagonal elements [1/(kg·m²)]. Shape (worlds, nv).
    """
    world = wp.tid()
    for dof in range(weight.shape[1]):
        start, last = M_rowadr[dof], M_rownnz[dof] - 1
        for k in range(last):
            column[world, k] = 0.0
        column[world, last] = 1.0
        total = wp.float32(0.0)
        for up in range(last + 1):
            a = last - up
            at = M_rowadr[M_colind[start + a]]
            scaled = column[world, a] / factor[world, at + a]
            total += scaled * column[world, a]
            for b in range(a):
                column[world, b] -= factor[world, at + b] * scaled
        weight[world, dof] = total


@wp.func
def taken_torques(drive: WarpDrive, last: WarpStep, h: real, rm: real, rl: real):
    """Mean torques that a drive took from rotor and link over a step [N·m].

    Args:
        drive: The drive.
        last: Its state after the evaluation for that step.
        h: Duration of the step [s].
        rm: Change of the rotor speed over the step [rad/s].
        rl: Change of the link speed [rad/s].
    """
    force = last.force + h * last.metric * (last.g_theta * rm + last.g_psi * rl)
    on_rotor = last.g_theta * force + last.e_theta
    on_link = last.g_psi * force + last.e_psi
    if drive.friction >= 0:
        change = drive.b_theta * rm + drive.b_psi * rl
        rubbed = last.rub.force + h * last.rub.metric * change
        on_rotor += drive.b_theta * rubbed
        on_link += drive.b_psi * rubbed
    return wp.vec2d(on_rotor, on_link)


@wp.kernel
def law(
    timestep: wp.array(dtype=float),
    damped: real,
    drives: wp.array(dtype=WarpDrive),
    maps: Maps,
    specimens: wp.array2d(dtype=vec5),
    weight: wp.array2d(dtype=float),
    time: wp.array(dtype=float),
    rows: wp.array(dtype=int),
    equalities: wp.array(dtype=int),
    friction_rows: wp.array(dtype=int),
    qpos: wp.array2d(dtype=float),
    qvel: wp.array2d(dtype=float),
    ten_velocity: wp.array2d(dtype=float),
    steps: wp.array2d(dtype=WarpStep),
    rest: wp.array2d(dtype=real),
    ten_J: wp.array2d(dtype=float),
    ten_length: wp.array2d(dtype=float),
    qfrc_passive: wp.array2d(dtype=float),
    torsion: wp.array2d(dtype=float),
    torque: wp.array2d(dtype=float),
):
    """Force, direction and stiffness of one drive in one world, as in ``drive.cc``.

    Args:
        timestep: Step h of one or all worlds [s].
        damped: 1 if the engine's dampers act, otherwise 0.
        drives: Drives of the model.
        maps: Maps of all drives.
        specimens: Deviations from the maps, see
            :class:`~swgjoint.joint.variation.Variation`. Shape (worlds, drives).
        weight: Result of :func:`respond` [1/(kg·m²)]. Shape (worlds, nv).
        time: Time of each world [s].
        rows: Number of constraint rows of each world.
        equalities: Number of these rows that are equalities.
        friction_rows: Number of these rows that are friction losses.
        qpos: Positions. Shape (worlds, nq).
        qvel: Velocities. Shape (worlds, nv).
        ten_velocity: Tendon velocities. Shape (worlds, ntendon).
        steps: State that the evaluations pass on. Shape (worlds, drives).
        rest: State of the hysteresis elements, see :mod:`.hysteresis` [rad].
        ten_J: Tendon Jacobians; gets the direction.
        ten_length: Tendon lengths; get the stiffness.
        qfrc_passive: Passive forces; get the force. Shape (worlds, nv).
        torsion: Result, torsion at these positions [rad]. Shape (worlds, drives).
        torque: Result, mean torque on the link in the step that ended here, zero after
            a reset [N·m]. Shape (worlds, drives).
    """
    world, index = wp.tid()
    by = specimens[world, index]
    losses = wp.max(ONE + by[4], LEAST_LOSSES)
    drive = scale_losses(drives[index], losses)
    h = real(timestep[world % timestep.shape[0]])
    vm, vl = real(qvel[world, drive.v_rotor]), real(qvel[world, drive.v_link])

    # time tells whether there was a step, a reset or neither since the last evaluation
    last = steps[world, index]
    if time[world] > last.time:
        rm, rl = vm - last.v_rotor, vl - last.v_link
        taken = taken_torques(drive, last, h, rm, rl)
        if drive.friction >= 0:
            change = drive.b_theta * rm + drive.b_psi * rl
            was = drive.b_theta * last.v_rotor + drive.b_psi * last.v_link
            dx = h * (was + HALF * change)
            last.relaxed = last.rotation + dx - stretch_after(drive, last.rub, dx)
            last.known = 1
        last.a_rotor = rm / h + last.w_rotor * taken[0]
        last.a_link = rl / h + last.w_link * taken[1]
        torque[world, index] = float(-taken[1])
        moved = last.g_theta * (last.v_rotor + HALF * rm)
        moved = h * (moved + last.g_psi * (last.v_link + HALF * rl))
        relax(
            drive,
            maps,
            world,
            last.torsion,
            last.predicted,
            moved,
            last.elastic,
            rest,
        )
    if time[world] < last.time:
        last.a_rotor = ZERO
        last.a_link = ZERO
        last.known = 0
        torque[world, index] = 0.0
        for j in range(drive.element, drive.element + drive.elements):
            rest[world, j] = ZERO
            rest[world, maps.element.shape[0] + j] = ZERO

    angle = real(qpos[world, drive.q_rotor])
    torsion[world, index] = float(
        torsion_at(drive, maps, by, angle, real(qpos[world, drive.q_link]))
    )

    # remove the torque of the tendon's native spring, which the engine has applied
    length = real(ten_length[world, drive.tendon])
    native = length * (SPRING + CUBIC * length * length)
    on_rotor = native * real(ten_J[world, drive.entry_rotor])
    on_link = native * real(ten_J[world, drive.entry_link])
    if drive.friction >= 0:
        length = real(ten_length[world, drive.friction])
        native = length * (SPRING + FRICTION_CUBIC * length * length)
        on_rotor += native * drive.b_theta
        on_link += native * drive.b_psi

    wm, wl = real(weight[world, drive.v_rotor]), real(weight[world, drive.v_link])

    # the scheme is a midpoint rule in positions half a step back
    theta = real(qpos[world, drive.q_rotor]) - HALF * h * vm
    psi = real(qpos[world, drive.q_link]) - HALF * h * vl
    begin = torsion_at(drive, maps, by, theta, psi)
    c = damped * drive.damping
    if rows[world] > equalities[world] + friction_rows[world]:
        # a contact or a limit acts
        c = wp.max(c, drive.contact_damping)
    dm, dl = real(0.0), real(0.0)
    force, p = real(0.0), real(0.0)
    s = Secant()
    rub = Rub()
    speed = drive.b_theta * vm + drive.b_psi * vl
    last.rotation = drive.b_theta * theta + drive.b_psi * psi
    turned = wp.where(last.known == 1, last.rotation - last.relaxed, ZERO)
    for _ in range(PASSES):
        s = secant_over(
            drive,
            maps,
            by,
            begin,
            theta,
            psi,
            h * (vm + HALF * dm),
            h * (vl + HALF * dl),
        )
        last.elastic = s.torque
        for j in range(drive.element, drive.element + drive.elements):
            limit = rest[world, maps.element.shape[0] + j]
            s = slip(s, drive, maps, j, losses, last.elastic, rest[world, j], limit)
        k = wp.max(ZERO, HALF * (s.k0 + s.k1))
        w = s.g_theta * s.g_theta * wm + s.g_psi * s.g_psi * wl
        ka = h * h * k * w
        nu = NU1 * ka * ka / (real(16.0) + ka * ka)
        force = s.torque - HALF * h * s.slope * (s.g_theta * dm + s.g_psi * dl)
        force += (nu * k * h + c) * (s.g_theta * vm + s.g_psi * vl)
        p = HALF * s.slope + real(0.75) * nu * k + HALF * c / h
        # predicted step of the pair under this torque, for the next pass
        am, al = last.a_rotor - wm * s.e_theta, last.a_link - wl * s.e_psi
        turn = h * (s.g_theta * am + s.g_psi * al - w * force)
        f = force + h * p * turn / (ONE + h * h * w * p)
        middle = speed + HALF * (drive.b_theta * dm + drive.b_psi * dl)
        dm = h * (am - wm * s.g_theta * f)
        dl = h * (al - wl * s.g_psi * f)
        if drive.friction >= 0:
            x = middle / drive.stribeck
            slips = drive.coulomb + drive.load * wp.abs(s.torque)
            slips += (drive.stiction - drive.coulomb) * wp.exp(-x * x)
            # (M + h² p g g')⁻¹ b: response of the pair to friction
            along = wm * drive.b_theta * s.g_theta + wl * drive.b_psi * s.g_psi
            along *= h * h * p / (ONE + h * h * w * p)
            rm = wm * (drive.b_theta - along * s.g_theta)
            rl = wl * (drive.b_psi - along * s.g_psi)
            rub = rub_over(
                drive,
                turned,
                slips,
                speed,
                drive.b_theta * dm + drive.b_psi * dl,
                h * (drive.b_theta * rm + drive.b_psi * rl),
                h,
            )
            dm -= h * rm * rub.predicted
            dl -= h * rl * rub.predicted

    # the tangent of the tendon's cubic spring at this length is the stiffness p
    tangent = wp.max(ZERO, p - SPRING) / (real(3.0) * CUBIC)
    length = wp.max(real(1e-12), wp.sqrt(tangent))
    p = SPRING + real(3.0) * CUBIC * length * length
    # the engine will add -h p times the tendon's velocity along g: cancel it
    along = force - h * p * real(ten_velocity[world, drive.tendon])
    on_rotor -= along * s.g_theta + s.e_theta
    on_link -= along * s.g_psi + s.e_psi
    ten_length[world, drive.tendon] = float(length)
    if drive.friction >= 0:
        # likewise along b, for the second term of the metric
        tangent = wp.max(ZERO, rub.metric - SPRING) / (real(3.0) * FRICTION_CUBIC)
        length = wp.max(real(1e-12), wp.sqrt(tangent))
        rub.metric = SPRING + real(3.0) * FRICTION_CUBIC * length * length
        ten_length[world, drive.friction] = float(length)
        rubs = rub.force - h * rub.metric * real(ten_velocity[world, drive.friction])
        on_rotor -= rubs * drive.b_theta
        on_link -= rubs * drive.b_psi
    ten_J[world, drive.entry_rotor] = float(s.g_theta)
    ten_J[world, drive.entry_link] = float(s.g_psi)
    qfrc_passive[world, drive.v_rotor] += float(on_rotor)
    qfrc_passive[world, drive.v_link] += float(on_link)

    last.time = time[world]
    last.v_rotor = vm
    last.v_link = vl
    last.w_rotor = wm
    last.w_link = wl
    last.g_theta = s.g_theta
    last.g_psi = s.g_psi
    last.e_theta = s.e_theta
    last.e_psi = s.e_psi
    last.force = force
    last.metric = p
    last.torsion = s.begin
    last.predicted = s.change
    last.rub = rub
    steps[world, index] = last
