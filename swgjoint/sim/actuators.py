"""Engine actuators for motors with control loops, for loads and for disturbances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from swgjoint.drives.sections import MotorLimits
from swgjoint.sim.figures.transmission import Transmission
from swgjoint.sim.scene.feature_sections import (
    Disturbance,
    JointPulse,
    ToolForce,
)
from swgjoint.typing import Array
from swgjoint.units import rpm

if TYPE_CHECKING:
    from swgjoint.sim.assembly import Assembly


SETPOINTS = int(
    mujoco.mjtCtrlInput.mjINPUT_POS
    | mujoco.mjtCtrlInput.mjINPUT_VEL
    | mujoco.mjtCtrlInput.mjINPUT_FF
)
"""Inputs of a motor whose loop runs in the engine: angle, speed and torque."""
TORQUE = int(mujoco.mjtCtrlInput.mjINPUT_FF)
"""Input of a motor whose loop runs outside the engine: torque."""
WORLD_SITE = "disturbance_frame"
"""Name of the site at the world frame in which tool forces are defined."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Loops:
    """Control loops and limits of all motors. All arrays have shape (n_joints,)."""

    stiffness: Array
    """Gain on the motor angle [N·m/rad]."""
    damping: Array
    """Gain on the motor speed [N·m·s/rad]."""
    integral: Array
    """Gain on the integral of the angle error [N·m/(rad·s)]; zero without an integral
    term."""
    integral_limit: Array
    """Largest torque of the integral term [N·m]."""
    limits: tuple[MotorLimits | None, ...]
    """Limits of each motor; None for a motor without limits."""
    sampled: bool
    """Whether the loop runs outside the engine, so that motors take torques only."""

    def setpoints(self, j: int) -> bool:
        """Whether motor j has inputs for angle, speed and torque, or torque alone."""
        limits = self.limits[j]
        line = limits is not None and limits.stall_torque_Nm is not None
        return not self.sampled and (line or bool(self.integral[j]))


def add_actuators(
    spec: mujoco.MjSpec,
    transmissions: Sequence[Transmission],
    loops: Loops,
    load: Array,
    disturbances: Sequence[Disturbance] = (),
    *,
    tool_site: str = "tool",
) -> None:
    """Add a motor with its control loop to every joint, then loads and disturbances.

    The order of the actuators is: all motors, all non-zero loads, all disturbances.

    The loop is the actuator's own law, because MuJoCo then solves it within the step. A
    light rotor in a stiff loop thus stays stable, which it would not if the loop were
    evaluated once per step. Without an integral term and a torque-speed line, the law
    is affine: torque = control - kp angle - kd speed. With an integral term it is the
    engine's ``pid``. With a torque-speed line it is the engine's ``dcmotor``, whose
    voltage limit represents that line. Without a rotor, the motor acts on the joint
    through the gear, so the actuator still has the angle and the speed of the motor.

    Args:
        spec: Model with attached drives; changed in place.
        transmissions: Drives, one per joint.
        loops: Control loops and limits of all motors.
        load: Constant load torque against every joint [N·m]. Shape (n_joints,).
        disturbances: Disturbances of the scene.
        tool_site: Site on which tool forces act.
    """
    for actuator in list(spec.actuators):
        spec.delete(actuator)  # actuators from the file would act in addition
    for j, t in enumerate(transmissions):
        rigid = t.law is None
        motor = spec.add_actuator(
            name=f"{t.joint}_motor",
            target=t.joint if rigid else t.attached.rotor,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
        )
        motor.gear[0] = t.ratio if rigid else 1.0
        _set_law(motor, loops, j)
    for t, torque in zip(transmissions, load, strict=True):
        if torque:
            against = spec.add_actuator(
                name=f"{t.joint}_load",
                target=t.joint,
                trntype=mujoco.mjtTrn.mjTRN_JOINT,
            )
            against.gear[0] = -1.0
    for k, disturbance in enumerate(disturbances):
        one = spec.add_actuator(name=f"disturbance{k}")
        if isinstance(disturbance, ToolForce):
            if spec.site(WORLD_SITE) is None:
                spec.worldbody.add_site(name=WORLD_SITE)
            one.trntype = mujoco.mjtTrn.mjTRN_SITE
            one.target, one.refsite = tool_site, WORLD_SITE
            one.gear[:3] = disturbance.force_N
        else:
            one.trntype = mujoco.mjtTrn.mjTRN_JOINT
            one.target = disturbance.joint


def _set_law(motor: Any, loops: Loops, j: int) -> None:
    """Set the control law and the limits of motor j."""
    limits = loops.limits[j]
    kp, kd, ki = (x[j] for x in (loops.stiffness, loops.damping, loops.integral))
    largest = loops.integral_limit[j] / ki if ki else 0.0
    torque = None if limits is None else limits.torque
    if ki and not loops.sampled:
        # clamp the state as well: the engine's own clamp acts one step after the limit
        motor.actlimited = mujoco.mjtLimited.mjLIMITED_TRUE
        motor.actrange = [-largest, largest]
    if limits is not None and limits.stall_torque_Nm is not None:
        # choose the unit of voltage so that the motor constant is 1
        top = (limits.no_load_speed_rpm or 0.0) * rpm
        gains = [0.0] * 3 if loops.sampled else [kp, ki, kd]
        motor.set_to_dcmotor(
            motorconst=[1.0, 0.0],
            resistance=top / limits.stall_torque_Nm,
            saturation=[torque or 0.0, 0.0, 0.0],
            controller=[*gains, 0.0, 0.0 if loops.sampled else largest, top],
            ctrlspec=TORQUE if loops.sampled else SETPOINTS,
        )
        return
    if ki and not loops.sampled:
        motor.set_to_pid(kp=kp, kv=kd, ki=ki, imax=largest, ctrlspec=SETPOINTS)
    else:
        motor.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        motor.gainprm[0] = 1.0
        if not loops.sampled:
            motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
            motor.biasprm[:3] = [0.0, -kp, -kd]
    if torque is not None:
        motor.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        motor.forcerange = [-torque, torque]


def control_inputs(assembly: Assembly) -> Array:
    """Inputs of motors, loads and disturbances at every engine step.

    The integrator ``discrete`` evaluates the loop at the end of a step and uses the
    reference at that instant; Euler integrators evaluate the loop at the start. RK4
    evaluates it over the whole step with a constant reference, that of its middle. The
    reference of the start would be late by half a step, an error of first order.

    At level ``kinematic`` the prescribed error is added to the reference, and the motor
    input includes the torque that accelerates the rotor inertia along this error; see
    :mod:`swgjoint.joint.prescribed`. For sampled loops the inputs contain only this
    torque, to which the loop adds its own.

    Returns:
        Actuator inputs. Shape (n_steps, n_inputs).
    """
    path, ratio, loops = assembly.trajectory, assembly.ratio, assembly.loops
    angle = ratio * (path.position + assembly.prescribed)
    speed = ratio * (path.velocity + assembly.prescribed_rate)
    acceleration = np.diff(assembly.prescribed_rate, axis=0) / assembly.step
    extra = assembly.rotor_inertia * ratio * acceleration
    angle, speed, feedforward = (
        _of_steps(values, assembly.model.opt.integrator)
        for values in (angle, speed, assembly.feedforward)
    )
    if loops.sampled:
        motors = extra
    else:
        motors = loops.stiffness * angle + loops.damping * speed + feedforward + extra
    columns = [
        np.column_stack([angle[:, j], speed[:, j], feedforward[:, j] + extra_j])
        if loops.setpoints(j)
        else motors[:, j : j + 1]
        for j, extra_j in enumerate(extra.T)
    ]
    load = assembly.load[assembly.load != 0.0]
    acting = [
        disturbance_at(d, _middle(path.time))[:, None] for d in assembly.disturbances
    ]
    return np.hstack(
        [*columns, np.broadcast_to(load, (len(motors), load.size)), *acting]
    )


def _of_steps(values: Array, integrator: int) -> Array:
    """Values that the loop uses in every step, see :func:`control_inputs`.

    Args:
        values: Values at the ends of the steps (n, n_joints).
        integrator: Integrator of the engine.

    Returns:
        Values of the steps (n - 1, n_joints).
    """
    if integrator == mujoco.mjtIntegrator.mjINT_DISCRETE:
        return values[1:]
    if integrator == mujoco.mjtIntegrator.mjINT_RK4:
        return _middle(values)
    return values[:-1]


def _middle(values: Array) -> Array:
    """Means of successive values (n, ...), shape (n - 1, ...)."""
    return np.asarray(0.5 * (values[1:] + values[:-1]))


def disturbance_at(disturbance: Disturbance, time: Array) -> Array:
    """Input of a disturbance's actuator over time.

    Args:
        disturbance: The disturbance.
        time: Instants [s]. Shape (n,).

    Returns:
        Torque on the joint [N·m], or factor on the tool force (0 or 1). Shape (n,).
    """
    length = disturbance.duration_s
    end = np.inf if length is None else disturbance.start_s + length
    acts = ((time >= disturbance.start_s) & (time < end)).astype(float)
    if isinstance(disturbance, ToolForce):
        return acts
    assert disturbance.torque_Nm is not None  # of an assembly, see scaled_disturbances
    acts = acts * disturbance.torque_Nm
    if isinstance(disturbance, JointPulse):
        return acts
    phase = 2.0 * np.pi * disturbance.frequency_Hz * (time - disturbance.start_s)
    return np.asarray(acts * np.sin(phase))


def limit_torque(command: Array, speed: Array, limits: MotorLimits | None) -> Array:
    """Torque that a motor delivers for a commanded torque at a speed [N·m].

    Args:
        command: Commanded torque [N·m]. Shape (..., n).
        speed: Motor speed [rad/s]. Shape (n,).
        limits: Limits of the motor; None for an unlimited motor.

    Returns:
        Limited torque [N·m]. Shape of ``command``.
    """
    if limits is None:
        return command
    if limits.stall_torque_Nm is not None:
        share = speed / ((limits.no_load_speed_rpm or np.inf) * rpm)
        stall = limits.stall_torque_Nm
        command = np.clip(command, -stall * (1.0 + share), stall * (1.0 - share))
    bound = np.inf if limits.torque is None else limits.torque
    return np.asarray(np.clip(command, -bound, bound))


def wanted_torque(
    assembly: Assembly, theta: Array, theta_rate: Array, integral: Array
) -> Array:
    """Torque that the engine's loops commanded in the step to each state [N·m].

    For each state, the function returns the torque at the start and at the end of the
    step that led to it. The integrator ``discrete`` applies only the torque at the end,
    so both are equal. Other integrators hold the reference while the motor turns. For
    them the mean motor speed of the step is used, because a stiff loop makes a light
    rotor oscillate within every step, which the speeds at its ends do not show.

    Args:
        assembly: The scene as it was run.
        theta: Motor angles of the recorded states [rad]. Shape (n, n_joints).
        theta_rate: Motor speeds of the recorded states [rad/s]. Shape (n, n_joints).
        integral: Integral of the angle error [rad·s]. Shape (n, n_joints).

    Returns:
        Torque before limitation, at the start and at the end of the step [N·m]. Shape
        (2, n, n_joints). The first state has the torque of the second.
    """
    path, ratio, loops = assembly.trajectory, assembly.ratio, assembly.loops
    parts = assembly.sub_steps
    # a prescribed error shifts reference and angle of the loop equally
    angle = ratio * (path.position + assembly.prescribed)
    speed = ratio * (path.velocity + assembly.prescribed_rate)
    setpoint = loops.stiffness * angle + loops.damping * speed + assembly.feedforward
    theta = theta + ratio * assembly.prescribed[::parts]
    feedback = loops.integral * integral - loops.stiffness * theta
    if assembly.scene.simulation.integrator == "discrete":
        theta_rate = theta_rate + ratio * assembly.prescribed_rate[::parts]
        wanted = setpoint[::parts] + feedback - loops.damping * theta_rate
        return np.stack([wanted, wanted])
    # mean input over the sub-steps of a step
    held = _of_steps(setpoint, assembly.model.opt.integrator)
    held = held.reshape(-1, parts, len(ratio)).mean(axis=1)
    held -= loops.damping * np.diff(theta, axis=0) / (parts * assembly.step)
    first = held + feedback[:-1]
    return np.stack([np.vstack([first[:1], x]) for x in (first, held + feedback[1:])])
