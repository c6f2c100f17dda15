"""Stand-ins for the maps of designs at rigid joints, without solved equilibria."""

from __future__ import annotations

from dataclasses import replace

from swgjoint.drives.fidelity import default_model
from swgjoint.errors import InputError
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.maps.drive_map import DriveMap
from swgjoint.units import arcmin

TORSION = 10.0 * arcmin
"""Torsion of a stand-in at the rated torque [rad], of the order of that of a drive. No
figure of a rigid joint depends on it."""


def stand_in(design: Design, model: str | None = None) -> DriveMap | None:
    """A map with the ratio, ratings and label of a design, but not its elasticity.

    Args:
        design: The drive.
        model: Fidelity of the map that it represents; None takes the default of the
            design.

    Returns:
        The stand-in; None if a rigid joint reports more of the map than that, which are
        losses, or if the design cannot be built, which building its map reports.
    """
    model = model or default_model(design)
    lossy = design.friction.tooth_coefficient or design.losses is not None
    # the label of a ring map, and that of a map computed with another member fixed, are
    # those of their own solves
    balls = design.wave_generator.bearing is not None
    turned = balls and design.drive.layout != "circular_spline_fixed"
    if lossy or model == "ring" or (turned and model == "2d"):
        return None
    try:
        _build(design, model)
    except InputError:
        return None
    from swgjoint.fe.label import label_of

    drive, ratings = design.drive, ratings_of(design)
    spring = DriveMap.linear(
        ratings.rated_torque / TORSION,
        layout=drive.layout,
        teeth_flexspline=drive.teeth_flexspline,
        teeth_circular_spline=drive.teeth_circular_spline,
        rated_torque=ratings.rated_torque,
        name=drive.name,
    )
    info = {"design_hash": design.content_hash(), "label": label_of(design, model)}
    return replace(
        spring,
        level=model,
        ratings=ratings,
        damping_ratio=design.joint.damping_ratio,
        info=info,
    )


def _build(design: Design, model: str) -> None:
    """Build the teeth, meshes and wave generator, of which no equilibrium is solved.

    Raises:
        DesignError: If the design cannot be built.
    """
    if model == "2d":
        from swgjoint.fe.common.sampling import follower_in_plane
        from swgjoint.fe.plane.drive2d import in_plane

        follower_in_plane(in_plane(design))
        return
    from swgjoint.fe.solid.drive3d import check_modelled
    from swgjoint.fe.solid.strip.mesh import circular_spline_strip, flexspline_strip
    from swgjoint.fe.solid.wave_generator.surface import WaveGeneratorSurface
    from swgjoint.gear.teeth.tooth_profile import tooth_profile

    check_modelled(design)
    flexspline_strip(design, tooth_profile(design, "flexspline"))
    circular_spline_strip(design, tooth_profile(design, "circular_spline"))
    WaveGeneratorSurface.from_design(design)
