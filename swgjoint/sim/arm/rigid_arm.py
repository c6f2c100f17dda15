"""An arm without drives: torques, inertia and poses on a commanded motion."""

from __future__ import annotations

import warnings
from copy import copy
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from swgjoint.errors import InputError
from swgjoint.models_path import find
from swgjoint.sim.arm.compiling import compile_spec as compile_spec
from swgjoint.sim.arm.compiling import skeleton
from swgjoint.sim.arm.file import read_arm
from swgjoint.sim.arm.number_checks import check_numbers
from swgjoint.sim.arm.reading import ArmReading
from swgjoint.typing import Array


class RigidArm:
    """An MJCF or URDF arm with ideal joints, the reference for control and errors.

    Arms can be pickled. As MuJoCo's editable models cannot, :meth:`spec` of an
    unpickled arm reads the file again.

    Attributes:
        reference: Path or bundled name of the arm, as passed.
        path: File of the arm.
        reading: Hinges that move, and pose of held joints.
        model: The compiled arm, see :class:`~swgjoint.sim.arm.file.ArmFile`.
        joints: Names of its joints, in the order of all arrays.
        tool: Index of the tool site in the model, -1 without one.
        held: Joints of the file that do not move, each with the reason: its type, what
            ties it, or that it has no drive.
        keyframes: Named poses of the file: angles of all hinges, including held ones
            [rad].
        effort: Torque limits of the joints for which the file states one [N·m].
    """

    def __init__(
        self,
        reference: str,
        *,
        tool_site: str = "tool",
        reading: ArmReading | None = None,
        kinematics_only: bool = False,
    ) -> None:
        """Load an arm.

        Args:
            reference: Path or bundled name.
            tool_site: Site at the tool, or a body whose frame is the tool frame.
            reading: Hinges that move, and pose of held joints; None moves every hinge.
            kinematics_only: Whether shapes are left out and masses are meaningless, as
                for the poses of an arm whose massless links may be held.

        Raises:
            InputError: If the file is missing, is neither MJCF nor URDF, has no hinge,
                or lacks the tool site.
        """
        self.reference = reference
        self.path: Path = find(reference, "arms", ".xml", what="arm")
        self.reading = reading or ArmReading()
        file = read_arm(self.path, self.reading)
        self.held, self.effort = file.held, file.effort
        self.keyframes = file.keyframes
        self._spec, self._tool_site = file.spec, tool_site
        self._mark_tool(tool_site)
        if not self._spec.joints:
            others = ", ".join(f"{name} is a {why}" for name, why in self.held.items())
            raise InputError(
                f"{self.path}: the arm has no hinge joint"
                f"{f' ({others})' if others else ''}; a drive needs one"
            )
        compiled = skeleton if kinematics_only else compile_spec
        self.model = compiled(self.spec(), where=str(self.path))
        check_numbers(self.model, where=str(self.path))
        model = self.model
        self.joints = tuple(model.joint(j).name for j in range(model.njnt))
        self.tool = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, tool_site)
        self._data = mujoco.MjData(model)

    def spec(self) -> mujoco.MjSpec:
        """A fresh editable copy of the arm."""
        if "_spec" not in vars(self):
            self._spec = read_arm(self.path, self.reading).spec
            self._mark_tool(self._tool_site)
        return self._spec.copy()

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the editable model and what is made on first use."""
        left_out = ("_spec", "_probe", "_probe_data")
        return {key: one for key, one in vars(self).items() if key not in left_out}

    @property
    def ends(self) -> list[str]:
        """Ends of the arm, the most likely tool first.

        The tool is the last body of the longest chain of links. Links that fewer joints
        move, such as a camera on a column, do not count; a chain may lack one joint,
        which may be that of a jaw. The other ends are those of chains of equal length
        and of chains with all joints, one for bodies with the same parent.
        """
        model = self.model
        moving, depth = np.zeros((2, model.nbody), dtype=int)
        for body in range(1, model.nbody):
            parent = model.body_parentid[body]
            moving[body] = moving[parent] + model.body_jntnum[body]
            depth[body] = depth[parent] + 1
        most = moving.max()
        reach = np.where(moving >= max(1, most - 1), depth, 0)
        # the last body of everything that moves as one
        welded = model.body_weldid
        last = [int((reach * (welded == k)).argmax()) for k in set(welded[reach > 0])]
        last.sort(key=lambda body: (-reach[body], body))
        found: dict[int, int] = {}
        for body in last:
            if reach[body] == reach.max() or moving[body] == most:
                found.setdefault(int(model.body_parentid[body]), body)
        kind = mujoco.mjtObj.mjOBJ_BODY
        return [mujoco.mj_id2name(model, kind, body) for body in found.values()]

    def without_tool(self) -> RigidArm:
        """This arm, whose tool positions are not computed."""
        bare = copy(self)
        vars(bare).update(vars(self))  # the editable model, which copies leave out
        bare.tool = -1
        return bare

    def _mark_tool(self, name: str) -> None:
        """Add a tool site if the name denotes a body instead of a site."""
        spec = self._spec
        if spec.site(name) is not None:
            return
        body = spec.body(name)
        if body is not None:
            body.add_site(name=name)
        elif name != "tool":
            known = [e.name for e in [*spec.sites, *spec.bodies[1:]] if e.name]
            raise InputError(
                f"{self.path}: site {name!r} does not exist; accepted:"
                f" {', '.join(known) or 'none in this arm'}"
            )

    def torques(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Joint torques of a motion by inverse dynamics, gravity included [N·m].

        Args:
            position: Joint angles [rad]. Shape (n, n_joints).
            velocity: Joint speeds [rad/s]. Shape (n, n_joints).
            acceleration: Joint accelerations [rad/s²]. Shape (n, n_joints).

        Returns:
            Joint torques. Shape (n, n_joints).
        """
        model, data, out, touching = self.model, self._data, np.empty_like(position), ""
        # look up the arrays once, because an attribute lookup takes as long as a copy
        qpos, qvel, qacc, needed = data.qpos, data.qvel, data.qacc, data.qfrc_inverse
        motion = zip(position, velocity, acceleration, strict=True)
        for k, (q, v, a) in enumerate(motion):
            qpos[:], qvel[:], qacc[:] = q, v, a
            mujoco.mj_inverse(model, data)
            out[k] = needed
            if data.ncon and not touching:
                bodies = model.geom_bodyid[data.contact.geom[0]]
                names = sorted(model.body(b).name for b in bodies)
                touching = " and ".join(map(repr, names))
        if touching:
            warnings.warn(
                f"{self.path}: bodies {touching} touch on the commanded motion and push"
                " each other; if this is not intended, add an <exclude> of the pair or"
                " set contype and conaffinity of their geoms to 0",
                stacklevel=1,  # one warning for all callers
            )
        return out

    def gravity(self, position: Array) -> Array:
        """Joint torques that carry the weight at rest [N·m]. Shape (n, n_joints).

        Args:
            position: Joint angles [rad]. Shape (n, n_joints).
        """
        zero = np.zeros_like(position)
        return self.torques(position, zero, zero)

    def contacts(
        self, position: Array, *, within: float = 0.0
    ) -> list[tuple[str, str, float]]:
        """Pairs of bodies that touch on a motion, the deepest first.

        Args:
            position: Joint angles [rad]. Shape (n, n_joints).
            within: Distance below which bodies count as touching [m].

        Returns:
            Names of two bodies and their largest penetration [m], which is negative for
            a distance. Pairs that the model excludes from contact are omitted.
        """
        model, data = self._probe, self._probe_data
        model.geom_margin[:] = np.maximum(self.model.geom_margin, within)
        model.pair_margin[:] = np.maximum(self.model.pair_margin, within)
        deepest: dict[tuple[int, int], float] = {}
        for q in position:
            data.qpos[:] = q
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            contact = data.contact
            near = contact.dist < within
            bodies = np.sort(model.geom_bodyid[contact.geom[near]], axis=1)
            for (a, b), distance in zip(bodies, contact.dist[near], strict=True):
                pair = (int(a), int(b))
                deepest[pair] = max(deepest.get(pair, -np.inf), -float(distance))
        pairs = [
            (model.body(a).name, model.body(b).name, depth)
            for (a, b), depth in deepest.items()
        ]
        return sorted(pairs, key=lambda pair: -pair[2])

    @cached_property
    def _probe(self) -> mujoco.MjModel:
        """Copy of the model in which :meth:`contacts` can change the margins."""
        return copy(self.model)

    @cached_property
    def _probe_data(self) -> mujoco.MjData:
        return mujoco.MjData(self._probe)

    def inertia(self, position: Array) -> Array:
        """Inertia about every joint, the others locked [kg·m²]. Shape (n_joints,).

        Args:
            position: Joint angles [rad]. Shape (n_joints,).
        """
        data, nv = self._data, self.model.nv
        data.qpos[:], data.qvel[:] = position, 0.0
        mujoco.mj_forward(self.model, data)
        full = np.zeros((nv, nv))
        mujoco.mj_fullM(self.model, data, full)
        return np.diag(full).copy()

    def tool_positions(self, position: Array) -> Array:
        """Tool positions in the world [m]. Shape (n, 3), or (n, 0) without a tool.

        Args:
            position: Joint angles [rad]. Shape (n, n_joints).
        """
        if self.tool < 0:
            return np.empty((len(position), 0))
        model, data, out = self.model, self._data, np.empty((len(position), 3))
        qpos, place = data.qpos, data.site_xpos[self.tool]  # as in torques
        for k, q in enumerate(position):
            qpos[:] = q
            mujoco.mj_kinematics(model, data)
            out[k] = place
        return out

    def body_poses(self, position: Array) -> tuple[Array, Array]:
        """Poses of all bodies in the world frame.

        Args:
            position: Joint angles [rad]. Shape (n, n_joints).

        Returns:
            Positions [m], shape (n, n_bodies, 3), and unit quaternions (w, x, y, z),
            shape (n, n_bodies, 4); the world is the first body.
        """
        model, data, count = self.model, self._data, len(position)
        places = np.empty((count, model.nbody, 3))
        turns = np.empty((count, model.nbody, 4))
        qpos, xpos, xquat = data.qpos, data.xpos, data.xquat  # as in torques
        for k, q in enumerate(position):
            qpos[:] = q
            mujoco.mj_kinematics(model, data)
            places[k], turns[k] = xpos, xquat
        return places, turns
