"""Attach drives to the hinges of any MuJoCo model by editing its MjSpec."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping

import mujoco
import numpy as np

from swgjoint.flags import check_flags
from swgjoint.joint import plugin
from swgjoint.joint.callers import depth_of_caller
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.elements import add_native, add_rotor, add_tendon, extend_keys
from swgjoint.joint.fitting import LEVELS as LEVELS
from swgjoint.joint.fitting import ROTORS as ROTORS
from swgjoint.joint.fitting import Fitting, check_spec, fit_drive
from swgjoint.joint.motors import clear_armature, misread_sensors, move_to_rotor
from swgjoint.joint.options import options_for
from swgjoint.joint.place import Rotor, find_places, free_inertias
from swgjoint.joint.variation import SIZE
from swgjoint.joint.watch import add_watch, warn_outside
from swgjoint.maps.drive_map import DriveMap


def attach(
    spec: mujoco.MjSpec,
    *,
    joint: str,
    drive: DriveMap,
    level: str = "full",
    rotor_inertia: float,
    damping_ratio: float | None = None,
    friction: bool = True,
    rotor: str = "gyroscopic",
    variable: bool = False,
    max_input_speed: float | None = None,
    max_phase_step: float = 0.5,
    integrator: str = "discrete",
    watch: bool = False,
) -> JointDrive:
    """Turn a hinge into the output of a strain wave gear.

    ``rigid`` gives the joint the reflected inertia i²J as armature. ``kinematic`` uses
    the same model; the kinematic error enters through the controller's commands and
    torques, see :mod:`swgjoint.joint.prescribed`.

    ``linear``, ``native`` and ``full`` add a rotor (body ``<joint>_rotor`` with a hinge
    of the same name, next to the link under the same parent) and a tendon
    ``<joint>_drive`` with the length theta/i - psi. At ``linear`` the tendon is a
    native spring and damper. ``native`` adds a cubic part or tendons
    ``<joint>_corner<k>`` with dead bands, and ``<joint>_hysteresis<k>`` where the map
    has hysteresis. At ``full`` the tendon carries the engine plugin's instance of the
    same name, which evaluates ``drive`` including hysteresis. Keyframes gain the rotor
    coordinate, at the position of zero torsion.

    The inertia of the rotor replaces the armature that the file gives the joint or its
    actuators. Actuators that act on the joint then turn the rotor, in the units of the
    joint: the gear g becomes g/i. The input of a motor is still torque at the link, and
    the input of a servo is still the link angle, now as measured by the motor's
    encoder, see :func:`~swgjoint.joint.motors.move_to_rotor`. If the joint has a single
    actuator of gear 1, a sensor of the joint's actuator torque normally reads that
    actuator; otherwise it reads the torque at the rotor, and a warning lists it.
    Everything else stays with the link: damping, friction loss, springs and limits of
    the joint, tendons, contacts and other sensors. Sensors of an actuator move to the
    motor side with it. Models that are assembled with ``MjSpec.attach`` may get their
    drives before or after the assembly, see :meth:`JointDrive.with_prefix`; the outer
    model sets integrator and step.

    With ``friction`` the model includes the friction of the map: at ``native`` as
    friction loss and damping of the rotor, at ``full`` as the complete friction law,
    whose part of the integrator's metric is carried by a tendon ``<joint>_friction``.

    No actuator is added. A motor that is modelled in its own units acts on the rotor::

        got = attach(spec, joint="elbow", drive=drive, rotor_inertia=4e-5)
        motor = spec.add_actuator(name="elbow_motor", target=got.rotor or got.joint)
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        motor.gear[0] = 1.0 if got.rotor else got.ratio     # rigid: on the joint

    Levels with a rotor replace the integrators Euler (MuJoCo's default), ``implicit``
    and ``implicitfast`` by ``discrete``, the latter two with a warning, because they
    treat the drive as an explicit force. RK4 is kept, because it is an accurate
    reference if the step is short enough. Too few solver iterations or too coarse a
    tolerance are replaced by MuJoCo's defaults with a warning, see
    :mod:`swgjoint.joint.options`.
    Under ``discrete`` the step itself damps a native spring (``linear``, ``native``),
    by about h w/2 of critical at a torsion frequency w; it does not damp ``full``.
    :func:`~swgjoint.joint.step_damping.step_mode` computes the resulting damping, and
    :func:`~swgjoint.joint.step_damping.damp_as_asked` compensates it for one step
    size. Set the timestep before attaching drives.

    Args:
        spec: Model to edit.
        joint: Name of a hinge that is the first joint of its body, follows no other
            joint and is not moved through a tendon or by a muscle.
        drive: Map of the drive.
        level: ``rigid``, ``kinematic``, ``linear``, ``native`` or ``full``.
        rotor_inertia: Inertia of rotor and wave generator about their axis [kg·m²].
        damping_ratio: Damping ratio of the vibration of rotor against link, with the
            link inertia at qpos0 and the other joints locked [-]; None takes the value
            of the map.
        friction: Whether the model includes the friction of the map, if it has any.
        rotor: ``gyroscopic``: a body that moves with the parent link. ``lumped``: a
            rotor whose kinetic energy is only that of its rotation relative to that
            link (Spong 1987, J. Dyn. Sys. Meas. Control 109:310-319, assumption 2).
        variable: At ``full``, reserve user data of the tendon for the deviations of one
            specimen from its map, see :mod:`swgjoint.joint.variation`.
        max_input_speed: Largest speed of the rotor [rad/s]; at ``kinematic`` and
            ``full``, harmonics that the step cannot resolve at this speed are omitted.
            None keeps all.
        max_phase_step: Largest phase step h n |theta rate| of a harmonic that is kept
            [rad].
        integrator: ``discrete`` replaces integrator and solver options as described
            above, ``keep`` replaces none.
        watch: Whether to warn about steps outside the stability region of the
            integrator, here and while the model runs; see
            :mod:`swgjoint.joint.watch`.

    Returns:
        The attached drive, with the names of the elements that it added.

    Raises:
        InputError: If the joint, the level or a value cannot be used; the spec is
            then unchanged.
        ComputationError: If the plugin cannot be loaded or the engine does not accept
            its metric.
    """
    fitting = Fitting(
        drive=drive,
        rotor_inertia=rotor_inertia,
        level=level,
        damping_ratio=damping_ratio,
        friction=friction,
        rotor=rotor,
        variable=variable,
        max_input_speed=max_input_speed,
        max_phase_step=max_phase_step,
    )
    return attach_all(spec, {joint: fitting}, integrator=integrator, watch=watch)[joint]


def attach_all(
    spec: mujoco.MjSpec,
    fittings: Mapping[str, Fitting],
    *,
    integrator: str = "discrete",
    watch: bool = False,
) -> dict[str, JointDrive]:
    """Attach drives to several hinges at once.

    The result is the same as that of :func:`attach` for one joint after the other, in
    the order of the model. It needs one compilation, or two if keyframes state
    positions.

    Args:
        spec: Model to edit.
        fittings: Drive and settings of each joint, by joint name.
        integrator: See :func:`attach`.
        watch: See :func:`attach`.

    Returns:
        The attached drives by joint name, in the order of the model.

    Raises:
        InputError: If a joint or a value cannot be used; the spec is then unchanged.
            One message lists all joints that cannot take a drive.
        ComputationError: If the plugin cannot be loaded or the engine does not accept
            its metric.
    """
    check_spec(spec)
    check_flags(watch=watch)
    for name, fitting in fittings.items():
        fitting.check(name)
    if not fittings:
        return {}
    rotors = any(fitting.has_rotor for fitting in fittings.values())
    options = options_for(spec, integrator, rotors=rotors)

    compiled, places = find_places(
        spec, {name: fitting.rotor_inertia for name, fitting in fittings.items()}
    )
    timestep = float(spec.option.timestep)
    drives = {
        name: fit_drive(name, fittings[name], place, timestep=timestep)
        for name, place in places.items()
    }
    if any(drive.plugin for drive in drives.values()):
        plugin.load()
        if options.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE:
            plugin.require_metric()
    rotor_of = {
        name: Rotor(
            inertia=drive.rotor_inertia,
            ratio=drive.ratio,
            lumped=fittings[name].rotor == "lumped",
            own=drive.rotor is not None,
        )
        for name, drive in drives.items()
    }
    free = free_inertias(compiled, places, rotor_of)
    measured = compiled.around.measured
    moved = {name: places[name] for name, rotor in rotor_of.items() if rotor.own}
    texts = _configs(drives.values())

    # warn first: if warnings are raised as errors, the spec is still unchanged
    options.warn()
    _warn_of_sensors(misread_sensors(moved, measured), drives)
    if watch:
        warn_outside(drives.values(), timestep=timestep, integrator=options.integrator)

    # nothing fails from here on, so the spec is edited completely or not at all
    if texts:
        spec.activate_plugin(plugin.NAME)
    for name, drive in drives.items():
        place, rotor = places[name], rotor_of[name]
        clear_armature(place)
        if not rotor.own:
            place.joint.armature = rotor.reflected
            continue
        assert drive.rotor is not None
        body, hinge = add_rotor(spec, place, drive.rotor, rotor)
        move_to_rotor(
            place,
            hinge,
            ratio=drive.ratio,
            reflected=rotor.reflected,
            free=free.get(name),
            measured=measured,
        )
        if drive.level == "linear":
            pair = hinge.name, name, drive.ratio
            polynomial = drive.stiffness, 0.0, 0.0
            add_tendon(spec, str(drive.tendon), *pair, polynomial, drive.damping)
        elif drive.native is not None:
            add_native(spec, drive, drive.native, hinge)
        else:
            _add_plugin(spec, drive, body, texts[name])
    options.apply(spec)
    extend_keys(spec, drives.values())
    if watch:
        add_watch(spec, drives.values())
    return drives


def _configs(drives: Iterable[JointDrive]) -> dict[str, dict[str, str]]:
    """Attributes of the plugin instances by joint; a shared map is formatted once."""
    texts: dict[int, dict[str, str]] = {}
    configs = {}
    for drive in drives:
        if drive.plugin is None:
            continue
        key = id(drive.drive)
        if key not in texts:
            texts[key] = plugin.config(drive.drive, damping=drive.damping)
        configs[drive.joint] = texts[key] | {
            "damping": repr(float(drive.damping)),
            "contact_damping": repr(float(drive.contact_damping)),
        }
    return configs


def _add_plugin(
    spec: mujoco.MjSpec, drive: JointDrive, body: mujoco.MjsBody, text: dict[str, str]
) -> None:
    """Add an instance of the engine plugin and the tendons that carry its metric."""
    assert drive.plugin is not None and drive.rotor is not None
    pair = drive.rotor, drive.joint, drive.ratio
    tendon = add_tendon(spec, drive.plugin, *pair, plugin.TENDON_STIFFNESS, 0.0)
    instance = spec.add_plugin(name=drive.plugin, plugin_name=plugin.NAME, active=True)
    instance.config = text
    # copying a spec drops a plugin instance that no body refers to
    body.plugin = instance
    body.plugin.name = drive.plugin
    body.plugin.plugin_name = plugin.NAME
    body.plugin.active = True
    if drive.variable:
        tendon.userdata = np.zeros(SIZE)
        if spec.nuser_tendon >= 0:
            spec.nuser_tendon = max(spec.nuser_tendon, SIZE)
    if drive.drive.friction is not None:
        add_tendon(
            spec,
            f"{drive.joint}_friction",
            *pair,
            plugin.FRICTION_STIFFNESS,
            0.0,
            coefficients=drive.drive.friction_direction,
        )


def _warn_of_sensors(
    sensors: Mapping[str, str], drives: Mapping[str, JointDrive]
) -> None:
    """Warn about sensors of joint torque that now read the torque at the rotor."""
    if not sensors:
        return
    factors = ", ".join(
        f"{sensor!r} (times {drives[joint].ratio:g} for joint {joint!r})"
        for sensor, joint in sensors.items()
    )
    warnings.warn(
        f"sensors of joint torque now read the torque at the rotor: {factors};"
        " for the torque on the link use JointDrive.observe(model, data).torque",
        stacklevel=depth_of_caller(),
    )
