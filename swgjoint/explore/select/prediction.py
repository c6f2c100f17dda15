r"""Prediction of tool errors from the loads of the rigid arm.

A motor loop holds the motor angle, so that the link of joint i deviates by the torsion
under the torque of the rigid arm and by the kinematic error of its drive. The tool
deviates by

.. math:: d(t) = \sum_i J_i(t)\,\bigl(e_i(t) - \Delta_i(t)\bigr)

with the columns J of its Jacobian. The mean square of d is a quadratic form of the
drives, see :mod:`swgjoint.explore.select.search`. Friction and vibrations are left out;
simulations show the difference.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from swgjoint.drives.references import drive_of, given_drives
from swgjoint.explore.select.loads import RigidTask
from swgjoint.explore.select.options import DriveOption
from swgjoint.joint.prescribed import error_of_motor
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.assembly_steps import load_torque
from swgjoint.sim.figures.resonance import InertiaFactors
from swgjoint.sim.motion.trajectory import Trajectory
from swgjoint.sim.run import Run
from swgjoint.typing import Array

TORQUES = 40
"""Number of torques between which the torsion is interpolated."""
POSES = 400
"""Smallest number of poses, if the motion has as many samples."""
PATH, POSE = "tool_path_rms_mm", "tool_ap_mm"
TRUST_RIGID, TRUST_SIMULATED = 0.97, 0.995
"""Factors on deviations: those predicted from the rigid arm, which lack friction and
are rather too small, and those of a simulation with other drives at other joints."""
SOFT = ("linear", "native", "full", None)
"""Levels of a joint that have a torsion."""


class ToolPrediction:
    """Predicted tool errors of sets of drives, corrected by simulations.

    The deviation of a joint in a simulation replaces the predicted one of its drive.
    It includes friction and vibrations, and depends little on the other drives. All
    deviations are a little too small, so that no set is dropped too early. If the
    controller does not hold the motor angle, the deviation of a drive is zero until it
    has been simulated.

    Args:
        task: The motion of the scene, of an arm with a tool.
        options: Drives to select from, by joint.
    """

    def __init__(
        self, task: RigidTask, options: Sequence[Sequence[DriveOption]]
    ) -> None:
        path = task.trajectory
        stride = max(1, len(path.time) // POSES)
        few = path.every(stride)
        self._every = stride * task.stride
        self._columns = tool_jacobian(task.arm, few.position)
        self._first = np.cumsum([0, *map(len, options)])[:-1]
        off = _deviations(task, few, task.torque[::stride], options)
        joint = np.repeat(np.arange(len(options)), [len(own) for own in options])
        off = TRUST_RIGID * off
        self._rows = off[:, :, None] * self._columns[:, :, joint].transpose(2, 0, 1)
        self.keys: tuple[str, ...] = ()
        """Figures that can be predicted."""
        if path.answer_speed is None:
            self.keys += (PATH,)
        if path.arrival is not None and not path.visits:
            self.keys += (POSE,)
        self._forms: dict[str, Array] = {}

    def form_of(self, key: str) -> Array:
        """Quadratic form of a squared tool error over the options [m²].

        Args:
            key: One of :attr:`keys`. The pose error is that at the end of the motion.

        Returns:
            Matrix over the options of all joints in a row. Shape
            (n_options, n_options).
        """
        if key not in self._forms:
            flat = self._rows[:, -1]
            if key == PATH:
                flat = self._rows.reshape(len(self._rows), -1)
                flat = flat / np.sqrt(self._rows.shape[1])
            self._forms[key] = flat @ flat.T
        return self._forms[key]

    def learn(self, chosen: Sequence[int], run: Run) -> None:
        """Replace predicted deviations by those of a run.

        Args:
            chosen: Index of the option of every joint.
            run: Run with these drives.
        """
        off = (run.position - run.reference)[:: self._every]
        for j, option in enumerate(chosen):
            row = off[:, j, None] * self._columns[:, :, j]
            self._rows[self._first[j] + option] = TRUST_SIMULATED * row
        self._forms = {}


def _deviations(
    task: RigidTask,
    path: Trajectory,
    torque: Array,
    options: Sequence[Sequence[DriveOption]],
) -> Array:
    """Deviation of the link of every option with the motor on its command [rad].

    Returns:
        Deviations, zero if the controller holds the link angle. Shape (n_options, n).
    """
    scene, off = task.scene, []
    if scene.controller.feedback != "motor":
        return np.zeros((sum(map(len, options)), len(path.time)))
    for j, (name, own) in enumerate(zip(task.arm.joints, options, strict=True)):
        section = scene.joint_settings(name)
        for option in own:
            drive = drive_of(
                section.with_drive(option.drive),
                known=given_drives({option.drive: option.map}),
                joint=name,
            )
            one = error_of_motor(drive, drive.ratio * path.position[:, j])
            if section.level in SOFT:
                load = load_torque(scene, name, drive)
                one = one - _torsion(drive, torque[:, j] + load)
            off.append(one)
    return np.array(off)


def resonance_test(
    factors: InertiaFactors,
    soft: Array,
    stiffness: Sequence[Sequence[float]],
    limit: float,
) -> Callable[[dict[int, int]], bool]:
    """Function that tells whether drives of some joints keep the resonance high enough.

    The other joints get their stiffest drives. As no natural frequency falls with a
    stiffness, no set that meets the limit is lost.

    Args:
        factors: Inertia of the arm.
        soft: Which joints are compliant. Shape (n_joints,).
        stiffness: Mean stiffness of the options by joint [N·m/rad].
        limit: Smallest accepted frequency [Hz].
    """
    most = np.array([max(own) for own in stiffness])

    def is_possible(options: dict[int, int]) -> bool:
        springs = most.copy()
        for j, k in options.items():
            springs[j] = stiffness[j][k]
        return factors.lowest(springs[soft])[0] >= limit

    return is_possible


def tool_jacobian(arm: RigidArm, position: Array) -> Array:
    """Columns of the Jacobian of the tool position [m/rad]. Shape (n, 3, n_joints).

    Args:
        arm: Arm with a tool.
        position: Joint angles [rad]. Shape (n, n_joints).
    """
    model, data = arm.model, mujoco.MjData(arm.model)
    out = np.empty((len(position), 3, model.nv))
    one = np.empty((3, model.nv))
    for k, q in enumerate(position):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacSite(model, data, one, None, arm.tool)
        out[k] = one
    return out


def _torsion(drive: DriveMap, torque: Array) -> Array:
    """Torsion of the mean curve at several torques [rad], in the shape of torque."""
    grid = np.linspace(torque.min(), torque.max(), TORQUES)
    values = [drive.mean_torsion(float(x)) for x in grid]
    return np.asarray(np.interp(torque, grid, values))
