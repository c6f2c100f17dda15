"""Make the robot files of this folder from those of their makers, without meshes.

Run it as ``python tests/robots/strip.py PACKAGES [NAME ...]``. ``PACKAGES`` is a folder
with the unpacked distributions that ``manifest.toml`` names, each in a folder
``<package>-<version>``. Every robot of the manifest (or those named) is written to
``models/<name>/``, with the licence and a file ``SOURCE``.

MJCF: included files are written in place. A mesh that collides becomes the box or
capsule with the inertia of the mesh, smaller where it would touch at the reference
position or at a keyframe a body that the original does not touch; a mesh that is only
seen goes, and so does one that the distribution downloads later. Inertia that came from
meshes becomes an explicit ``<inertial>``. Assets that are files go. URDF: shapes that
are meshes go; the format states the inertia. All else is as its maker wrote it. Every
MJCF file is compared with its original: the same numbers of all elements, mass matrix
and bias forces within 1e-6 at random states.
"""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Iterable
from copy import deepcopy
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

HERE = Path(__file__).parent
MARK = "_unnamed_"
"""Prefix of the names that elements have only while the original is compiled."""
SHRINK = 0.85
SLENDER = 1.6
"""Longest to middle side from which on a mesh becomes a capsule."""
PLACED = ("pos", "quat", "euler", "axisangle", "xyaxes", "zaxis", "fromto")
COUNTS = ("nq", "nv", "nu", "na", "nkey", "neq", "ntendon", "nsensor", "nexclude")
TOLERANCE = 1e-6
HAND = "right_hand"
"""Body of an arm that carries its hand."""
MESHES_REPLACED = (
    "included files written in place, meshes replaced by boxes and capsules"
)

Element = ElementTree.Element


def main() -> None:
    """Write the robots of the manifest."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("packages", type=Path)
    parser.add_argument("names", nargs="*")
    args = parser.parse_args()
    manifest = tomllib.loads((HERE / "manifest.toml").read_text())
    for robot in manifest["robot"]:
        if not args.names or robot["name"] in args.names:
            make(robot, args.packages)


def make(robot: dict[str, Any], packages: Path) -> None:
    """Write one robot, its licence and where it comes from."""
    folder = HERE / "models" / robot["name"]
    folder.mkdir(parents=True, exist_ok=True)
    package = packages / f"{robot['package']}-{robot['version']}"
    source, target = package / robot["path"], folder / robot["file"]
    if target.suffix.lower() == ".urdf":
        tree, what = strip_urdf(source), "shapes that are meshes removed"
    else:
        hand = package / robot["hand"] if "hand" in robot else None
        tree, original = strip_mjcf(source, hand)
        what = MESHES_REPLACED
        if hand is not None:
            what = f"{hand.name} put on body {HAND!r}, {what}"
    note = f" Changed from {source.name} of {robot['package']}: {what}. "
    comment = ElementTree.Comment(note)
    comment.tail = tree.getroot().text
    tree.getroot().insert(0, comment)
    tree.write(target, encoding="unicode")
    if target.suffix.lower() == ".xml":
        compare(original, target)
    texts = [(packages / file).read_text() for file in robot["licence_files"]]
    (folder / "LICENSE").write_text("\n".join(texts))
    (folder / "SOURCE").write_text(
        f"{robot['package']} {robot['version']} (PyPI)\n{robot['path']}\n"
        f"{robot['licence']}\nchanged: {what}, see strip.py\n"
    )
    print(f"{robot['name']}: {target.stat().st_size / 1024:.0f} KiB")


def parse(path: Path) -> ElementTree.ElementTree:
    """Read XML with its comments."""
    builder = ElementTree.TreeBuilder(insert_comments=True)
    return ElementTree.parse(path, ElementTree.XMLParser(target=builder))


def strip_urdf(path: Path) -> ElementTree.ElementTree:
    """The file without shapes that are meshes."""
    tree = parse(path)
    for link in tree.getroot().iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            if shape.find("geometry/mesh") is not None:
                link.remove(shape)
    return tree


def strip_mjcf(
    path: Path, hand: Path | None = None
) -> tuple[ElementTree.ElementTree, mujoco.MjModel]:
    """The file with primitives in place of meshes, and the model of the original."""
    root = inlined(path)
    if hand is not None:
        mount(root, hand)
    tree = ElementTree.ElementTree(root)
    drop_pictures(root)
    absent = stand_ins(root, path)
    mark(root)
    original = compiled(root, path)
    shapes = {g.get("name", ""): g for g in geoms(root) if is_mesh(g, original)}
    asked = referenced(root)
    kept, gone = {}, {}
    for name, geom in shapes.items():
        found = original.geom(name)
        seen = not (found.contype[0] or found.conaffinity[0])
        heights = found.type[0] == mujoco.mjtGeom.mjGEOM_HFIELD
        lost = heights or geom.get("mesh") in absent or (seen and name not in asked)
        (gone if lost else kept)[name] = geom
    boxes = fitted(root, path, kept.values(), "box")
    capsules = fitted(root, path, kept.values(), "capsule")

    add_inertials(root, original, shapes.values(), absent)
    parents = {child: parent for parent in root.iter() for child in parent}
    for geom in gone.values():
        parents[geom].remove(geom)
    for name, geom in kept.items():
        long, middle, _ = np.sort(boxes.geom(name).size)[::-1]
        place(geom, capsules if long > SLENDER * middle else boxes, name)
    drop_shapes(root)
    clear(root, path, original, kept)
    for element in root.iter():
        if element.get("name", "").startswith(MARK):
            del element.attrib["name"]
    return tree, original


def inlined(path: Path, folder: Path | None = None) -> Element:
    """The root of a file with what it includes in place."""
    folder = folder or path.parent
    root = parse(path).getroot()
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag == "include":
                k = list(parent).index(child)
                parent.remove(child)
                for inner in reversed(
                    list(inlined(folder / child.attrib["file"], folder))
                ):
                    parent.insert(k, inner)
    return root


def mount(root: Element, hand: Path) -> None:
    """Put a hand, a file of its own, on an arm, as its maker does when it is used."""
    known = {(e.tag, e.get("name")) for e in root.iter() if e.get("name")}
    for section in inlined(hand):
        for parent in list(section.iter()):
            for child in list(parent):  # materials and marks that both files have
                if (child.tag, child.get("name")) in known:
                    parent.remove(child)
        for default in section.iter("default"):
            default.attrib.pop("group", None)  # which the schema does not know
        for mesh in section.findall("mesh"):
            mesh.set("file", str((hand.parent / mesh.attrib["file"]).resolve()))
        if section.tag == "worldbody":
            next(b for b in root.iter("body") if b.get("name") == HAND).extend(section)
        elif section.tag not in ("compiler", "option"):
            root.append(section)


def geoms(root: Element) -> Iterable[Element]:
    """Geoms of bodies, none of a class."""
    for world in root.iter("worldbody"):
        yield from world.iter("geom")


def stand_ins(root: Element, path: Path) -> set[str]:
    """Put a small tetrahedron in place of meshes that the distribution lacks."""
    folder = path.parent
    for compiler in root.iter("compiler"):
        folder = path.parent / (compiler.get("meshdir") or compiler.get("assetdir", ""))
    absent = set()
    for asset in root.iter("asset"):
        for mesh in asset.findall("mesh"):
            file = mesh.get("file")
            if file and not (folder / file).exists():
                mesh.set("name", mesh.get("name") or Path(file).stem)
                absent.add(mesh.attrib["name"])
                for key in ("file", "scale", "inertia"):
                    mesh.attrib.pop(key, None)
                mesh.set("vertex", "0 0 0 .1 0 0 0 .1 0 0 0 .1")
    return absent


def mark(root: Element) -> None:
    """Give every body and geom a name."""
    everything = [e for world in root.iter("worldbody") for e in world.iter()]
    for k, element in enumerate(everything):
        if element.tag in ("geom", "body") and not element.get("name"):
            element.set("name", f"{MARK}{k}")


def compiled(root: Element, path: Path) -> mujoco.MjModel:
    """The model of a tree, as a file beside the original."""
    file = path.parent / "_stripped_.xml"
    try:
        file.write_text(ElementTree.tostring(root, encoding="unicode"))
        return mujoco.MjModel.from_xml_path(str(file))
    finally:
        file.unlink()


def is_mesh(geom: Element, model: mujoco.MjModel) -> bool:
    """Whether a geom needs a file: a mesh, a shape fitted to one, or heights."""
    kind = model.geom(geom.attrib["name"]).type[0]
    files = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_HFIELD)
    return kind in files or geom.get("mesh") is not None


def fitted(
    root: Element, path: Path, shapes: Iterable[Element], kind: str
) -> mujoco.MjModel:
    """The model with every mesh fitted by a primitive."""
    copy = deepcopy(root)
    names = {geom.attrib["name"] for geom in shapes}
    for geom in geoms(copy):
        if geom.attrib["name"] in names:
            geom.set("type", kind)
    try:
        return compiled(copy, path)
    except ValueError:  # of a mesh that is not closed: its inertia gives no size
        copy.append(Element("compiler", fitaabb="true"))
        return compiled(copy, path)


def place(geom: Element, model: mujoco.MjModel, name: str) -> None:
    """Write a primitive in place of a mesh."""
    for key in ("mesh", "fitscale", "material", "size", *PLACED):
        geom.attrib.pop(key, None)
    found = model.geom(name)
    kind = mujoco.mjtGeom(found.type[0])
    count = {mujoco.mjtGeom.mjGEOM_CAPSULE: 2}.get(kind, 3)
    geom.set("type", kind.name.removeprefix("mjGEOM_").lower())
    geom.set("size", text(found.size[:count], 5))
    geom.set("pos", text(found.pos, 6))
    geom.set("quat", text(found.quat, 7))


def add_inertials(
    root: Element,
    model: mujoco.MjModel,
    shapes: Iterable[Element],
    absent: set[str],
) -> None:
    """Write out the inertia of bodies that the compiler took from meshes.

    Raises:
        RuntimeError: If the mesh is not in the distribution.
    """
    of_mesh: dict[int, set[str]] = {}
    for geom in shapes:
        found = model.geom(geom.attrib["name"])
        of_mesh.setdefault(found.bodyid[0], set()).add(geom.get("mesh", ""))
    everywhere = [
        c for c in root.iter("compiler") if c.get("inertiafromgeom") == "true"
    ]
    for compiler in everywhere:
        compiler.set("inertiafromgeom", "auto")
    for world in root.iter("worldbody"):
        for body in world.iter("body"):
            own = body.find("inertial")
            found = model.body(body.attrib["name"])
            if not everywhere and (own is not None or found.id not in of_mesh):
                continue
            if own is not None:
                body.remove(own)
            if found.mass[0] == 0.0:
                continue
            if of_mesh.get(found.id, set()) & absent:
                raise RuntimeError(f"{found.name}: its mesh is not there")
            inertial = Element("inertial")
            inertial.set("pos", text(found.ipos, 10))
            inertial.set("quat", text(found.iquat, 12))
            inertial.set("mass", text(found.mass, 10))
            inertial.set("diaginertia", text(found.inertia, 10))
            inertial.tail = body.text
            body.insert(0, inertial)


def referenced(root: Element) -> set[str]:
    """Geoms that contact pairs, sensors and tendons name."""
    keys = ("geom", "geom1", "geom2", "objname", "sidesite")
    sections = ("contact", "sensor", "tendon")
    return {
        element.attrib[key]
        for section in sections
        for top in root.iter(section)
        for element in top.iter()
        for key in keys
        if key in element.attrib
    }


def drop_pictures(root: Element) -> None:
    """Remove textures that are files, and skins."""
    gone: set[str] = set()
    for asset in list(root.iter("asset")):
        for element in list(asset):
            if element.tag == "skin" or (
                element.tag == "texture" and "builtin" not in element.attrib
            ):
                gone.add(element.get("name") or Path(element.get("file", "")).stem)
                asset.remove(element)
    for material in [m for asset in root.iter("asset") for m in asset.iter("material")]:
        if material.get("texture") in gone:
            for key in ("texture", "texrepeat", "texuniform"):
                material.attrib.pop(key, None)
        for layer in material.findall("layer"):
            if layer.get("texture") in gone:
                material.remove(layer)
    for deformable in list(root.iter("deformable")):
        for skin in deformable.findall("skin"):
            deformable.remove(skin)


def drop_shapes(root: Element) -> None:
    """Remove meshes and fields of heights."""
    for parent in [*root.iter("asset"), *root.iter("default")]:
        for element in list(parent):
            if element.tag in ("mesh", "hfield"):
                parent.remove(element)


def clear(
    root: Element, path: Path, original: mujoco.MjModel, shapes: dict[str, Element]
) -> None:
    """Let shapes shrink until no bodies touch that do not touch in the original."""
    allowed = [touching(original, pose) for pose in poses(original)]
    for _ in range(20):
        model = compiled(root, path)
        extra = set()
        for pose, before in zip(poses(model), allowed, strict=True):
            for bodies, names in touching(model, pose).items():
                if bodies not in before:
                    extra |= names & set(shapes)
        if not extra:
            return
        for name in extra:
            size = np.array(
                [float(part) for part in shapes[name].attrib["size"].split()]
            )
            shapes[name].set("size", text(SHRINK * size, 5))
    raise RuntimeError(f"{path}: shapes still touch: {sorted(extra)}")


def poses(model: mujoco.MjModel) -> list[np.ndarray]:
    """The reference position and the keyframes."""
    return [model.qpos0, *model.key_qpos]


def touching(model: mujoco.MjModel, pose: np.ndarray) -> dict[frozenset[int], set[str]]:
    """Bodies that touch at a pose, and the shapes that do."""
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_forward(model, data)
    found: dict[frozenset[int], set[str]] = {}
    for contact in data.contact:
        pair = [int(g) for g in contact.geom]
        bodies = frozenset(int(model.geom_bodyid[g]) for g in pair)
        found.setdefault(bodies, set()).update(model.geom(g).name for g in pair)
    return found


def compare(original: mujoco.MjModel, target: Path) -> None:
    """Hold a stripped file to its original.

    Raises:
        RuntimeError: If it moves otherwise.
    """
    models = [original, mujoco.MjModel.from_xml_path(str(target))]
    for count in COUNTS:
        if getattr(models[0], count) != getattr(models[1], count):
            raise RuntimeError(f"{target}: {count} differs")
    rng = np.random.default_rng(1)
    for _ in range(5):
        shift, speed = rng.uniform(-1.0, 1.0, (2, models[0].nv))
        found = []
        for model in models:
            model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
            data = mujoco.MjData(model)
            mujoco.mj_integratePos(model, data.qpos, shift, 1.0)
            data.qvel[:] = speed
            mujoco.mj_forward(model, data)
            mass = np.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, mass)
            found.append((mass, data.qfrc_bias.copy()))
        for before, after in zip(*found, strict=True):
            error = np.abs(after - before).max() / np.abs(before).max()
            if not error < TOLERANCE:
                raise RuntimeError(f"{target}: moves otherwise, by {error:.2g}")


def text(values: Iterable[float], digits: int) -> str:
    """Numbers as an attribute."""
    return " ".join(f"{value:.{digits}g}" for value in values)


if __name__ == "__main__":
    main()
