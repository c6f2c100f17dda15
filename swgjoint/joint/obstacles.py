"""Checks whether a joint can take a drive, and what prevents it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

import mujoco

from swgjoint.errors import InputError
from swgjoint.maps.hysteresis import MAX_ELEMENTS

ON_JOINT = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
"""Transmissions with which an actuator acts directly on a joint."""


class Surroundings:
    """Model elements that act on the joints of a spec, read once for all drives."""

    def __init__(self, spec: mujoco.MjSpec) -> None:
        self.joints: dict[str, Any] = {j.name: j for j in spec.joints if j.name}
        bodies = list(spec.bodies)
        self.bodies: set[str] = {body.name for body in bodies}
        self.gravcomp = any(body.gravcomp for body in bodies)
        self.plugins: set[str] = {instance.name for instance in spec.plugins}
        self.tendons: dict[str, Any] = {}
        self.wrapped: dict[str, list[str]] = {}
        """Joint names of the fixed tendons, by tendon."""
        for tendon in spec.tendons:
            self.tendons[tendon.name] = tendon
            path = tendon.path
            # by index: iteration ends with an engine exception, which costs 0.1 ms
            wraps = (path[k] for k in range(len(path)))
            self.wrapped[tendon.name] = [
                wrap.target.name
                for wrap in wraps
                if wrap.type == mujoco.mjtWrap.mjWRAP_JOINT
            ]
        self.actuators: dict[str, dict[int, Any]] = defaultdict(dict)
        """Actuators that act on a joint, by joint and then by index in the model."""
        self.pulled: dict[str, tuple[Any, str]] = {}
        """Actuator and tendon that move a joint, by joint."""
        self.held: dict[str, str] = {}
        """Reason why an equality constrains a joint, by joint."""
        self.sensors: dict[str, list[Any]] = defaultdict(list)
        """Sensors of the actuator torque at a joint, by joint."""
        self.measured: set[str] = set()
        """Names of the actuators whose force a sensor reads."""
        for k, actuator in enumerate(spec.actuators):
            if actuator.trntype in ON_JOINT:
                self.actuators[actuator.target][k] = actuator
            elif actuator.trntype == mujoco.mjtTrn.mjTRN_TENDON:
                for joint in self.wrapped.get(actuator.target, ()):
                    self.pulled.setdefault(joint, (actuator, actuator.target))
        for equality in spec.equalities:
            self._hold(equality)
        for sensor in spec.sensors:
            if sensor.type == mujoco.mjtSensor.mjSENS_JOINTACTFRC:
                self.sensors[sensor.objname].append(sensor)
            elif sensor.type == mujoco.mjtSensor.mjSENS_ACTUATORFRC:
                self.measured.add(sensor.objname)

    def _hold(self, equality: Any) -> None:
        if not equality.active:
            return
        if equality.type == mujoco.mjtEq.mjEQ_JOINT:
            name = equality.name1
            does = f"follows {equality.name2!r}" if equality.name2 else "is locked"
            why = (
                f"joint {name!r} {does} through {_named(equality)}, which would oppose"
                " a drive; accepted: the joint that leads, or an equality that is not"
                " active"
            )
            self.held.setdefault(name, why)
        if equality.type == mujoco.mjtEq.mjEQ_TENDON:
            for end in (equality.name1, equality.name2):
                for name in self.wrapped.get(end, ()) if end else ():
                    why = (
                        f"joint {name!r} is constrained by {_named(equality)} of"
                        f" tendon {end!r}, which would oppose a drive; accepted: an"
                        " equality that is not active"
                    )
                    self.held.setdefault(name, why)

    def nearest_names(self, name: str, joints: Iterable[str] | None = None) -> str:
        """Text for messages that lists the joints of the model.

        If there are more than 20, only those with similar names are listed, if any.

        Args:
            name: Name that was not found.
            joints: Names to list; all joints of the model if None.
        """
        names = list(self.joints if joints is None else joints)
        if len(names) > 20:
            near = get_close_matches(name, names, n=5, cutoff=0.3)
            if near:
                return f"nearest of its {len(names)} joints: {', '.join(near)}"
        return f"its joints: {', '.join(names) or 'none'}"

    def has_drive(self, joint: str) -> bool:
        """Whether a tendon of :func:`attach` couples the joint to its rotor."""
        return {f"{joint}_rotor", joint} == set(self.wrapped.get(f"{joint}_drive", ()))

    def is_rotor(self, joint: str) -> bool:
        """Whether the joint is the rotor of a drive."""
        link = joint.removesuffix("_rotor")
        return link != joint and self.has_drive(link)

    def driven_joint(self, name: str) -> Any:
        """The hinge with this name, if it can take a drive.

        Raises:
            InputError: If there is no such hinge, or another element of the model
                constrains or drives it.
        """
        hinge = self.joints.get(name)
        if hinge is None:
            raise InputError(
                f"joint {name!r} is not in the model; {self.nearest_names(name)}"
            )
        if hinge.type != mujoco.mjtJoint.mjJNT_HINGE:
            kind = mujoco.mjtJoint(hinge.type).name.removeprefix("mjJNT_").lower()
            raise InputError(f"joint {name!r} is a {kind} joint; a drive needs a hinge")
        self._check_driven(name)
        self._check_names(name)
        body = hinge.parent
        if body.joints[0].name != name:
            raise InputError(
                f"joint {name!r} is not the first joint of body {body.name!r};"
                " accepted: a body of its own for it, or no drive (option --joints)"
            )
        if hinge.actgravcomp and self.gravcomp:
            raise InputError(
                f"joint {name!r} has actuatorgravcomp, a torque that acts on the link"
                " and bypasses the drive; accepted: false"
            )
        if name in self.held:
            raise InputError(self.held[name])
        self._check_actuators(name)
        return hinge

    def _check_driven(self, name: str) -> None:
        if self.has_drive(name):
            raise InputError(f"joint {name!r} already has a drive")
        if self.is_rotor(name):
            raise InputError(
                f"joint {name!r} is the rotor of a drive; the joint of its link,"
                f" {name.removesuffix('_rotor')!r}, already has this drive"
            )

    def _check_names(self, name: str) -> None:
        rotor, drive = f"{name}_rotor", f"{name}_drive"
        taken = [
            ("body", rotor, rotor in self.bodies),
            ("joint", rotor, rotor in self.joints),
            ("plugin instance", drive, drive in self.plugins),
            *(
                ("tendon", tendon, tendon in self.tendons)
                for tendon in (drive, f"{name}_friction")
            ),
            *(
                ("tendon", tendon, True)
                for k in range(MAX_ELEMENTS)
                if (tendon := f"{name}_hysteresis{k}") in self.tendons
            ),
        ]
        for kind, element, is_taken in taken:
            if is_taken:
                raise InputError(
                    f"joint {name!r}: its drive needs the name {element!r}, which a"
                    f" {kind} of the model already has; rename this {kind}"
                )

    def _check_actuators(self, name: str) -> None:
        for actuator in self.actuators.get(name, {}).values():
            if actuator.dyntype == mujoco.mjtDyn.mjDYN_MUSCLE:
                raise InputError(
                    f"joint {name!r} is moved by muscle {actuator.name!r}, which is not"
                    " a motor; accepted: another type of actuator, or none"
                )
        if name in self.pulled:
            actuator, tendon = self.pulled[name]
            raise InputError(
                f"joint {name!r} is moved by actuator {actuator.name!r} through tendon"
                f" {tendon!r}, which would bypass a drive; accepted: an actuator on the"
                " joint"
            )


def _named(equality: Any) -> str:
    return f"equality {equality.name!r}" if equality.name else "an unnamed equality"
