"""Contents of a compiled model, and what it leaves out and why."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.faults import Section
from swgjoint.joint.step_damping import StepMode, step_mode
from swgjoint.joint.tilt import tilt_names
from swgjoint.sim.figures.left_out import ERRING, LOSSY, parts_left_out
from swgjoint.units import arcmin, hertz

if TYPE_CHECKING:
    from swgjoint.joint.drive import JointDrive
    from swgjoint.sim.assembly import Assembly
    from swgjoint.sim.figures.transmission import Transmission

OFF_DAMPING = 0.02
"""Increase of the damping ratio by the time steps from which it is reported [-]."""
GAUGES_LEFT_OUT = (
    "shear of the tooth forces that follows the lobes, clearance of the wave-generator"
    " bearing, length and noise of the gauges"
)
"""Effects that readings of strain gauges do not contain."""


def contents(assembly: Assembly) -> dict[str, Any]:
    """Contents of the compiled model and what it leaves out, as JSON values."""
    model = assembly.model
    return {
        "degrees_of_freedom": int(model.nv),
        "tendons": int(model.ntendon),
        "plugin_instances": int(model.nplugin),
        "actuators": int(model.nactuator),
        "integrator": assembly.scene.simulation.integrator,
        "step_s": assembly.scene.simulation.step_s,
        "sub_steps": assembly.sub_steps,
        "sub_stepped_for": dict(assembly.outside),
        "joints": {t.joint: _joint(assembly, t) for t in assembly.transmissions},
        **_features(assembly),
        "left_out": [
            {"joint": t.joint, **item}
            for t in assembly.transmissions
            for item in (
                *parts_left_out(t),
                *_off_damping(assembly, t),
                *_tilt_damping(assembly, t.joint),
                *_not_warming(assembly, t),
            )
        ],
        "absent": _absent(assembly),
    }


def _features(assembly: Assembly) -> dict[str, Any]:
    """Controller, and any motor limits, payload, sensors and disturbances."""
    scene, loops = assembly.scene, assembly.loops
    step = scene.simulation.step_s
    external = assembly.controlled_by
    features: dict[str, Any] = {
        "controller": {
            "kind": scene.controller.kind if external is None else external,
            "feedback": scene.controller.feedback,
            "control_period_s": (scene.controller.control_period_s or step)
            if loops.sampled
            else None,
            "runs_in": "Python, sampled" if loops.sampled else "the engine's actuators",
        }
    }
    limits = {
        name: _set_keys(one)
        for name, one in zip(assembly.joints, loops.limits, strict=True)
        if one is not None
    }
    if limits:
        features["motor_limits"] = limits
    if assembly.bearings:
        features["output_bearings"] = {
            name: {
                "tilt_stiffness_Nm_arcmin": one.tilt_stiffness * arcmin,
                "source": one.source,
            }
            for name, one in assembly.bearings.items()
        }
    if assembly.gauges:
        features["gauges"] = {
            name: {
                "flexspline": one.design,
                "strain": one.model,
                "bridges": one.ring.bridges,
                "left_out": GAUGES_LEFT_OUT,
            }
            for name, one in assembly.gauges.items()
        }
    thermal = {
        t.joint: _set_keys(section.thermal)
        for t in assembly.transmissions
        if (section := scene.joint_settings(t.joint)).thermal and t.attached.friction
    }
    if thermal:
        features["thermal"] = thermal
    if scene.payload is not None:
        features["payload"] = scene.payload.model_dump()
    if scene.sensors is not None:
        features["sensors"] = _set_keys(scene.sensors)
    if scene.disturbance:
        features["disturbances"] = [_set_keys(one) for one in scene.disturbance]
    return features


def _absent(assembly: Assembly) -> list[dict[str, str]]:
    """Optional parts that scene and model do not have, each with the reason."""
    scene, loops, tables = assembly.scene, assembly.loops, "the scene has no"
    plugin = any(t.attached.plugin for t in assembly.transmissions)
    parts = (
        ("motor limits", any(loops.limits), f"{tables} motor table"),
        ("payload", scene.payload, f"{tables} [payload]"),
        ("sensors", scene.sensors, f"{tables} [sensors]; angles are read exactly"),
        ("disturbances", scene.disturbance, f"{tables} [[disturbance]]"),
        ("load torques", any(assembly.load), f"{tables} non-zero [load]"),
        ("integral of the error", any(loops.integral), "the controller is not a pid"),
        (
            "sampled controller",
            loops.sampled,
            "the scene does not require one; the control acts within every step",
        ),
        ("engine plugin", plugin, "no joint has a level that needs it"),
    )
    return [{"part": part, "reason": why} for part, there, why in parts if not there]


def _tilt_damping(assembly: Assembly, joint: str) -> list[dict[str, str]]:
    """Numerical damping of the tilt of an output bearing, if there is much of it.

    The integrator ``discrete`` damps an angular frequency w by h w/2 of critical.
    """
    bearing = assembly.bearings.get(joint)
    if bearing is None:
        return []
    model = assembly.model
    dofs = [int(model.joint(name).dofadr[0]) for name in tilt_names(joint)]
    rate = float(np.sqrt(bearing.tilt_stiffness / model.dof_M0[dofs].max()))
    added = 0.5 * assembly.step * rate
    if added < OFF_DAMPING:
        return []
    return [
        {
            "part": f"damping ratio {bearing.damping_ratio:g} of the tilt of the output"
            " bearing",
            "reason": f"time steps of {1e3 * assembly.step:g} ms raise the damping"
            f" ratio of its vibration at {rate / hertz:.0f} Hz to"
            f" {bearing.damping_ratio + added:.2g}; tilts that change slowly are"
            " correct; use a shorter simulation.step_s",
        }
    ]


def _not_warming(
    assembly: Assembly, transmission: Transmission
) -> list[dict[str, str]]:
    """What the model omits of the warming that the scene describes."""
    scene, attached = assembly.scene, transmission.attached
    if scene.joint_settings(transmission.joint).thermal is None:
        return []
    if attached.friction is not None:
        if not scene.cycle:
            return []
        part = "temperature at the end of one task at the start of the next"
        return [{"part": part, "reason": "every task of the cycle starts anew"}]
    reason = f"not at level {attached.level}; use joints.*.level = 'full'"
    if attached.level == "full":
        reason = "joints.*.friction = false"
    return [{"part": "warming of the drive by its losses", "reason": reason}]


def _set_keys(section: Section) -> dict[str, Any]:
    """Values of a table under their keys, without keys that have none."""
    return section.model_dump(exclude_none=True)


def _joint(assembly: Assembly, transmission: Transmission) -> dict[str, Any]:
    """Contents of one joint in the compiled model."""
    attached = transmission.attached
    return {
        "level": attached.level,
        "drive": transmission.drive.name,
        "source": transmission.drive.level,
        "ratio": attached.ratio,
        "rotor": attached.rotor,
        "tendon": attached.tendon,
        "plugin": attached.plugin,
        "rotor_inertia_kgm2": attached.rotor_inertia,
        "stiffness_Nm_rad": None if attached.rotor is None else attached.stiffness,
        "damping_Nms_rad": attached.damping,
        "natural_frequency_Hz": attached.natural_frequency / hertz,
        **_at_step(assembly, transmission),
        "orders": list(attached.kept_orders)
        if attached.level in ("kinematic", "full")
        else [],
        "kinematic_error": _error(attached),
        "hysteresis_elements": len(attached.drive.hysteresis)
        if attached.level in LOSSY
        else 0,
        "friction": attached.drive.friction.source
        if attached.drive.friction and attached.level in LOSSY
        else None,
        **_native(attached),
    }


def _at_step(assembly: Assembly, transmission: Transmission) -> dict[str, Any]:
    """Damping ratio and frequency of the torsional vibration in discrete time."""
    mode, loaded = _modes(assembly, transmission)
    if mode is None or loaded is None:
        return {}
    return {
        "damping_ratio": mode.own_damping_ratio,
        "step_damping_ratio": mode.damping_ratio,
        "step_damping_ratio_rated": loaded.damping_ratio,
        "step_frequency_Hz": mode.frequency / hertz,
    }


def _modes(
    assembly: Assembly, transmission: Transmission
) -> tuple[StepMode | None, StepMode | None]:
    """Torsional vibration in discrete time about zero and about rated torque.

    Both are None for integrators other than ``discrete`` and joints without a rotor.
    """
    if assembly.scene.simulation.integrator != "discrete":
        return None, None
    rated = transmission.drive.ratings.rated_torque
    zero, loaded = (
        step_mode(transmission.attached, timestep=assembly.step, torque=torque)
        for torque in (0.0, rated)
    )
    return zero, loaded


def _off_damping(
    assembly: Assembly, transmission: Transmission
) -> list[dict[str, str]]:
    """Entry for a torsional vibration that the time steps damp more than the drive."""
    for mode, where in zip(
        _modes(assembly, transmission), ("", " at rated torque"), strict=True
    ):
        # in a clearance, where the spring hardly acts, nothing vibrates
        if mode is None or mode.own_damping_ratio >= 1.0:
            continue
        own, got = mode.own_damping_ratio, mode.damping_ratio
        if got < own + OFF_DAMPING:
            continue
        full = transmission.attached.level == "full"
        other = "" if full else " or joints.*.level = 'full'"
        part = f"damping ratio {own:.2g} of the drive"
        reason = (
            f"time steps of {1e3 * assembly.step:.3g} ms raise the damping ratio of the"
            f" torsional vibration at {mode.own_frequency / hertz:.3g} Hz to"
            f" {got:.2g}{where}; use a shorter simulation.step_s{other}"
        )
        return [{"part": part, "reason": reason}]
    return []


def _error(attached: JointDrive) -> str | None:
    """Source of the kinematic error in the model; None without kinematic error."""
    drive = attached.drive
    if attached.level not in ERRING or not drive.kinematic_error[1:].any():
        return None
    return str(drive.info.get("kinematic_error", "of the map"))


def _native(attached: JointDrive) -> dict[str, Any]:
    """Elements of level ``native``; empty at other levels."""
    spring = attached.native
    if spring is None:
        return {}
    return {
        "native": {
            "linear_Nm_rad": spring.linear,
            "cubic_Nm_rad3": spring.cubic,
            "corners": [
                {"torsion_rad": c.torsion, "stiffness_Nm_rad": c.stiffness}
                for c in spring.corners
            ],
            "residual_Nm": spring.residual,
            "fitted_to_Nm": spring.fitted_to,
            "hysteresis": list(attached.hysteresis),
            "friction_Nm": spring.friction,
            "viscous_Nms_rad": spring.viscous,
        }
    }
