"""Construction of the 3D model from a design, and checks that the model applies."""

from __future__ import annotations

from typing import Literal

from swgjoint.errors import DesignError
from swgjoint.fe.common.contact_patch import average_spline
from swgjoint.fe.plane.circular_spline import CircularSpline
from swgjoint.fe.plane.drive2d import Half, can_halve
from swgjoint.fe.solid.circular_spline import condense_circular_spline
from swgjoint.fe.solid.memory import require_solid_memory, required_memory
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.strip.masters import Orders
from swgjoint.fe.solid.strip.mesh import circular_spline_strip, flexspline_strip
from swgjoint.fe.solid.strip.strip import flexspline
from swgjoint.fe.solid.teeth import FlankCrowning, SolidTeeth
from swgjoint.fe.solid.wave_generator.race import SolidRace
from swgjoint.fe.solid.wave_generator.surface import WaveGeneratorSurface
from swgjoint.gear.bearing.checks import bearing_checks
from swgjoint.gear.design.check import raise_faults
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import axis_tilt, has_errors, tooth_errors
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.gear.wave_generators.wave_generator import lobe_height
from swgjoint.typing import Array
from swgjoint.units import mm, um

Bearing = Literal["free", "held"]
"""Axial support of the outer race by its ball grooves: ``free`` lets every section move
along the axis, ``held`` prevents this motion."""


def solid_sector_model(
    design: Design,
    *,
    half: Half = False,
    nonlinear: bool = True,
    elastic_circular_spline: bool = True,
    orders: Orders | None = None,
    bearing: Bearing | None = None,
    like: SolidSectorModel | None = None,
) -> SolidSectorModel:
    """Build the 3D model of a design.

    Args:
        design: The drive; it needs a ``[cup]``.
        half: Whether to model only half of the drive, which a rotation by 180 deg maps
            onto the other half; ``auto`` does so if the drive has this symmetry.
        nonlinear: Whether segments may rotate by large angles.
        elastic_circular_spline: Whether the circular spline is elastic instead of
            rigid.
        orders: Polynomial degrees of the displacements of faces and sections; None for
            the default degrees.
        bearing: Axial support of the outer race of ``[wave_generator.bearing]`` on its
            balls; None replaces bearing and cam by a rigid wave generator.
        like: Model of the same drive, whole or half, with other errors or none and an
            elastic circular spline. Its condensed members are used again, which saves a
            few seconds; None condenses them.

    Raises:
        DesignError: If the design cannot be built or has features that the model lacks,
            if the half model does not apply, or if a design with manufacturing errors
            is combined with a rigid circular spline.
        ComputationError: If the model does not fit in the memory of the machine.
    """
    name = design.drive.name
    check_modelled(design)
    if half == "auto":
        design_bearing = design.wave_generator.bearing
        even = (
            bearing is None or design_bearing is None or design_bearing.balls % 2 == 0
        )
        half = can_halve(design, bearing=False) and even
    if bearing is not None:
        check_bearing(design, half=half)
    if half and not can_halve(design, bearing=False):
        raise DesignError(
            f"{name}: a half model needs even tooth counts, no tolerances and a wave"
            " generator that is symmetric under a rotation by 180 deg; omit --half"
        )
    profile = tooth_profile(design, "flexspline")
    facing = tooth_profile(design, "circular_spline")
    orders = orders or Orders()
    mesh = flexspline_strip(design, profile)
    spline_mesh = (
        circular_spline_strip(design, facing) if elastic_circular_spline else None
    )
    sectors = design.drive.teeth_flexspline // (2 if half else 1)
    require_solid_memory(name, required_memory(mesh, spline_mesh, sectors, orders))
    if like is None:
        strip = flexspline(design, profile, mesh, orders=orders)
    else:
        strip = like.strip
    gear, surface = None, CircularSpline(profile=facing)
    if spline_mesh is not None:
        gear = None if like is None else like.teeth.elastic_circular_spline
        gear = gear or condense_circular_spline(design, facing, spline_mesh)
        stations = gear.mesh.teeth.plane.flank_stations[:-1]
        surface = CircularSpline(profile=facing, weights=average_spline(stations))
    shape, errors = design.micro_geometry, dict[str, Array]()
    if has_errors(design):
        if gear is None:
            raise DesignError(
                f"{name}: the 3d model supports tolerances only with an elastic"
                " circular spline"
            )
        errors = {
            "shift": tooth_errors(design, "flexspline").shift,
            "circular_spline_shift": tooth_errors(design, "circular_spline").shift,
            "tilt": axis_tilt(design),
        }
    return SolidSectorModel(
        strip=strip,
        wave_generator=WaveGeneratorSurface.from_design(design),
        teeth=SolidTeeth(
            strip=strip,
            circular_spline=surface,
            elastic_circular_spline=gear,
            circular_spline_teeth=design.drive.teeth_circular_spline
            // (2 if half else 1),
            crowning=FlankCrowning(
                height=shape.flexspline_crowning_um * um,
                width=design.drive.face_width_mm * mm,
                circular=shape.crowning_kind == "circular",
            ),
            **errors,
        ),
        lobe_height=lobe_height(design),
        lobes=design.lobes,
        half=half,
        nonlinear=nonlinear,
        race=None
        if bearing is None
        else SolidRace.from_design(design, half=half, axially_free=bearing == "free"),
    )


def check_bearing(design: Design, *, half: bool) -> None:
    """Reject designs to which the 3D model of the bearing does not apply.

    Args:
        design: The drive.
        half: Whether the half model is used.

    Raises:
        DesignError: If the design has no bearing or an unsupported feature, with one
            line per key, or if the bearing cannot be built.
    """
    drive, generator = design.drive, design.wave_generator
    faults = []
    if generator.bearing is None:
        faults.append(
            "wave_generator.bearing is absent: the 3d bearing model needs this table"
        )
    elif half and generator.bearing.balls % 2:
        faults.append(
            f"wave_generator.bearing.balls = {generator.bearing.balls}: the half model"
            " needs an even number"
        )
    if drive.layout != "circular_spline_fixed":
        faults.append(
            f"drive.layout = {drive.layout!r}: the 3d bearing model expects"
            " 'circular_spline_fixed'"
        )
    if generator.kind not in ("elliptical", "cosine", "table"):
        faults.append(
            f"wave_generator.kind = {generator.kind!r}: the 3d bearing model expects"
            " 'elliptical', 'cosine' or 'table'"
        )
    if faults:
        raise DesignError("\n".join(f"{drive.name}: {fault}" for fault in faults))
    raise_faults(bearing_checks(design))


def check_modelled(design: Design) -> None:
    """Reject designs to which the 3D model does not apply.

    The model has no tooth friction; that of a design is left out.

    Raises:
        DesignError: If the design has no ``[cup]``.
    """
    if design.cup is None:
        raise DesignError(
            f"{design.drive.name}: the 3d model needs a [cup] table; accepted without"
            " it: --model 2d"
        )
