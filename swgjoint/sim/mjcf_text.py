"""MJCF text of a model with drives at level ``native``, and the files it refers to."""

from __future__ import annotations

import hashlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import InputError
from swgjoint.files import file_name, read_regular
from swgjoint.joint.drive import JointDrive

_SIDES = ("right", "left", "up", "down", "front", "back")
_FILES = ("file", *(f"file{side}" for side in _SIDES))
"""Attributes of assets that name a file."""
_SECTIONS = ("asset", "deformable")
"""Sections whose elements name files: skins are in the second one."""
_OF_TEXTURES = ("texture",)
"""Assets that the engine looks up in its folder of textures."""


def model_text(
    spec: mujoco.MjSpec, drives: Mapping[str, JointDrive], *, folder: str
) -> tuple[str, dict[str, bytes]]:
    """MJCF text of a model, with the numbers of its drives in full precision.

    MuJoCo writes six digits, so that a ratio such as 1/60 would let the link drift from
    the motor by 0.04 arcmin per output turn.

    Args:
        spec: The model; it is compiled.
        drives: Its drives at level ``native``, by joint name.
        folder: Folder of the files to which the text refers, relative to its own file.

    Returns:
        The text, and the content of all files by name in ``folder``. Files of equal
        content appear once.

    Raises:
        InputError: If the engine rejects the model, or a file cannot be read.
    """
    try:
        model = spec.compile()
        root = ElementTree.fromstring(spec.to_xml())
    except (ValueError, ElementTree.ParseError) as exc:
        line = " ".join(str(exc).split())
        raise InputError(f"MuJoCo cannot write the model: {line}") from None
    try:
        _write_exactly(root, spec, model, drives)
    except KeyError as exc:  # XML turns line breaks in an attribute into spaces
        kind, name = exc.args[0]
        raise InputError(
            f"{kind} {name!r:.60}: MJCF cannot state this name; accepted: no line"
            " breaks or tabs"
        ) from None
    files = _collect_files(root, spec, folder)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n", files


def _write_exactly(
    root: ElementTree.Element,
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    drives: Mapping[str, JointDrive],
) -> None:
    """Replace the numbers of rotors, tendons and motors by those of the spec."""
    elements = {
        (element.tag, element.get("name")): element
        for element in root.iter()
        if element.get("name")
    }
    actuators = {a.name: a for a in spec.actuators}
    for drive in drives.values():
        assert drive.rotor is not None and drive.tendon is not None
        hinge = spec.joint(drive.rotor)
        joint = elements["joint", drive.rotor]
        for key in ("armature", "frictionloss"):
            if getattr(hinge, key):
                joint.set(key, _text(getattr(hinge, key)))
        if hinge.damping[0]:
            joint.set("damping", _text(hinge.damping[0]))
        for name in (drive.rotor, drive.joint) if hinge.ref else ():
            elements["joint", name].set("ref", _text(model.joint(name).qpos0))
        for name in (drive.tendon, *drive.corners, *drive.hysteresis):
            tendon, fixed = spec.tendon(name), elements["fixed", name]
            stiffness = np.trim_zeros(tendon.stiffness, "b")
            fixed.set("stiffness", _text(stiffness))
            if tendon.damping[0]:
                fixed.set("damping", _text(tendon.damping[0]))
            if tendon.springyield:
                fixed.set("springyield", _text(tendon.springyield))
            fixed.set("springlength", _text(tendon.springlength))
            for part in fixed:
                by_rotor = part.get("joint") == drive.rotor
                part.set("coef", _text(1.0 / drive.ratio if by_rotor else -1.0))
        for name, actuator in actuators.items():
            if actuator.target == drive.rotor and name:
                for element in root.iterfind(f"actuator/*[@name='{name}']"):
                    element.set("gear", _text(np.trim_zeros(actuator.gear, "b")))
    for key in spec.keys:
        # rounded angles would be a torsion, because the rotor turns i times as far
        for field in ("qpos", "qvel"):
            if ("key", key.name) in elements and len(getattr(key, field)):
                elements["key", key.name].set(field, _text(getattr(key, field)))


def _text(values: ArrayLike) -> str:
    """Numbers with all their digits."""
    return " ".join(repr(float(value) + 0.0) for value in np.atleast_1d(values))


def _collect_files(
    root: ElementTree.Element, spec: mujoco.MjSpec, folder: str
) -> dict[str, bytes]:
    """Content of all files of assets and skins, which then refer to ``folder``."""
    compiler = root.find("compiler")
    base = Path(spec.modelfiledir)
    named = {"meshdir": spec.meshdir, "texturedir": spec.texturedir}
    if compiler is not None:
        for key in (*named, "assetdir", "strippath"):
            compiler.attrib.pop(key, None)
    files: dict[str, bytes] = {}
    sections = (section for tag in _SECTIONS for section in root.iterfind(tag))
    for asset in (part for section in sections for part in section):
        key = "texturedir" if asset.tag in _OF_TEXTURES else "meshdir"
        for attribute in _FILES:
            reference = asset.get(attribute)
            if not reference:
                continue
            path = base / named[key] / reference
            content = _content(path)
            digest = hashlib.sha256(content).hexdigest()[:8]
            name = f"{file_name(path.stem)}-{digest}{path.suffix}"
            files[name] = content
            if not asset.get("name") and attribute == "file":
                asset.set("name", path.stem)  # the name that the file gave it
            asset.set(attribute, f"{folder}/{name}")
    return files


def _content(path: Path) -> bytes:
    try:
        return read_regular(path)
    except OSError as exc:
        raise InputError(
            f"{path}: cannot be read: {exc.strerror or exc}; the model refers to it"
        ) from None
