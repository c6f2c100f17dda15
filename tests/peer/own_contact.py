"""A position of the drive by CalculiX's own contact instead of our forces.

The wave generator is a rigid strip that starts as a circle inside the bore and takes
its outline; the teeth of the circular spline are rigid strips that appear afterwards.
Contact is frictionless and face to face, with a pressure proportional to the overlap.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi
from pathlib import Path

import calculix
import numpy as np
from numpy.typing import NDArray
from quadratic_ring import MIRROR, Chain, QuadraticRing, quadratic_ring
from replay import (
    Forces,
    MPa,
    Replay,
    closure,
    flexspline_deck,
    load_on_bore,
    symmetry,
)

from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.gear.wave_generators.wave_generator import WaveGenerator
from swgjoint.units import mm

Array = NDArray[np.float64]
Index = NDArray[np.int64]

CHORDS = 0.0125e-6
"""By which the sides of the cam leave its outline [m]."""
FLANK_SIDES = 160
STRIP = 0.05 * mm
CLEARANCE = 1e-3 * mm
"""Of the circular cam at the start [m]."""
TEETH_WITHIN = 20.0 * pi / 180
"""Teeth this far from the lobes get contact [rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Strip:
    """Rigid linear quadrilaterals behind a curve."""

    outline: Array
    """Where the curve starts, steel on its left (n, 2) [m]."""
    motion: Array
    """Prescribed displacement (n, 2) [m]."""

    @property
    def points(self) -> Array:
        """The curve, then the same points a strip's width into the steel."""
        tangent = np.gradient(self.outline, axis=0)
        inward = np.stack([-tangent[:, 1], tangent[:, 0]], axis=-1)
        inward /= np.hypot(*inward.T)[:, None]
        return np.concatenate([self.outline, self.outline + STRIP * inward])

    @property
    def elements(self) -> Index:
        """Sides first to last along the curve; the curve is side 1."""
        n = len(self.outline)
        i = np.arange(n - 1)
        return np.stack([i, i + 1, n + i + 1, n + i], axis=-1)


def cam_strip(outline: WaveGenerator, bore: float, alpha: float, turn: float) -> Strip:
    """From a circle to the outline, over a part of a turn and a little more."""
    margin = 0.01
    sides = 2.0 * pi / np.sqrt(8.0 * CHORDS / bore)  # 4800 of the reference drive
    count = int(sides * (turn + 2 * margin))
    share = np.linspace(-margin, turn + margin, count + 1)
    share = share - alpha / (2.0 * pi)  # of the perimeter, from the major axis
    final, _, _ = outline.evaluate(share * outline.perimeter)
    angle = 2.0 * pi * share
    circle = (bore - CLEARANCE) * np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
    return Strip(outline=rotate(circle, alpha), motion=rotate(final - circle, alpha))


def ring_strips(
    profile: ToothProfile, turn: float, alpha: float
) -> tuple[list[Strip], list[Strip]]:
    """Right and left flanks of the teeth near the lobes, fixed."""
    s = np.linspace(*profile.contact_range, FLANK_SIDES + 1)
    right, _, _ = profile.evaluate(s)
    strips: tuple[list[Strip], list[Strip]] = ([], [])
    pitch = 2.0 * profile.half_pitch
    for k in range(-1, round(turn * profile.teeth) + 1):
        angle = (k + 0.5) * pitch
        seen = (angle - alpha + pi / 2) % pi - pi / 2
        if abs(seen) > TEETH_WITHIN:
            continue
        for side, flank in enumerate((right, (right * MIRROR)[::-1])):
            place = rotate(flank, angle)
            strip = Strip(outline=place, motion=np.zeros_like(place))
            strips[side].append(strip)
    return strips


def own_contact(
    design: Design,
    model: SectorModel,
    state: State,
    folder: Path,
    *,
    element: str,
    refinement: float,
    penalty: float,
    quarter: bool,
) -> Replay:
    """Find the position of a state by CalculiX's contact.

    Args:
        design: The drive, its circular spline rigid.
        model: Its model.
        state: Gives wave-generator angle and torque, and is what the result is compared
            with.
        folder: Where the files of CalculiX go.
        element: As for the replay.
        refinement: Of its mesh.
        penalty: Contact pressure by overlap [Pa/m].
        quarter: Whether the state is symmetric to both axes and without teeth.
    """
    ring = quadratic_ring(
        model.element.profile,
        design.flexspline.rim_mm * mm,
        refinement,
        sectors=model.sectors,
        quarter=quarter,
    )
    forces = Forces.of(model, state)
    turn = 0.25 if quarter else 1.0 / model.copies
    alpha = state.wave_generator_angle
    bore = float(np.hypot(*model.element.skeleton[model.element.face_size]))
    cam = cam_strip(model.wave_generator, bore, alpha, turn)
    nodal = np.zeros_like(ring.points)
    supports = symmetry(ring)
    if not quarter:
        load = replace(
            forces, flank=0.0 * forces.flank, bore=load_on_bore(model, state)
        )
        nodal, supports = closure(ring, load.on(ring), model.closure)
    rigid = _Strips(ring, design.drive.face_width_mm)
    deck = flexspline_deck(design, ring, element) + supports
    deck += rigid.block("CAM", [cam])
    deck += _slave("BORE", ring, ring.bore)
    pairs = [("BORE", "CAM")]
    if not quarter:
        flanks = ring_strips(model.circular_spline.profile, turn, alpha)
        near = np.abs((model.place - alpha + pi / 2) % pi - pi / 2) < TEETH_WITHIN
        for side, name in enumerate(("RIGHT", "LEFT")):
            deck += _slave(f"{name}FS", ring, ring.flanks[side], near)
            # a right flank touches the left flank of a tooth of the circular spline
            deck += rigid.block(f"{name}CS", flanks[1 - side])
            pairs.append((f"{name}FS", f"{name}CS"))
    deck += "*SURFACE INTERACTION, NAME=HARD\n"
    deck += "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n"
    deck += f"{penalty * mm / MPa:.12g}\n"
    for slave, master in pairs:
        deck += "*CONTACT PAIR, INTERACTION=HARD, TYPE=SURFACE TO SURFACE\n"
        deck += f"{slave}, {master}\n"
    rigid_nodes = rigid.motion_block()
    change = "".join(
        "*MODEL CHANGE, TYPE=CONTACT PAIR, {}\n" + f"{slave}, {master}\n"
        for slave, master in pairs[1:]
    )
    step = "*STEP, NLGEOM, INC=400\n*STATIC\n{}\n"
    deck += step.format("0.17, 1.0, 1e-5, 0.17")
    deck += change.replace("{}", "REMOVE") + rigid_nodes
    deck += calculix.OUTPUT + "*END STEP\n"
    if not quarter:
        deck += step.format("0.2, 1.0, 1e-5, 0.5") + change.replace("{}", "ADD")
        deck += calculix.load_block(nodal) + calculix.OUTPUT + "*END STEP\n"
        # the teeth hold the ring now: let its rotation go
        deck += step.format("1.0, 1.0")
        deck += "*BOUNDARY, OP=NEW\n"
        deck += rigid_nodes.split("\n", 1)[1] + calculix.OUTPUT + "*END STEP\n"
    fields = calculix.run(deck, folder, len(ring.points), name="contact")
    return Replay(
        model=model,
        state=state,
        ring=ring,
        fields=fields,
        forces=forces,
        nodal=nodal,
        quarter=quarter,
    )


class _Strips:
    """Numbers the nodes and elements of rigid strips after those of the ring."""

    def __init__(self, ring: QuadraticRing, width: float) -> None:
        self.width = width
        self.node, self.element = len(ring.points) + 1, len(ring.elements) + 1
        self.motion: list[tuple[int, Array]] = []

    def block(self, name: str, strips: list[Strip]) -> str:
        """Nodes, elements and the surface of some strips."""
        text, surface = "", f"*SURFACE, NAME={name}, TYPE=ELEMENT\n"
        for strip in strips:
            points, elements = strip.points, strip.elements
            text += calculix.node_block(points / mm, self.node)
            text += calculix.element_block(
                "CPE4", elements, name + "STRIP", self.element, self.node
            )
            count = len(elements)
            surface += calculix.numbered(self.element, [["S1"]] * count)
            self.motion.append((self.node, np.tile(strip.motion, (2, 1))))
            self.node += len(points)
            self.element += count
        text += (
            f"*SOLID SECTION, ELSET={name}STRIP, MATERIAL=STEEL\n{self.width:.12g}\n"
        )
        return text + surface

    def motion_block(self) -> str:
        """Displacements of all nodes of all strips."""
        lines = ["*BOUNDARY"]
        for first, motion in self.motion:
            for node, (x, y) in enumerate(motion / mm, first):
                lines += [f"{node}, 1, 1, {x:.12g}", f"{node}, 2, 2, {y:.12g}"]
        return "\n".join(lines) + "\n"


def _slave(
    name: str, ring: QuadraticRing, chain: Chain, sectors: Index | slice = slice(None)
) -> str:
    """Sides of elements along a chain as a surface."""
    middles = chain.nodes[sectors, :, 2].ravel()
    element, side = np.nonzero(np.isin(ring.elements[:, 4:], middles[middles >= 0]))
    lines = [f"{e + 1}, S{k + 1}" for e, k in zip(element, side, strict=True)]
    return f"*SURFACE, NAME={name}, TYPE=ELEMENT\n" + "\n".join(lines) + "\n"
