"""Put a drive on a hinge of any MuJoCo model by editing its MjSpec."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np

from swgjoint.errors import InputError
from swgjoint.joint import plugin
from swgjoint.joint.drive import JointDrive, UnresolvedOrder, prune
from swgjoint.joint.elements import add_native, add_rotor, add_tendon
from swgjoint.joint.motors import clear_armature, move_to_rotor
from swgjoint.joint.native import fit_native
from swgjoint.joint.obstacles import actuators_on
from swgjoint.joint.place import check_option, find_place
from swgjoint.joint.prescribed import kinematic_part, ratio_variation
from swgjoint.joint.variation import SIZE
from swgjoint.maps.drive_map import DriveMap

LEVELS = ("rigid", "kinematic", "linear", "native", "full")
ROTORS = ("gyroscopic", "lumped")


def attach(
    spec: mujoco.MjSpec,
    *,
    joint: str,
    drive: DriveMap,
    level: str = "full",
    rotor_inertia: float,
    damping_ratio: float | None = None,
    friction: bool = False,
    rotor: str = "gyroscopic",
    variable: bool = False,
    max_input_speed: float | None = None,
    max_phase_step: float = 0.5,
) -> JointDrive:
    """Turn a hinge into the output of a strain wave gear.

    ``rigid`` gives the joint the reflected inertia i²J as armature. ``kinematic`` is
    the same model; its kinematic error comes in through the inputs of a commanded
    motion, see :mod:`swgjoint.joint.prescribed`.

    ``linear``, ``native`` and ``full`` add a rotor (body ``<joint>_rotor`` with a hinge
    of the same name, beside the link under the same parent) and a tendon
    ``<joint>_drive`` with the length theta/i - psi: a native spring and damper, the
    same with a cubic part (and tendons ``<joint>_hysteresis<k>`` where the map has
    hysteresis), or the carrier of the engine plugin's instance of the same name, which
    evaluates ``drive``, hysteresis included. Keyframes grow by the rotor, at the
    position without torsion.

    The rotor takes the place of the armature that the file gives the joint or its
    actuators. Actuators that act on the joint turn the rotor instead, in the units of
    the joint: the gear g becomes g/i, so that a motor's input is still torque at the
    link and a servo's still the angle of the link, as the motor's encoder tells it, see
    :func:`~swgjoint.joint.motors.move_to_rotor`. All else stays with the link: damping,
    friction loss, springs and limits of the joint, tendons, contacts, sensors (those of
    an actuator are on the motor side, like it). Models that are put together with
    ``MjSpec.attach`` may have their drives before or after, see
    :meth:`JointDrive.with_prefix`; integrator and step are those of the outer one.

    With ``friction`` the friction of the map is in the model, too: friction loss and
    damping of the rotor at ``native``; at ``full`` the whole law, with a tendon
    ``<joint>_friction`` that carries its part of the integrator's metric.

    No actuator is added. A motor of its own units belongs on the rotor::

        got = attach(spec, joint="elbow", drive=drive, rotor_inertia=4e-5)
        motor = spec.add_actuator(name="elbow_motor", target=got.rotor or got.joint)
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        motor.gear[0] = 1.0 if got.rotor else got.ratio     # rigid: on the joint

    Levels with a rotor replace MuJoCo's default integrator Euler by ``discrete``;
    another one is kept: RK4 is the reference below its step limit. Under ``discrete``
    a native spring (``linear``, ``native``) is damped by the step itself, about h w/2
    of critical at a torsion frequency w; ``full`` is not. Set the timestep first.

    Args:
        spec: Model to edit.
        joint: Name of a hinge, the first joint of its body, that follows no other
            joint and is not moved through a tendon or by a muscle.
        drive: Map of the drive.
        level: ``rigid``, ``kinematic``, ``linear``, ``native`` or ``full``.
        rotor_inertia: Rotor and wave generator about their axis [kg·m²].
        damping_ratio: Share of critical damping of rotor against link with the link
            inertia at qpos0, the other joints held; that of the map if None [-].
        friction: Whether the model has the friction of the map, where it has any.
        rotor: ``gyroscopic``, a body that its link carries along, or ``lumped``: its
            kinetic energy is that of its rotation against that link alone (Spong
            1987, J. Dyn. Sys. Meas. Control 109:310-319, assumption 2).
        variable: At ``full``, give the tendon the numbers by which one specimen of the
            drive may deviate from its map, see :mod:`swgjoint.joint.variation`.
        max_input_speed: Largest speed of the rotor [rad/s]; harmonics that the step
            cannot carry at it are left out. None keeps all.
        max_phase_step: Largest phase step h n |theta rate| that is kept [rad].

    Raises:
        InputError: If the joint, the level or a value cannot be used; the spec is
            then unchanged.
        ComputationError: If the plugin cannot be loaded or the engine does not take
            its metric.
    """
    if level not in LEVELS:
        raise InputError(f"level {level!r} unknown; accepted: {', '.join(LEVELS)}")
    _positive("rotor_inertia", rotor_inertia, "kg·m²")
    if rotor not in ROTORS:
        raise InputError(f"rotor {rotor!r} unknown; accepted: {', '.join(ROTORS)}")
    if damping_ratio is None:
        damping_ratio = drive.damping_ratio
    if not (np.isfinite(damping_ratio) and 0.0 <= damping_ratio < 1.0):
        raise InputError(
            f"damping_ratio {damping_ratio} of {joint!r}; accepted: 0 to 1"
        )
    if max_input_speed is not None:
        _positive("max_input_speed", max_input_speed, "rad/s")
    _positive("max_phase_step", max_phase_step, "rad")
    has_rotor = level not in ("rigid", "kinematic")
    if has_rotor:
        check_option(spec, level)
    place = find_place(spec, joint, rotor_inertia)

    if not friction:
        drive = replace(drive, friction=None)
    ratio = drive.ratio
    stiffness = drive.mean_stiffness
    reflected = ratio**2 * rotor_inertia
    reduced = reflected * place.inertia / (reflected + place.inertia)
    damping = 2.0 * damping_ratio * float(np.sqrt(stiffness * reduced))
    unresolved: tuple[UnresolvedOrder, ...] = ()
    if level == "full":
        plugin.load()
        if spec.option.integrator in (
            mujoco.mjtIntegrator.mjINT_EULER,
            mujoco.mjtIntegrator.mjINT_DISCRETE,
        ):
            plugin.require_metric()
    if level == "kinematic":
        drive = kinematic_part(drive)
    if level in ("kinematic", "full") and max_input_speed is not None:
        drive, unresolved = prune(
            drive,
            timestep=float(spec.option.timestep),
            max_input_speed=max_input_speed,
            max_phase_step=max_phase_step,
        )
    if level == "kinematic" and not ratio_variation(drive) < 1.0:
        raise InputError(
            f"map {drive.name!r}: its kinematic error turns the ratio by up to"
            f" {ratio_variation(drive):.3g} of itself; accepted at level kinematic:"
            " below 1"
        )
    spring = fit_native(drive) if level == "native" else None

    # nothing can fail from here on: the spec is edited whole or not at all
    names: dict[str, str | None] = {"rotor": None, "tendon": None, "plugin": None}
    hysteresis: tuple[str, ...] = ()
    motors = tuple(a.name for a in actuators_on(spec, joint).values())
    clear_armature(spec, joint)
    if not has_rotor:
        place.joint.armature = reflected
        damping = 0.0
    else:
        names["rotor"] = hinge = f"{joint}_rotor"
        names["tendon"] = tendon = f"{joint}_drive"
        lumped = rotor == "lumped"
        body = add_rotor(spec, place, hinge, rotor_inertia, ratio, lumped=lumped)
        move_to_rotor(spec, place, spec.joint(hinge), ratio=ratio, reflected=reflected)
        if level == "linear":
            add_tendon(
                spec, tendon, hinge, joint, ratio, (stiffness, 0.0, 0.0), damping
            )
        elif spring is not None:
            hysteresis = add_native(spec, spring, tendon, hinge, joint, ratio, damping)
        else:
            names["plugin"] = tendon
            add_tendon(spec, tendon, hinge, joint, ratio, plugin.TENDON_STIFFNESS, 0.0)
            spec.activate_plugin(plugin.NAME)
            instance = spec.add_plugin(
                name=tendon, plugin_name=plugin.NAME, active=True
            )
            instance.config = plugin.config(drive, damping=damping)
            # an instance that no body refers to is lost when a spec is copied
            body.plugin = instance
            body.plugin.name = tendon
            body.plugin.plugin_name = plugin.NAME
            body.plugin.active = True
            if variable:
                spec.tendon(tendon).userdata = np.zeros(SIZE)
                if spec.nuser_tendon >= 0:
                    spec.nuser_tendon = max(spec.nuser_tendon, SIZE)
            if drive.friction is not None:
                add_tendon(
                    spec,
                    f"{joint}_friction",
                    hinge,
                    joint,
                    ratio,
                    plugin.FRICTION_STIFFNESS,
                    0.0,
                    coefficients=drive.friction_direction,
                )
        if spec.option.integrator == mujoco.mjtIntegrator.mjINT_EULER:
            spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    return JointDrive(
        joint=joint,
        rotor=names["rotor"],
        tendon=names["tendon"],
        plugin=names["plugin"],
        level=level,
        ratio=ratio,
        rotor_inertia=float(rotor_inertia),
        link_inertia=place.inertia,
        stiffness=stiffness,
        damping=damping,
        drive=drive,
        unresolved=unresolved,
        native=spring,
        hysteresis=hysteresis,
        motors=motors,
    )


def _positive(name: str, value: float, unit: str) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(f"{name} {value} {unit}; accepted: a finite number > 0")
