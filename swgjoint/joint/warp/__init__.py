r"""Level ``full`` in MuJoCo Warp: the law of the engine plugin as a passive callback.

MuJoCo Warp does not support engine plugins. Like the engine, its ``discrete``
integrator builds the metric from ``ten_J`` and ``ten_length`` after the passive stage.
A callback at that stage can therefore provide direction and stiffness for the same
step, for many worlds at once, see :mod:`swgjoint.joint.reference`::

    drive = swgjoint.attach(spec, joint="j", drive=drive_map, rotor_inertia=4e-5)
    model = without_plugin(spec)
    m, d = mjw.put_model(model), mjw.make_data(model, nworld=4096)
    call = install(m, d, model, [drive])
    mjw.step(m, d)  # also inside a captured graph

The callback implements the complete law: potential with all harmonics, kinematic error,
hysteresis, friction and damping. All integrators except ``discrete`` are rejected.
``install`` returns the callback, :class:`WarpDrives`. Its device arrays are the torsion
and torque of every drive in every world, and the deviations of each drive from its map,
so that every world may have its own specimens::

    call.specimens.assign([[specimen.numbers] for specimen in variations])

The law is evaluated in double precision, but the engine's state has single precision:
the relative rounding error of a position is 6e-8, which causes torque noise of about
K times 1e-7 rad at an output angle of 1 rad and stiffness K. A joint that follows a
reference of ``JointTracking`` stays within 2e-7 rad (torsion) and 1e-6 rad (output) of
MuJoCo with the plugin for one second, with hysteresis and friction. Free motion adds up
the rounding of the rotor's angle: after one second and up to 15 rad of the output, the
torsion differs by 4e-6 to 2.5e-5 rad; the plugin in double precision whose state is
rounded to single precision after every step differs by 4e-6 to 8e-6 rad.

The time of a world must increase in every step, because it distinguishes a step from a
repeated ``forward`` and from a reset; in single precision it does so for about 1e7
steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from swgjoint.errors import InputError, MissingExtraError
from swgjoint.joint import plugin
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.variation import SIZE
from swgjoint.maps.drive_map import DriveMap

try:
    import warp as wp

    from swgjoint.joint.warp.law import WarpStep, factor_mass_matrix, law, respond
    from swgjoint.joint.warp.potential import Maps, WarpDrive, real, vec5
except ImportError as error:
    raise MissingExtraError(
        "drives in MuJoCo Warp need mujoco-warp: pip install 'swgjoint[warp]'"
    ) from error


def without_plugin(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compiled model of a spec without the drive plugin; rotors and tendons remain."""
    plain = spec.copy()
    for body in plain.bodies:
        if body.plugin.plugin_name == plugin.NAME:
            body.plugin.active = False
    for instance in list(plain.plugins):
        if instance.plugin_name == plugin.NAME:
            plain.delete(instance)
    return plain.compile()


class WarpDrives:
    """Callback that adds drives to a Warp model for a fixed number of worlds.

    Attributes:
        specimens: Deviations of every drive in every world from its map, in the order
            of :class:`~swgjoint.joint.variation.Variation`; may be written at any time.
            Shape (worlds, drives), of 5 values each.
        torsion: Torsion of every drive at the positions of the last evaluation [rad],
            hence at the beginning of the last step, as for MuJoCo's sensors.
            Shape (worlds, drives).
        torque: Torque of every drive on its link, mean of the step that ended there
            [N·m]. Shape (worlds, drives).
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        drives: Sequence[JointDrive],
        *,
        worlds: int,
        device: Any,
    ) -> None:
        rows: list[Any] = []
        parts: dict[str, list[np.ndarray]] = {
            "harmonic": [],
            "segment": [],
            "row": [],
            "element": [],
            "curve": [],
        }
        for drive in drives:
            one = _place(model, drive)
            for key, values in _arrays(drive.drive).items():
                setattr(one, key, sum(len(part) for part in parts[key]))
                if key != "row":
                    setattr(one, f"{key}s", len(values))
                parts[key].append(values)
            rows.append(one)
        with wp.ScopedDevice(device):
            self.maps = Maps()
            for key, part in parts.items():
                kind = vec5 if key == "row" else real
                array = wp.array(np.concatenate(part), dtype=kind)
                setattr(self.maps, key, array)
            self.drives = wp.array(rows, dtype=WarpDrive)
            own = [_deviations(model, drive) for drive in drives]
            self.specimens = wp.array(
                np.broadcast_to(np.reshape(own, (-1, SIZE)), (worlds, len(own), SIZE)),
                dtype=vec5,
            )
            self.torsion = wp.zeros((worlds, len(rows)), dtype=float)
            self.torque = wp.zeros((worlds, len(rows)), dtype=float)
            elements = sum(len(part) for part in parts["element"])
            self.rest = wp.zeros((worlds, max(2 * elements, 1)), dtype=real)
            unknown = WarpStep()
            unknown.time = float("inf")  # treated as a reset
            self.steps = wp.full((worlds, len(rows)), unknown, dtype=WarpStep)
            self.factor = wp.zeros((worlds, model.nC), dtype=float)
            self.column = wp.zeros((worlds, model.nv), dtype=float)
            self.weight = wp.zeros((worlds, model.nv), dtype=float)

    def __call__(self, m: Any, d: Any) -> None:
        """Add the drives to the passive forces and the metric of every world."""
        # if springs are disabled, the engine omits the tendon from its metric as well
        if m.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_SPRING:
            return
        damped = not m.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_DAMPER
        rows = [m.M_rownnz, m.M_rowadr, m.M_colind]
        wp.launch(
            factor_mass_matrix,
            dim=d.nworld,
            inputs=[*rows, d.M, m.nv],
            outputs=[self.factor],
        )
        wp.launch(
            respond,
            dim=d.nworld,
            inputs=[*rows, self.factor],
            outputs=[self.column, self.weight],
        )
        wp.launch(
            law,
            dim=(d.nworld, self.drives.size),
            inputs=[
                m.opt.timestep,
                real(float(damped)),
                self.drives,
                self.maps,
                self.specimens,
                self.weight,
                d.time,
                d.nefc,
                d.ne,
                d.nf,
                d.qpos,
                d.qvel,
                d.ten_velocity,
            ],
            outputs=[
                self.steps,
                self.rest,
                d.ten_J,
                d.ten_length,
                d.qfrc_passive,
                self.torsion,
                self.torque,
            ],
        )


def install(m: Any, d: Any, model: mujoco.MjModel, drives: Sequence[JointDrive]) -> Any:
    """Install drives of level ``full`` in a MuJoCo Warp model.

    Args:
        m: Result of ``mujoco_warp.put_model`` for ``model``; gets the callback.
        d: Data of ``m``; determines the number of worlds and the device.
        model: Result of :func:`without_plugin` for the spec.
        drives: Drives that ``attach`` returned; those at other levels are ignored.

    Returns:
        The callback, :class:`WarpDrives`.

    Raises:
        InputError: If the integrator is not ``discrete``, the model already has a
            passive callback, or a drive is not in the model.
    """
    integrator = mujoco.mjtIntegrator(int(m.opt.integrator))
    if integrator != mujoco.mjtIntegrator.mjINT_DISCRETE:
        name = integrator.name.removeprefix("mjINT_").lower()
        raise InputError(
            f"integrator {name}: not supported for drives in MuJoCo Warp; accepted:"
            " discrete"
        )
    if m.callback.passive is not None:
        raise InputError(
            "the MuJoCo Warp model already has a passive callback; accepted: none"
            " (call both from a callback of your own)"
        )
    full = [drive for drive in drives if drive.level == "full"]
    call = WarpDrives(model, full, worlds=d.nworld, device=d.qpos.device)
    m.callback.passive = call
    return call


def _place(model: mujoco.MjModel, drive: JointDrive) -> Any:
    """Addresses of a drive in the model."""
    try:
        rotor, link = model.joint(drive.rotor), model.joint(drive.joint)
        tendon = int(model.tendon(drive.tendon).id)
    except KeyError as error:
        raise InputError(
            f"joint {drive.joint!r}: its drive is not in the model: {error}; accepted:"
            " the model of without_plugin(spec)"
        ) from error
    one = WarpDrive()
    one.tendon = tendon
    one.q_rotor, one.q_link = int(rotor.qposadr[0]), int(link.qposadr[0])
    one.v_rotor, one.v_link = int(rotor.dofadr[0]), int(link.dofadr[0])
    row = int(model.ten_J_rowadr[tendon])
    columns = list(model.ten_J_colind[row : row + int(model.ten_J_rownnz[tendon])])
    one.entry_rotor = row + columns.index(one.v_rotor)
    one.entry_link = row + columns.index(one.v_link)
    one.ratio, one.damping = drive.ratio, drive.damping
    one.contact_damping = drive.contact_damping
    one.friction = -1
    if drive.friction is not None:
        one.friction = int(model.tendon(f"{drive.joint}_friction").id)
        numbers = plugin.friction_numbers(drive.drive).tolist()
        one.b_theta, one.b_psi, one.bristle, one.creep, one.coulomb = numbers[:5]
        one.stiction, one.stribeck, one.viscous, one.load = numbers[5:]
    return one


def _deviations(model: mujoco.MjModel, drive: JointDrive) -> np.ndarray:
    """Deviations of a drive from its map in the model, or zeros. Shape (5,)."""
    user = model.tendon_user[model.tendon(drive.tendon).id]
    return user[:SIZE] if len(user) >= SIZE else np.zeros(SIZE)


def _arrays(drive: DriveMap) -> dict[str, np.ndarray]:
    """Rows of one map in the layout of :class:`Maps`."""
    knots, n = drive.torsion_knots, len(drive.orders)
    inside = np.moveaxis(drive.potential, 2, 0)  # (segments, harmonics, 2, 5)
    ends = np.zeros((2, n, 2, 5))  # parabolas about the end knots
    for power in (0, 1):
        ends[..., power] = drive.coefficients(knots[[0, -1]], power)
    ends[..., 2] = 0.5 * np.moveaxis(drive.end_stiffness, 2, 0)
    points = np.cumsum([len(element.yield_curve) for element in drive.hysteresis])
    return {
        "harmonic": np.column_stack(
            [drive.angle_orders.astype(float), drive.kinematic_error]
        ),
        "segment": np.column_stack(
            [
                np.concatenate([[-np.inf], knots]),
                np.concatenate([knots, [np.inf]]),
                knots[[0, *range(len(knots))]],
            ]
        ),
        "row": np.concatenate([ends[:1], inside, ends[1:]]).reshape(-1, 5),
        "element": np.array(
            [
                (e.stiffness, e.yield_torsion, end - len(e.yield_curve), end)
                for e, end in zip(drive.hysteresis, points, strict=True)
            ]
        ).reshape(-1, 4),
        "curve": np.array(
            [(at, f / e.stiffness) for e in drive.hysteresis for at, f in e.yield_curve]
        ).reshape(-1, 2),
    }
