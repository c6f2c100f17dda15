"""Motors with their loops and limits, loads and disturbances as engine actuators."""

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
    JointSine,
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
TORQUE = int(mujoco.mjtCtrlInput.mjINPUT_FF)
WORLD_SITE = "disturbance_frame"


@dataclass(frozen=True, kw_only=True, eq=False)
class Loops:
    """Control loops and limits of all motors; arrays of shape (n_joints,)."""

    stiffness: Array
    """Gain on the motor angle [N·m/rad]."""
    damping: Array
    """Gain on the motor speed [N·m·s/rad]."""
    integral: Array
    """Gain on the integral of the angle's error [N·m/(rad·s)]; 0: none."""
    integral_limit: Array
    """Largest torque of the integral [N·m]."""
    limits: tuple[MotorLimits | None, ...]
    sampled: bool
    """The loop is not the engine's: its motors only take torques."""

    def setpoints(self, j: int) -> bool:
        """Whether motor j takes angle, speed and torque, or a torque alone."""
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
    """A motor with its control loop on every joint, a load where there is one.

    Actuators in this order: all motors, the loads that are not zero, disturbances.

    The loop is the actuator's own law, because MuJoCo then solves it within the step: a
    light rotor under a stiff loop stays stable where a loop evaluated once per step
    would not. Without integral and torque-speed line it is affine, torque = control -
    kp angle - kd speed; with an integral the engine's ``pid``; with a torque-speed line
    its ``dcmotor``, whose voltage limit is that line. Without a rotor the motor acts on
    the joint through the gear, so angle and speed are the motor's too.
    """
    for actuator in list(spec.actuators):
        spec.delete(actuator)  # motors of the arm's file would act beside ours
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
    """Gains and limits of one motor."""
    limits = loops.limits[j]
    kp, kd, ki = (x[j] for x in (loops.stiffness, loops.damping, loops.integral))
    largest = loops.integral_limit[j] / ki if ki else 0.0
    torque = None if limits is None else limits.torque
    if ki and not loops.sampled:
        # the engine's own clamp stops the integral one step after the limit
        motor.actlimited = mujoco.mjtLimited.mjLIMITED_TRUE
        motor.actrange = [-largest, largest]
    if limits is not None and limits.stall_torque_Nm is not None:
        # voltage in units in which the motor constant is 1
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
    """Actuator inputs of every step, motors, loads, disturbances. (n_steps, n_inputs).

    The integrator ``discrete`` evaluates the loop at the end of the step, so the
    reference of that instant goes in; others evaluate it at the start. At level
    ``kinematic`` the angle that the loop sees is off by the prescribed error, and the
    rotor's inertia acts against that error's acceleration; see
    :mod:`swgjoint.joint.prescribed`. Motors of a sampled loop get nothing but that.
    """
    path, ratio, loops = assembly.trajectory, assembly.ratio, assembly.loops
    angle = ratio * (path.position + assembly.prescribed)
    speed = ratio * (path.velocity + assembly.prescribed_rate)
    at_end = assembly.scene.simulation.integrator == "discrete"
    taken = slice(1, None) if at_end else slice(None, -1)
    acceleration = np.diff(assembly.prescribed_rate, axis=0) / assembly.step
    extra = assembly.rotor_inertia * ratio * acceleration
    if loops.sampled:
        motors = extra
    else:
        folded = loops.stiffness * angle + loops.damping * speed + assembly.feedforward
        motors = folded[taken] + extra
    columns = [
        np.column_stack(
            [angle[taken, j], speed[taken, j], assembly.feedforward[taken, j] + extra_j]
        )
        if loops.setpoints(j)
        else motors[:, j : j + 1]
        for j, extra_j in enumerate(extra.T)
    ]
    load = assembly.load[assembly.load != 0.0]
    middle = 0.5 * (path.time[1:] + path.time[:-1])
    acting = [disturbance_at(d, middle)[:, None] for d in assembly.disturbances]
    return np.hstack(
        [*columns, np.broadcast_to(load, (len(motors), load.size)), *acting]
    )


def disturbance_at(disturbance: Disturbance, time: Array) -> Array:
    """Input of a disturbance's actuator: torque [N·m], or share of the force. (n,)."""
    length = disturbance.duration_s
    end = np.inf if length is None else disturbance.start_s + length
    acts = ((time >= disturbance.start_s) & (time < end)).astype(float)
    if isinstance(disturbance, JointPulse):
        return acts * disturbance.torque_Nm
    if isinstance(disturbance, JointSine):
        phase = 2.0 * np.pi * disturbance.frequency_Hz * (time - disturbance.start_s)
        return np.asarray(acts * disturbance.torque_Nm * np.sin(phase))
    return acts


def limit_torque(command: Array, speed: Array, limits: MotorLimits | None) -> Array:
    """What a motor gives of a wanted torque at a speed [N·m]. Shape (n,).

    Args:
        command: Wanted [N·m]. Shape (n,).
        speed: Of the motor [rad/s]. Shape (n,).
        limits: Of the motor; None: no limits.
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
    """Torque that the engine's loops ask for on the way to each recorded state [N·m].

    The torque beside a state is that of the step that led to it, at the start and at
    the end of that step. The integrator ``discrete`` acts with the end alone: both are
    the same. Others hold the reference while the motor turns on, taken at its mean
    speed over the step: a stiff loop swings a light rotor within every step, which the
    speeds at its ends do not show.

    Args:
        assembly: The scene as it was run.
        theta: Motor angles in the recorded states [rad]. Shape (n, n_joints).
        theta_rate: [rad/s]. Shape (n, n_joints).
        integral: Of the angle's error [rad·s]. Shape (n, n_joints).

    Returns:
        Shape (2, n, n_joints).
    """
    path, ratio, loops = assembly.trajectory, assembly.ratio, assembly.loops
    parts = assembly.sub_steps
    # as the loop sees them: a prescribed error moves reference and angle alike
    angle = ratio * (path.position + assembly.prescribed)
    speed = ratio * (path.velocity + assembly.prescribed_rate)
    asked = loops.stiffness * angle + loops.damping * speed + assembly.feedforward
    theta = theta + ratio * assembly.prescribed[::parts]
    given = loops.integral * integral - loops.stiffness * theta
    if assembly.scene.simulation.integrator == "discrete":
        theta_rate = theta_rate + ratio * assembly.prescribed_rate[::parts]
        wanted = asked[::parts] + given - loops.damping * theta_rate
        return np.stack([wanted, wanted])
    # the mean of what the parts of a step were given
    held = asked[:-1].reshape(-1, parts, len(ratio)).mean(axis=1)
    held -= loops.damping * np.diff(theta, axis=0) / (parts * assembly.step)
    first = held + given[:-1]
    return np.stack([np.vstack([first[:1], x]) for x in (first, held + given[1:])])
