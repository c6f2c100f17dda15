"""Construction of the 2D model of a design, and what the model represents."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

from swgjoint.errors import DesignError
from swgjoint.fe.common.contact_patch import half_length
from swgjoint.fe.common.friction import STICK_STIFFNESS, CoulombFriction
from swgjoint.fe.common.indentation import Indentation, softness_of
from swgjoint.fe.common.stress_state import confinement
from swgjoint.fe.plane.bore_contact import NARROW_POINTS, POINTS
from swgjoint.fe.plane.circular_spline import CircularSpline, circular_spline_compliance
from swgjoint.fe.plane.race import PlaneRace
from swgjoint.fe.plane.sector_mesh import sector_mesh
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.superelement import Superelement, condense
from swgjoint.gear.bearing.checks import bearing_checks
from swgjoint.gear.design.check import raise_faults
from swgjoint.gear.design.design import Design, MemberName
from swgjoint.gear.design.tolerances import (
    flawed_wave_generator,
    has_errors,
    tooth_errors,
    wave_generator_offset,
)
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.gear.wave_generators.wave_generator import lobe_height, wave_generator
from swgjoint.typing import Array
from swgjoint.units import mm

NARROW = ("parabolic", "asymmetric_parabolic", "four_roller")
"""Kinds of wave generators whose contact with the bore is narrower than the node
spacing."""

Half = bool | Literal["auto"]
"""Whether to model half of the drive; ``auto`` does so if its symmetry allows it."""


def can_halve(design: Design, *, bearing: bool = True) -> bool:
    """Whether a rotation by 180 deg maps the drive onto itself.

    The wave generator must have this symmetry, both tooth counts must be even, and the
    design must have no manufacturing errors.

    Args:
        design: The drive.
        bearing: Whether the model includes the bearing of the wave generator in designs
            for which :func:`carries_bearing` is true; these need an even number of
            balls.
    """
    drive, fitted = design.drive, design.wave_generator.bearing
    carried = bearing and carries_bearing(design)
    odd = carried and fitted is not None and fitted.balls % 2
    return (
        drive.teeth_flexspline % 2 == 0
        and drive.teeth_circular_spline % 2 == 0
        and wave_generator(design).folds % 2 == 0
        and not has_errors(design)
        and not odd
    )


def carries_bearing(design: Design) -> bool:
    """Whether the 2D model includes the ball bearing of the wave generator.

    The design must have a bearing, an outline of the wave generator with two lobes and
    with neither corners nor straight segments, and a fixed circular spline: the rolling
    motion of the balls is derived for an outer race that turns with the flexspline as
    the output.
    """
    generator = design.wave_generator
    return (
        generator.bearing is not None
        and generator.kind in ("elliptical", "cosine", "table")
        and design.lobes == 2
        and design.drive.layout == "circular_spline_fixed"
    )


def check_modelled(design: Design, model: str) -> None:
    """Reject unknown models.

    Args:
        design: The drive.
        model: Fidelity of the model. Only ``2d`` is accepted: callers treat ``ring``
            and ``3d`` separately.

    Raises:
        DesignError: If the model is not ``2d``.
    """
    if model != "2d":
        name = design.drive.name
        raise DesignError(f"{name}: model = {model!r}: expected 'ring', '2d' or '3d'")


def in_plane(design: Design) -> Design:
    """The design as a 2D model represents it: with parallel axes.

    Micro-geometry, the other feature that a 2D model lacks, needs no change: the model
    does not read it. :func:`unmodelled_parts` names what is left out.
    """
    if not design.tolerances.misalignment_arcmin:
        return design
    return design.with_changes({"tolerances.misalignment_arcmin": 0.0})


def unmodelled_parts(
    design: Design, model: str = "2d", *, bearing: bool = True
) -> str | None:
    """Parts and effects that the model does not represent, for the validity label.

    Args:
        design: The drive.
        model: Fidelity of the model: ``ring``, ``2d`` or ``3d``.
        bearing: Whether a 2D model was built with ``bearing=True``.

    Returns:
        Their names, joined by "and"; None if the model represents all of them.
    """
    carried = bearing and carries_bearing(design)
    shapes = design.micro_geometry.model_dump(exclude={"crowning_kind"})
    parts = {
        "wave_generator.bearing": design.wave_generator.bearing is not None
        and (model == "3d" or (model == "2d" and not carried)),
        "micro_geometry": model != "3d" and any(shapes.values()),
        "tolerances.misalignment_arcmin": model != "3d"
        and design.tolerances.misalignment_arcmin > 0.0,
        "tooth passage": model == "ring",
        "rim of the circular spline": model == "ring",
        "tooth contact narrower than a contact patch": model != "2d",
    }
    return " and ".join(name for name, there in parts.items() if there) or None


def sector_model(
    design: Design,
    *,
    half: Half = False,
    nonlinear: bool = True,
    elastic_circular_spline: bool = True,
    friction: bool = True,
    bearing: bool = True,
    cage_held: bool = False,
    profiles: Mapping[MemberName, ToothProfile] | None = None,
) -> SectorModel:
    """2D model of a design.

    Args:
        design: The drive.
        half: Whether to model half of the drive, closed by its symmetry; ``auto`` does
            so if the symmetry allows it.
        nonlinear: Whether sectors undergo large rotations.
        elastic_circular_spline: Whether the circular spline deforms;
            ``circular_spline.outer_rim`` of the design fixes or frees its outer
            diameter.
        friction: Whether the flanks have the friction coefficient of the design; False
            gives a model without friction, which conserves energy.
        bearing: Whether to support the rim on the ball bearing of the wave generator,
            if the design has one that the 2D model can represent; False uses a rigid
            surface.
        cage_held: Whether the cage is fixed to the cam, so that the balls do not roll.
        profiles: Tooth profiles that replace those of the design, by member.

    Raises:
        DesignError: If the design cannot be built, if a half model does not apply, or
            if a rigid circular spline is combined with friction or tolerances.
    """
    if half == "auto":
        half = can_halve(design, bearing=bearing)
    elif half and not can_halve(design, bearing=bearing):
        drive, fitted = design.drive, design.wave_generator.bearing
        balls = ""
        carried = bearing and carries_bearing(design)
        if carried and fitted is not None and fitted.balls % 2:
            balls = f" on {fitted.balls} balls (expected an even number)"
        raise DesignError(
            f"{drive.name}: a half model needs even tooth counts, no tolerances and a "
            "wave generator that is symmetric under a rotation by 180 deg; the design "
            f"has {drive.teeth_flexspline}/{drive.teeth_circular_spline} teeth, a wave "
            f"generator of kind {design.wave_generator.kind!r}{balls} and "
            f"{'' if has_errors(design) else 'no '}tolerances"
        )
    flanks: dict[MemberName, ToothProfile] = dict(profiles or {})
    members: tuple[MemberName, ...] = ("flexspline", "circular_spline")
    for name in members:
        if name not in flanks:
            flanks[name] = tooth_profile(design, name)
    circular_spline = CircularSpline(profile=flanks["circular_spline"])
    if elastic_circular_spline:
        element = sector(design, "circular_spline", circular_spline.profile)
        free = design.circular_spline.outer_rim == "free"
        circular_spline = replace(
            circular_spline,
            compliance=circular_spline_compliance(element, free_rim=free),
        )
    coefficient = design.friction.tooth_coefficient if friction else 0.0
    law = None
    if coefficient > 0.0:
        if circular_spline.compliance is None:
            raise DesignError(
                f"{design.drive.name}: friction.tooth_coefficient = {coefficient:g}: "
                "expected 0 with a rigid circular spline"
            )
        modulus = design.material_of("flexspline").youngs_modulus
        width = design.drive.face_width_mm * mm
        law = CoulombFriction(
            coefficient=coefficient, stiffness=STICK_STIFFNESS * modulus * width
        )
    shifts: dict[str, Array] = {}
    if has_errors(design):
        if circular_spline.compliance is None:
            raise DesignError(
                f"{design.drive.name}: tolerances: expected none with a rigid circular"
                " spline"
            )
        shifts = {
            "tooth_shift": tooth_errors(design, "flexspline").shift,
            "circular_spline_tooth_shift": tooth_errors(
                design, "circular_spline"
            ).shift,
            "wave_generator_offset": wave_generator_offset(design),
        }
    element = sector(design, "flexspline", flanks["flexspline"])
    height, race = lobe_height(design), None
    if bearing and carries_bearing(design):
        raise_faults(bearing_checks(design))
        race = PlaneRace.from_design(design, element, half=half, cage_held=cage_held)
        height = race.on_balls.lobe_height
    return SectorModel(
        **shifts,
        friction=law,
        indentation=indentation(design, element, circular_spline),
        element=element,
        wave_generator=flawed_wave_generator(design),
        circular_spline=circular_spline,
        lobe_height=height,
        lobes=design.lobes,
        half=half,
        nonlinear=nonlinear,
        layer=design.material_of("flexspline").youngs_modulus
        * design.drive.face_width_mm
        * mm,
        points=NARROW_POINTS if design.wave_generator.kind in NARROW else POINTS,
        race=race,
    )


def indentation(
    design: Design, element: Superelement, circular_spline: CircularSpline
) -> Indentation:
    """Indentation law of the flanks of the elastic members.

    Args:
        design: The drive.
        element: Condensed sector of the flexspline.
        circular_spline: The circular spline, elastic or rigid.
    """
    members: list[tuple[MemberName, Superelement]] = [("flexspline", element)]
    if circular_spline.compliance is not None:
        members.append(("circular_spline", circular_spline.compliance.element))
    softness, patch = [], []
    for name, tooth in members:
        material = design.material_of(name)
        # in-plane modulus E' of in_plane_constants, with axial_stress = c nu
        modulus = material.youngs_modulus / (
            1.0 - tooth.axial_stress * material.poisson_ratio
        )
        softness.append(softness_of(modulus, design.drive.face_width_mm * mm))
        patch.append(half_length(tooth.spline.x))
    return Indentation.from_members(
        tuple(softness), tuple(patch), (element.profile, circular_spline.profile)
    )


def sector(design: Design, member: MemberName, profile: ToothProfile) -> Superelement:
    """Condensed sector of one tooth of a member.

    Args:
        design: The drive.
        member: Member to condense: flexspline or circular spline.
        profile: Tooth profile of that member.
    """
    material = design.material_of(member)
    rim = getattr(design, member).rim_mm * mm
    return condense(
        sector_mesh(profile, rim, design.mesh.refinement),
        profile,
        youngs_modulus=material.youngs_modulus,
        poisson_ratio=material.poisson_ratio,
        width=design.drive.face_width_mm * mm,
        confinement=confinement(design, member, profile),
    )
