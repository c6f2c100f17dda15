"""Models as MJCF and URDF files describe them, with the meshes that they refer to."""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Iterable
from itertools import count
from pathlib import Path

import mujoco

from swgjoint.errors import InputError
from swgjoint.models_path import is_file
from swgjoint.sim.arm.class_names import check_class_names

MESHES = (".stl", ".obj", ".msh")
"""Mesh formats that the engine reads."""
_SHAPE_NAME = re.compile(
    r"""(<(?:visual|collision)\b[^<>]*?)\sname\s*=\s*(?:"[^"]*"|'[^']*')"""
)

_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_TEMPLATE = re.compile(rb"<xacro:|\$[{(]")
"""Text that xacro replaces. Its output keeps the namespace and a comment on xacro."""


def open_model(path: Path) -> mujoco.MjSpec:
    """Read an MJCF or URDF file; links without a joint remain separate bodies.

    Bodies, joints and keyframes without a name get one, such as ``joint_0``, and so do
    the keyframes that ``<size nkey>`` reserves, which are the reference position.
    Shapes of a URDF file do not collide, because adjacent links overlap and the format
    cannot exclude such contacts. Shapes whose mesh is missing or in a format that the
    engine does not read are dropped with a warning. Another warning names the links of
    a URDF file whose mass the engine computes from their shapes.

    Args:
        path: MJCF or URDF file; its suffix may be in upper case.

    Returns:
        The editable model.

    Raises:
        InputError: If the engine cannot read the file.
    """
    spec = _spec_of(path)
    spec.compiler.fusestatic = False
    if path.suffix.lower() == ".urdf":
        spec.compiler.discardvisual = False  # keep shapes that do not collide
        _find_meshes(spec, path)
        _warn_of_missing_masses(spec, path)
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = 0
    for _ in range(len(spec.keys), spec.nkey):
        spec.add_key()  # <size nkey> adds these when the model is compiled
    for kind, elements in (
        ("body", spec.bodies),
        ("joint", spec.joints),
        ("key", spec.keys),
    ):
        named = {element.name for element in elements}
        for k, element in enumerate(elements):
            if not element.name:
                names = (f"{kind}_{j}" for j in count(k))
                element.name = next(name for name in names if name not in named)
                named.add(element.name)
    return spec


def _spec_of(path: Path) -> mujoco.MjSpec:
    """Read a file with the engine."""
    suffix = path.suffix.lower()
    if suffix == ".xacro":
        raise InputError(
            f"{path}: a URDF template; accepted: the output of 'xacro {path.name}' in a"
            " file with the suffix .urdf"
        )
    check_class_names(path)
    try:
        if suffix not in (".urdf", ".xml"):
            return mujoco.MjSpec.from_file(str(path))
        # the engine reports every shape with the name of another one
        text = path.read_bytes().decode(errors="replace")
        text, named = _SHAPE_NAME.subn(r"\1", text)
        if not named and suffix == path.suffix:
            return mujoco.MjSpec.from_file(str(path))
        # the engine selects its reader by the suffix, in lower case only
        spec = mujoco.MjSpec.from_string(text)
        spec.modelfiledir = str(path.parent)
        return spec
    except (ValueError, OSError) as exc:
        line = " ".join(str(exc).split())
        if path.is_file() and _TEMPLATE.search(_COMMENT.sub(b"", path.read_bytes())):
            line += f"; it is a URDF template; accepted: the output of 'xacro {path}'"
        raise InputError(f"{path}: cannot be read as MJCF or URDF: {line}") from None


def _find_meshes(spec: mujoco.MjSpec, path: Path) -> None:
    """Resolve mesh paths such as ``package://``, and drop shapes without a mesh.

    A warning reports the shapes whose mesh is missing or cannot be read.
    """
    unknown: list[str] = []
    missing: list[str] = []
    for mesh in list(spec.meshes):
        file = _mesh_file(mesh.file, path.parent, spec.meshdir)
        if file is not None and file.suffix.lower() in MESHES:
            mesh.file = str(file)
            continue
        (missing if file is None else unknown).append(mesh.file)
        for geom in [g for g in spec.geoms if g.meshname == mesh.name]:
            spec.delete(geom)
        spec.delete(mesh)
    reasons = []
    if unknown:
        kinds = Counter(Path(file).suffix for file in unknown)
        counts = ", ".join(f"{n} {kind}" for kind, n in kinds.items())
        reasons.append(
            f"{counts} that the engine cannot read (accepted: {', '.join(MESHES)}), the"
            f" first is {unknown[0]}"
        )
    if missing:
        package = missing[0].partition("://")[2].partition("/")[0]
        place = (
            f" (accepted: a folder {package!r} above the file or beside a folder above)"
            if missing[0].startswith("package://")
            else ""
        )
        reasons.append(f"{len(missing)} not found, the first is {missing[0]}{place}")
    if reasons:
        warnings.warn(
            f"{path}: shapes without a usable mesh are left out: {'; '.join(reasons)}",
            stacklevel=3,
        )


def _warn_of_missing_masses(spec: mujoco.MjSpec, path: Path) -> None:
    """Warn of moving links without a mass, which the engine fills with water."""
    names: list[str] = []
    moving: set[str] = set()
    for body in spec.bodies[1:]:  # parents first
        if body.joints or body.parent.name in moving:
            moving.add(body.name)
            solid = any(geom.density > 0.0 for geom in body.geoms)
            if solid and not body.explicitinertial:
                names.append(body.name)
    if names:
        warnings.warn(
            f"{path}: the file states no mass for {', '.join(names)}; assumed: their"
            " shapes are filled with water (1000 kg/m³); accepted: <inertial> in these"
            " links",
            stacklevel=3,
        )


def _mesh_file(reference: str, folder: Path, meshdir: str) -> Path | None:
    """Path of a URDF mesh; None if it is not found."""
    for file in _places(reference, folder, meshdir):
        if is_file(file):
            return file.resolve()
    return None


def _places(reference: str, folder: Path, meshdir: str) -> Iterable[Path]:
    """Paths at which a mesh may be found, in order of decreasing likelihood."""
    scheme, colon, rest = reference.partition("://")
    if not colon:
        return [folder / meshdir / reference, folder / reference]
    if scheme != "package":
        return [Path(rest)]
    # look for the package among the parent folders of the file and their subfolders
    package, _, inside = rest.partition("/")
    above = folder.resolve()
    parents = (above, *above.parents)
    places = [
        place / inside
        for parent in parents
        for place in ((parent,) if parent.name == package else (parent / package,))
    ]
    # a copy of a part of the package still has the same folders inside
    parts = inside.split("/")
    ends = ["/".join(parts[k:]) for k in range(max(1, len(parts) - 1))]
    return [*places, *(parent / end for end in ends for parent in parents[:4])]
