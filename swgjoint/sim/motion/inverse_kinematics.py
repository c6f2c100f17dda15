r"""Joint angles that move the tool along a path, by damped least squares.

With the Jacobian J and the pose error e of the tool, an iteration changes the joint
angles by

.. math:: \Delta q = J^T (J J^T + \lambda^2 I)^{-1} e, \qquad \lambda = c\,|e|.

The damping vanishes with the error, so that the last iterations are Newton steps. Each
solution starts from the previous one, which keeps the arm in one configuration. A
quintic spline through the solutions is refined until the tool also follows the path
between them; its derivatives give the joint speeds and accelerations.

Source:
    Wampler (1986), "Manipulator inverse kinematic solutions based on vector
    formulations and damped least-squares methods", IEEE Transactions on Systems, Man,
    and Cybernetics 16:93-101, with constant :math:`\lambda`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from swgjoint.errors import InputError
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.typing import Array
from swgjoint.units import mm

TOLERANCE = 1e-12
"""Largest error of a solution: joint norm of position [m] and rotation [rad] errors."""
PATH_TOLERANCE = 1e-10
"""Largest error of any tool coordinate midway between two solutions [m]."""
DAMPING = 0.1
"""Ratio c of the damping to the norm of the error [-]."""
MAX_STEPS = 200
"""Largest number of iterations per pose."""
MAX_NODES = 8192
"""Number of solutions along a path above which the refinement stops."""
LONGEST_STEP = 0.2
"""Largest change of a joint angle per iteration [rad]."""


class ToolKinematics:
    """Forward and inverse kinematics of the tool site of one arm."""

    def __init__(self, arm: RigidArm, *, hold_orientation: bool, where: str) -> None:
        """Prepare the kinematics of an arm.

        Args:
            arm: The arm, which must have a tool site.
            hold_orientation: Whether the tool keeps its orientation.
            where: Start of the messages.

        Raises:
            InputError: If the arm has no tool site.
        """
        if arm.tool < 0:
            raise InputError(
                f"{where}: arm {arm.path.stem!r} has no site for the tool, which this"
                " trajectory needs; accepted: the name of a site or body in tool_site"
            )
        self.arm, self.where = arm, where
        self.rows = 6 if hold_orientation else 3
        self._data = mujoco.MjData(arm.model)

    def pose(self, q: Array) -> tuple[Array, Array]:
        """Tool position [m], shape (3,), and rotation matrix by rows, shape (9,).

        Args:
            q: Joint angles [rad]. Shape (n_joints,).
        """
        data = self._data
        data.qpos[:] = q
        mujoco.mj_kinematics(self.arm.model, data)
        return (
            data.site_xpos[self.arm.tool].copy(),
            data.site_xmat[self.arm.tool].copy(),
        )

    def solve(self, guess: Array, position: Array, rotation: Array) -> Array:
        """Joint angles at which the tool has a pose.

        Args:
            guess: Joint angles near the solution [rad]. Shape (n_joints,).
            position: Position of the tool [m]. Shape (3,).
            rotation: Rotation matrix of the tool by rows; unused if the orientation is
                free. Shape (9,).

        Returns:
            Joint angles [rad]. Shape (n_joints,).

        Raises:
            InputError: If the tool cannot reach the pose, or the arm is singular.
        """
        model, data, tool = self.arm.model, self._data, self.arm.tool
        q, jacobian = guess.copy(), np.zeros((6, model.nv))
        goal, turn = np.zeros(4), np.zeros(3)
        mujoco.mju_mat2Quat(goal, rotation)
        here, best, waited = np.zeros(4), np.inf, 0
        for _ in range(MAX_STEPS):
            self.pose(q)
            mujoco.mj_comPos(model, data)
            mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], tool)
            mujoco.mju_mat2Quat(here, data.site_xmat[tool])
            mujoco.mju_subQuat(turn, goal, here)  # in the frame of the tool
            about = data.site_xmat[tool].reshape(3, 3) @ turn
            error = np.concatenate([position - data.site_xpos[tool], about])
            error, J = error[: self.rows], jacobian[: self.rows]
            size = float(np.linalg.norm(error))
            if size <= TOLERANCE:
                return q
            waited = 0 if size < 0.99 * best else waited + 1
            best = min(best, size)
            if waited > 20:
                break
            damped = J @ J.T + (DAMPING * size) ** 2 * np.eye(self.rows)
            try:
                step = J.T @ np.linalg.solve(damped, error)
            except np.linalg.LinAlgError:  # even the damping is below round-off
                raise InputError(
                    f"{self.where}: the arm is in a singular pose where the tool passes"
                    f" ({_in_mm(position)}) mm; accepted: a path away from it, or"
                    " another start_deg"
                ) from None
            q += step * min(1.0, LONGEST_STEP / max(np.abs(step).max(), 1e-300))
        off = float(np.linalg.norm(error[:3])) / mm
        raise InputError(
            f"{self.where}: the tool cannot reach ({_in_mm(position)}) mm"
            f"{' in its orientation' if self.rows == 6 else ''}: {off:.3g} mm short;"
            " accepted: a path within reach of the arm from start_deg"
        )


def follow(
    kinematics: ToolKinematics,
    start: Array,
    place: Callable[[Array], Array],
    *,
    length: float,
    nodes: int = 32,
) -> Any:
    """Joint angles at which the tool follows a path in its initial orientation.

    Args:
        kinematics: Kinematics of the tool.
        start: Joint angles at the start of the path [rad]. Shape (n_joints,).
        place: Function that returns the points of the path [m], shape (m, 3), at
            values of the path parameter, shape (m,).
        length: Largest value of the parameter; the smallest is zero.
        nodes: Number of intervals between the solutions of the first attempt.

    Returns:
        A spline that returns joint angles [rad], shape (m, n_joints), at values of the
        parameter, shape (m,).

    Raises:
        InputError: If the tool cannot reach the path, leaves the range of a joint, or
            passes a singular pose.
    """
    from scipy.interpolate import make_interp_spline

    _, rotation = kinematics.pose(start)
    s = np.linspace(0.0, length, nodes + 1)
    while True:
        q = np.empty((s.size, start.size))
        guess = start
        for k, point in enumerate(place(s)):
            q[k] = guess = kinematics.solve(guess, point, rotation)
        spline = make_interp_spline(s, q, k=5)
        middle = 0.5 * (s[1:] + s[:-1])
        off = kinematics.arm.tool_positions(np.asarray(spline(middle))) - place(middle)
        if np.abs(off).max() <= PATH_TOLERANCE:
            break
        if s.size > MAX_NODES:
            worst = place(middle)[int(np.abs(off).max(axis=1).argmax())]
            raise InputError(
                f"{kinematics.where}: the joints jump where the tool passes"
                f" ({_in_mm(worst)}) mm, a singular pose;"
                " accepted: a path away from it"
            )
        s = np.linspace(0.0, length, 2 * (s.size - 1) + 1)
    _check_limits(kinematics, q)
    return spline


def _check_limits(kinematics: ToolKinematics, q: Array) -> None:
    """Reject a path that leaves the range of a joint."""
    model = kinematics.arm.model
    for j, name in enumerate(kinematics.arm.joints):
        low, high = model.jnt_range[j]
        if model.jnt_limited[j] and (q[:, j].min() < low or q[:, j].max() > high):
            reached = np.rad2deg([q[:, j].min(), q[:, j].max()])
            limits = np.rad2deg([low, high])
            raise InputError(
                f"{kinematics.where}: {name} would go from {reached[0]:.4g} to"
                f" {reached[1]:.4g} deg; accepted: {limits[0]:.4g} to"
                f" {limits[1]:.4g} deg"
            )


def _in_mm(point: Array) -> str:
    """Coordinates in mm, as text for a message."""
    return ", ".join(f"{x / mm:.4g}" for x in point)
