r"""Energy balance of a run: work, losses and stored energy.

.. math:: W_\text{motor} + W_\text{load} = \Delta E_\text{kinetic}
    + \Delta E_\text{weight} + \Delta E_\text{elastic} + D
    + E_\text{balance error}

where D is the dissipated energy. The balance error consists of the numerical damping of
the integrator and of the error of sums over samples. All other terms are computed
independently.

The work of a torque during a step of the discrete integrator is the torque times the
step times the mean of the speeds before and after the step. This equals the change of
kinetic energy exactly. Torque times displacement would not, because this integrator
advances positions by the speed after the step, which is half a step late.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from swgjoint.sim.actuators import disturbance_at
from swgjoint.sim.scene.feature_sections import ToolForce
from swgjoint.typing import Array

if TYPE_CHECKING:
    from swgjoint.sim.figures.transmission import Transmission
    from swgjoint.sim.run import Run


IDLE = 1e-3
"""Ratio of mean torque to rated torque below which a joint counts as idle."""


def run_energy(run: Run) -> dict[str, float]:
    """Energy balance of the whole arm over the whole run [J].

    Returns:
        Terms of the balance under the keys of the JSON output; ``stored_J`` is the sum
        of the terms whose keys end in ``_change_J``.
    """
    joints = [joint_energy(run, j) for j in range(len(run.joints))]
    motor = sum(joint["motor_work_J"] for joint in joints)
    tilting, tilt_damping = _tilt_energies(run)
    in_arm = arm_dissipation(run) + tilt_damping
    dissipated = in_arm + sum(joint["dissipated_J"] for joint in joints)
    load = load_work(run)
    kinetic, weight = _rigid_energies(run)
    elastic = tilting + sum(_elastic(run, j) for j in range(len(run.joints)))
    springs = _arm_springs(run)
    stored = kinetic + weight + elastic + springs
    return {
        "motor_work_J": motor,
        "load_work_J": load,
        "dissipated_J": dissipated,
        "arm_dissipated_J": in_arm,
        "kinetic_change_J": kinetic,
        "weight_change_J": weight,
        "elastic_change_J": elastic,
        "spring_change_J": springs,
        "stored_J": stored,
        "balance_error_J": motor + load - stored - dissipated,
    }


def joint_energy(run: Run, j: int) -> dict[str, Any]:
    """Work on both sides of one drive and its dissipation over the run [J].

    ``efficiency`` is the ratio of delivered to received work in the constant-speed
    part, for either direction of power flow. It is None, with the reason under
    ``missing``, if the joint has no such part or transmits almost no torque there.

    Args:
        run: The run.
        j: Index of the joint.
    """
    window = run.steady
    motor = _motor_work(run, j, slice(None))
    out = _link_work(run, j, slice(None))
    efficiency, missing = None, None
    if run.assembly.trajectory.steady_velocity[j] == 0.0:
        missing = "the joint has no constant speed"
    else:
        work_in, work_out = _motor_work(run, j, window), _link_work(run, j, window)
        rated = run.assembly.transmissions[j].drive.ratings.rated_torque
        mean = np.abs(run.output_torque[window, j]).mean()
        if mean < IDLE * rated or work_in * work_out <= 0.0:
            missing = "the joint runs idle"
        else:
            efficiency = work_out / work_in if work_out > 0.0 else work_in / work_out
    return {
        "motor_work_J": motor,
        "link_work_J": out,
        "dissipated_J": dissipation(run, j),
        "efficiency": efficiency,
        **({} if missing is None else {"missing": {"efficiency": missing}}),
    }


def load_work(run: Run) -> float:
    """Work of loads and disturbances on the arm [J]."""
    assembly = run.assembly
    moved = run.position[-1] - run.position[0]
    total = -float(assembly.load @ moved)
    middle = 0.5 * (run.time[1:] + run.time[:-1])
    for disturbance in assembly.disturbances:
        value = disturbance_at(disturbance, middle)
        if isinstance(disturbance, ToolForce):
            # mean displacement of the tool over two steps, as the mean speed gives it
            way = np.gradient(run.tool_position @ np.array(disturbance.force_N))[:-1]
        else:
            way = _way(run, run.velocity[:, run.joints.index(disturbance.joint)])
        total += float(value @ way)
    return total


def dissipation(run: Run, j: int) -> float:
    """Energy that one drive dissipates [J]; zero at levels without a rotor.

    It is the sum of the losses by damping, hysteresis and friction.

    Args:
        run: The run.
        j: Index of the joint.
    """
    return drive_loss(
        run.assembly.transmissions[j],
        torsion=run.torsion[:, j],
        slipping=run.slipping_torque[:, j],
        friction=run.friction_torque[:, j],
        stored=float(run.hysteresis_energy[j]),
        theta=run.motor_position[:, j],
        psi=run.position[:, j],
        step=run.assembly.scene.simulation.step_s,
    )


def drive_loss(
    transmission: Transmission,
    *,
    torsion: Array,
    slipping: Array,
    friction: Array,
    stored: float,
    theta: Array,
    psi: Array,
    step: float,
) -> float:
    """Energy that one drive dissipates during a record [J], as :func:`dissipation`.

    Args:
        transmission: The drive.
        torsion: Torsion [rad]. Shape (n,).
        slipping: Hysteresis torque along the torsion [N·m]. Shape (n,).
        friction: Friction torque of the wave generator [N·m]. Shape (n,).
        stored: Change of the energy stored in the hysteresis springs [J].
        theta: Motor angles [rad]. Shape (n,).
        psi: Link angles [rad]. Shape (n,).
        step: Time between two samples [s].
    """
    attached = transmission.attached
    if transmission.law is None:
        return 0.0
    twist = np.diff(torsion)
    total = attached.damping / step * float(twist @ twist)
    total += _work(slipping, torsion)
    total -= stored
    turn = np.diff(theta)
    if attached.native is not None:
        total += attached.native.friction * float(np.abs(turn).sum())
        total += attached.native.viscous / step * float(turn @ turn)
    elif attached.friction is not None:
        by_theta, by_psi = transmission.drive.friction_direction
        total += _work(friction, by_theta * theta + by_psi * psi)
    return total


def arm_dissipation(run: Run) -> float:
    """Energy dissipated by damping and dry friction of the arm without drives [J]."""
    model = run.assembly.arm.model
    step = run.assembly.scene.simulation.step_s
    speeds = 0.5 * (run.velocity[1:] + run.velocity[:-1])
    accelerations = np.diff(run.velocity, axis=0) / step
    total = step * float(np.sum(_dry_friction(run, speeds, accelerations) * speeds))
    damped = (model.dof_damping, model.dof_dampingpoly, model.tendon_damping)
    if not any(values.any() for values in damped):
        return total
    data = mujoco.MjData(model)
    middle = 0.5 * (run.position[1:] + run.position[:-1])
    for q, v in zip(middle, speeds, strict=True):
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_fwdVelocity(model, data)
        total -= step * float(data.qfrc_damper @ v)
    return total


def _dry_friction(run: Run, speeds: Array, accelerations: Array) -> Array:
    r"""Dry-friction torque of the arm's joints in the engine's model [N·m].

    .. math:: \tau = \operatorname{clip}\left((b v + a)/R, \pm f\right), \quad
        R = A (1 - d)/d, \quad b = 2/(d_\text{max} t_c)

    with joint speed v, acceleration a, friction torque limit f, inverse inertia A at
    the joint, impedance d and time constant :math:`t_c` of the constraint. The joint
    creeps where a rigid friction law would stick.

    Args:
        run: The run.
        speeds: Mean joint speeds of the steps [rad/s]. Shape (n - 1, n_joints).
        accelerations: Joint accelerations [rad/s²]. Shape (n - 1, n_joints).

    Source:
        MuJoCo documentation, chapter Computation, "Constraint model".
    """
    assembly = run.assembly
    model, dofs = assembly.model, assembly.link_velocity
    impedance = model.dof_solimp[dofs, 0]
    slip = model.dof_invweight0[dofs] * (1.0 - impedance) / impedance
    constant = np.maximum(model.dof_solref[dofs, 0], 2.0 * assembly.step)
    rate = 2.0 / (model.dof_solimp[dofs, 1] * constant)
    most = model.dof_frictionloss[dofs]
    stopping = (rate * speeds + accelerations) / np.maximum(slip, 1e-15)
    return np.asarray(np.clip(stopping, -most, most))


def _arm_springs(run: Run) -> float:
    """Change of the energy stored in springs of the arm's joints and tendons [J]."""
    model, energies = run.assembly.arm.model, []
    data = mujoco.MjData(model)
    for q in run.position[[0, -1]]:
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        mujoco.mj_energyPos(model, data)
        weight = -float(model.body_mass @ (data.xipos @ model.opt.gravity))
        energies.append(float(data.energy[0]) - weight)
    return energies[1] - energies[0]


def _tilt_energies(run: Run) -> tuple[float, float]:
    """Change of elastic energy of all output bearings, and their dissipation [J]."""
    assembly = run.assembly
    if not assembly.bearings:
        return 0.0, 0.0
    stiffness = np.repeat([b.tilt_stiffness for b in assembly.bearings.values()], 2)
    first, last = 0.5 * (run.tilt[[0, -1]] ** 2 @ stiffness)
    damping = assembly.model.dof_damping[assembly.tilt_velocity]
    step = assembly.scene.simulation.step_s
    turned = np.diff(run.tilt, axis=0)
    return float(last - first), float(np.sum(turned**2 @ damping)) / step


def _motor_work(run: Run, j: int, part: slice) -> float:
    """Work of one motor during a part of the run [J]."""
    # the torque of a state acted during the whole step that led to it
    torque = run.motor_torque[part, j][1:]
    if run.assembly.scene.simulation.integrator == "discrete":
        return float(torque @ _way(run, run.motor_velocity[part, j]))
    return float(torque @ np.diff(run.motor_position[part, j]))


def _way(run: Run, speed: Array) -> Array:
    """Displacements [rad] from the mean speeds of the steps. Shape (n - 1, ...)."""
    step = run.assembly.scene.simulation.step_s
    return np.asarray(0.5 * step * (speed[1:] + speed[:-1]))


def _link_work(run: Run, j: int, part: slice) -> float:
    """Work of one drive on its link during a part of the run [J]."""
    return _work(run.output_torque[part, j], run.position[part, j])


def _work(torque: Array, angle: Array) -> float:
    """Integral of a torque over its angle by the trapezoidal rule [J]."""
    return float(0.5 * (torque[1:] + torque[:-1]) @ np.diff(angle))


def _elastic(run: Run, j: int) -> float:
    """Change of the elastic energy of one drive [J]."""
    transmission = run.assembly.transmissions[j]
    law = transmission.law
    if law is None:
        return 0.0
    theta, psi = run.motor_position[[0, -1], j], run.position[[0, -1], j]
    first, last = law.energy(law.torsion(theta, psi), theta, psi)
    return float(last - first + run.hysteresis_energy[j])


def _rigid_energies(run: Run) -> tuple[float, float]:
    """Changes of kinetic energy and of gravitational energy [J]."""
    assembly, model = run.assembly, run.assembly.model
    data, energies = mujoco.MjData(model), []
    flexible = assembly.motor_position >= 0
    for k in (0, -1):
        data.qpos[assembly.link_position] = run.position[k]
        data.qvel[assembly.link_velocity] = run.velocity[k]
        data.qpos[assembly.motor_position[flexible]] = run.motor_position[k, flexible]
        data.qvel[assembly.motor_velocity[flexible]] = run.motor_velocity[k, flexible]
        data.qpos[assembly.tilt_position] = run.tilt[k]
        data.qvel[assembly.tilt_velocity] = run.tilt_velocity[k]
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_energyVel(model, data)
        weight = -float(model.body_mass @ (data.xipos @ model.opt.gravity))
        energies.append((float(data.energy[1]), weight))
    (first_kinetic, first_weight), (last_kinetic, last_weight) = energies
    return last_kinetic - first_kinetic, last_weight - first_weight
