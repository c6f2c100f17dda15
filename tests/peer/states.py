"""Our states that CalculiX looks at."""

from __future__ import annotations

from functools import cache
from math import pi

from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.gear.design.design import Design

DESIGNS = {
    "elliptical": "reference-2d",
    "simplified": "reference-2d-simplified",
    "parabolic": "reference-2d-parabolic",
}
SMALL = {
    "drive.teeth_flexspline": 60,
    "drive.teeth_circular_spline": 62,
    "flexspline.rim_mm": 0.5,
}
"""Half the teeth on a rim as slender: a drive that bends alike, at a third of the
cost. Kinds of wave generator that begin with "small" have it."""
TORQUE = 20.0
POSITIONS = (0.0, 0.3)
"""Wave-generator angles of the meshed positions in pitches of the circular spline."""


def design_of(kind: str, refinement: int) -> Design:
    """Reference design with a wave generator."""
    design = Design.load(DESIGNS[kind.removeprefix("small ")])
    small = SMALL if kind.startswith("small ") else {}
    return design.with_changes({"mesh.refinement": refinement} | small)


def torque_of(kind: str) -> float:
    """On a small drive as much per tooth: half the teeth on half the radius [N m]."""
    return TORQUE / 4.0 if kind.startswith("small ") else TORQUE


@cache
def model_of(kind: str, refinement: int, elastic: bool) -> SectorModel:
    """Half of its drive."""
    design = design_of(kind, refinement)
    return sector_model(design, half=True, elastic_circular_spline=elastic)


def _follow(kind: str, refinement: int, elastic: bool) -> Continuation:
    design = design_of(kind, refinement)
    model = model_of(kind, refinement, elastic)
    return Continuation(model=model, ratio=design.ratio)


@cache
def deflected(kind: str, refinement: int, elastic: bool) -> State:
    """The wave generator alone."""
    return _checked(_follow(kind, refinement, elastic).deflect())


@cache
def loaded(kind: str, refinement: int, elastic: bool) -> State:
    """At the torque, the wave generator not turned."""
    follow = _follow(kind, refinement, elastic)
    meshed = _checked(follow.engage(deflected(kind, refinement, elastic)))
    return _checked(follow.to_torque(meshed, torque_of(kind)))


def turned_to(kind: str, refinement: int, pitches: float) -> State:
    """At the torque, the wave generator turned by pitches of the circular spline."""
    state = loaded(kind, refinement, True)
    if not pitches:
        return state
    teeth = model_of(kind, refinement, True).circular_spline.profile.teeth
    follow = _follow(kind, refinement, True)
    return _checked(follow.to_angle(state, pitches * 2.0 * pi / teeth))


def _checked(state: State) -> State:
    assert state.outcome.ok, state.outcome
    return state
