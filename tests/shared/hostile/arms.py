"""Arms as MJCF and URDF: attributes, elements and trees that no robot has."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np

from hostile.toml_files import DRIVE
from hostile.values import TEXTS, factor, flipped, pick
from swgjoint.models_path import models_path

Drawn = tuple[dict[str, bytes], list[str]]
NUMBERS = ("nan", "inf", "-inf", "1e300", "1e308", "-1", "0", "1e-300", "x", "", "1e10")
MJCF = (
    '<tendon><fixed name="t"><joint joint="nowhere" coef="1"/></fixed></tendon>',
    '<tendon><fixed><joint joint="shoulder" coef="nan"/></fixed></tendon>',
    '<tendon><fixed name="t"><joint joint="elbow" coef="1"/></fixed></tendon>',
    '<tendon><spatial><site site="tool"/><site site="none"/></spatial></tendon>',
    '<equality><joint joint1="elbow" joint2="nowhere"/></equality>',
    '<equality><weld body1="forearm" body2="world"/></equality>',
    '<actuator><motor joint="nowhere"/></actuator>',
    '<actuator><motor joint="elbow" gear="nan" forcerange="-inf inf"/></actuator>',
    '<actuator><position joint="elbow" kp="1e300"/></actuator>',
    '<option gravity="nan 0 0"/>',
    '<option gravity="0 0 1e300" timestep="0"/>',
    '<option timestep="nan" integrator="RK4" solver="PGS"/>',
    '<option wind="nan 0 0" density="1e30" viscosity="inf"/>',
    '<option iterations="0" tolerance="nan"/>',
    '<size nuser_tendon="5" njmax="1" memory="1"/>',
    '<default><tendon user="1 .5 0 0 0"/></default>',
    '<asset><mesh name="m" file="missing.stl"/></asset>',
    '<asset><texture name="t" file="../../etc/passwd"/></asset>',
    '<include file="arm.xml"/>',
    '<include file="missing.xml"/>',
    '<keyframe><key qpos="nan 0"/></keyframe>',
    '<keyframe><key name="k" qpos="1e300 0"/></keyframe>',
    '<keyframe><key name="k" qpos="1 2 3 4 5"/></keyframe>',
    '<extension><plugin plugin="none.such"/></extension>',
    '<extension><plugin plugin="swgjoint.drive"/></extension>',
    '<contact><pair geom1="forearm" geom2="none"/></contact>',
    '<sensor><jointpos joint="elbow"/></sensor>',
    '<compiler angle="degree" boundmass="nan" inertiafromgeom="true"/>',
    '<visual><global offwidth="0"/></visual>',
    '<worldbody><body><freejoint/><geom size="0"/></body></worldbody>',
    '<worldbody><body><joint type="ball"/><geom size=".1"/></body></worldbody>',
    '<worldbody><geom type="mesh" mesh="none"/></worldbody>',
)
"""Children of the root."""
URDF = """<robot name="arm">
<link name="base"/>
<link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="3.0"/>
<inertia ixx="0.04" ixy="0" ixz="0" iyy="0.04" iyz="0" izz="0.005"/></inertial>
<visual><geometry><mesh filename="package://none/upper.stl"/></geometry></visual></link>
<link name="fore"><inertial><origin xyz="0 0 0.15"/><mass value="1.5"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.002"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<origin xyz="0 0 0.3" rpy="0 0 0"/><axis xyz="0 1 0"/>
<dynamics damping="0.5" friction="0.1"/>
<limit lower="-3" upper="3" effort="150" velocity="3"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
<origin xyz="0 0 0.4" rpy="0 0 0"/><axis xyz="0 1 0"/>
<dynamics damping="0.2" friction="0.05"/>
<limit lower="-2.5" upper="2.5" effort="80" velocity="3"/></joint>
</robot>"""
URDF_CHILDREN = (
    '<link name="fore"/>',
    '<link name="loose"/>',
    '<joint name="elbow" type="fixed"><parent link="base"/>'
    '<child link="fore"/></joint>',
    '<joint name="loop" type="revolute"><parent link="fore"/><child link="base"/>'
    '<axis xyz="0 0 1"/></joint>',
    '<joint name="j" type="continuous"><parent link="none"/>'
    '<child link="fore"/></joint>',
    '<link name="tip"/><joint name="slide" type="prismatic"><parent link="fore"/>'
    '<child link="tip"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>',
    '<mujoco><compiler discardvisual="false" meshdir="/"/></mujoco>',
    '<mujoco><option gravity="nan 0 0"/></mujoco>',
    "<transmission/>",
    '<gazebo reference="fore"><x/></gazebo>',
)
COMMANDS = (
    ["run", "{}", "--drive", DRIVE, "--json"],
    ["run", "{}", "--drive", DRIVE, "--motion", "step", "--json"],
    ["compare", DRIVE, "--scene", "{}", "--json"],
    ["run", "{}", "--json"],
    ["export", "mjcf", "{}", "-o", "out.xml", "--drive", DRIVE, "--json"],
)


def mjcf_case(rng: np.random.Generator) -> Drawn:
    """A bundled arm with one to three hostile places."""
    name = pick(rng, ["two-link", "two-link", "two-link", "bench", "ur5e"])
    text = (models_path() / "arms" / f"{name}.xml").read_text(encoding="utf-8")
    return _case(rng, "arm.xml", text, list(MJCF))


def urdf_case(rng: np.random.Generator) -> Drawn:
    """A URDF of two joints with one to three hostile places."""
    return _case(rng, "arm.urdf", URDF, list(URDF_CHILDREN))


def _case(rng: np.random.Generator, name: str, text: str, children: list[str]) -> Drawn:
    root = ET.fromstring(text)
    for _ in range(int(rng.integers(1, 4))):
        _spoil(rng, root, children)
    content = ET.tostring(root, encoding="unicode").encode(errors="surrogatepass")
    what = int(rng.integers(12))
    if what == 0:
        content = flipped(rng, content)
    elif what == 1:
        head = b'<!DOCTYPE x [<!ENTITY e "' + b"lol" * 1000 + b'">]>'
        content = pick(
            rng,
            [
                b"",
                b"<mujoco/>",
                b"<robot/>",
                head + content,
                b"\xef\xbb\xbf" + content,
                text.encode("utf-16"),
                b"<mujoco>" + b"<worldbody>" * 3000,
                _deep(2000),
                content + b"<",
                content.replace(b"name", b"nam\xff"),
            ],
        )
    return {name: content}, [part.format(name) for part in pick(rng, list(COMMANDS))]


def _deep(bodies: int) -> bytes:
    """A chain of many bodies, each in the one before; the first one has a hinge."""
    start = b'<mujoco><worldbody><body><joint name="j" axis="0 1 0"/><geom size=".1"/>'
    return (
        start
        + b"<body>" * bodies
        + b"</body>" * (bodies + 1)
        + b"</worldbody></mujoco>"
    )


def _spoil(rng: np.random.Generator, root: ET.Element, children: list[str]) -> None:
    everything = list(root.iter())
    element = pick(rng, everything)
    what = int(rng.integers(12))
    if what < 3:
        parts = ET.fromstring(f"<x>{pick(rng, children)}</x>")
        for part in parts:
            root.insert(int(rng.integers(len(root) + 1)), part)
    elif what < 9:
        with_values = [e for e in everything if e.attrib]
        if not with_values:
            return
        element = pick(rng, with_values)
        key = pick(rng, list(element.attrib))
        element.set(key, _value(rng, element.attrib[key]))
    elif what == 9:
        for parent in everything:
            if element in list(parent):
                parent.remove(element)
    elif what == 10 and len(element):
        child = pick(rng, list(element))
        element.append(child)  # twice, or a cycle of names
    else:
        element.set(pick(rng, ["name", "class", "pos", "type", "x"]), _text(rng))


def _value(rng: np.random.Generator, text: str) -> str:
    """A number or text of an attribute in another way than it should be."""
    parts = text.split()
    if parts and re.fullmatch(r"[-+.\deE]+", parts[0]) and rng.random() < 0.8:
        k = int(rng.integers(len(parts)))
        what = int(rng.integers(5))
        if what < 3:
            parts[k] = pick(rng, NUMBERS)
        elif what == 3:
            try:
                parts[k] = repr(float(parts[k]) * factor(rng))
            except ValueError:
                parts[k] = "0"
        else:
            parts = parts[:-1] if rng.random() < 0.5 else parts * 2
        return " ".join(parts)
    return _text(rng)


def _text(rng: np.random.Generator) -> str:
    """A text that XML may hold."""
    text = pick(rng, TEXTS)
    return "".join(c for c in text if c >= " " or c in "\t\n\r")
