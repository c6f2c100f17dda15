"""Maps of drives in space: tangent, clearance, symmetries of the pattern."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.drives.build_map import build_map
from swgjoint.errors import DesignError
from swgjoint.gear.design.design import Design
from swgjoint.maps.fit.fit import fit_map

pytestmark = pytest.mark.fe


def test_compliance_is_the_slope_of_the_rotation(small_drive, loaded):
    """Tangent of the output against a difference over a thousandth of the torque."""
    more = small_drive.to_torque(loaded, 1.001 * loaded.torque)
    slope = (loaded.rotation - more.rotation) / (0.001 * loaded.torque)
    # the curvature of the contacts is not in the frozen tangent
    assert loaded.compliance == pytest.approx(slope, rel=0.01)
    assert np.isnan(small_drive.hold_output(loaded).compliance)


def test_a_flexspline_turns_within_its_field(small_drive, deflected):
    """The predictor keeps the wave where it is and turns what it runs through."""
    pitch = 2.0 * np.pi / small_drive.teeth
    turned = small_drive.rotate_output(deflected, pitch)
    assert turned.wave_generator_angle == deflected.wave_generator_angle
    assert turned.rotation == pytest.approx(deflected.rotation + pitch)
    radius = np.linalg.norm(deflected.faces[..., :2], axis=-1)
    # one sector on, each stands where its neighbour stood
    found = np.linalg.norm(turned.faces[..., :2], axis=-1)
    assert np.abs(found[:-1] - radius[1:]).max() < 1e-9


@pytest.mark.slow
def test_map_in_space(small_design, small_pattern):
    """The pattern repeats and is its mirror image; the mean input torque is T/i."""
    given = small_pattern(small_design)
    assert given.free
    second, mirror = given.info["second_pitch"], given.info["mirror"]
    assert second["largest_difference_rad"] < 1e-4 * second["peak_to_peak_rad"]
    assert abs(mirror["difference_rad"]) < 1e-4 * second["peak_to_peak_rad"]
    loaded = np.abs(given.torque) > 0.9 * given.torque[-1]
    mean = given.input_torque.mean(axis=1)[loaded]
    assert mean == pytest.approx(given.torque[loaded] / small_design.ratio, rel=0.01)
    drive = fit_map(given)
    assert drive.level == "3d"
    # four positions alias the corners of the pattern
    assert drive.info["energy_check"]["strain_energy_relative"] < 0.01
    torsion = drive.mean_torsion(np.array(drive.ratings.rated_torque))
    zero = int(np.flatnonzero(given.torque == 0.0)[0])
    sampled = (given.output_error[zero] - given.output_error).mean(axis=1)
    wanted = np.interp(drive.ratings.rated_torque, given.torque, sampled)
    assert torsion == pytest.approx(wanted, rel=0.05)


def test_a_drive_without_a_cup_is_refused_in_space():
    """In one line; friction of the teeth is no reason."""
    design = Design.load("reference-2d").with_changes(
        {"friction.tooth_coefficient": 0.1}
    )
    with pytest.raises(DesignError) as caught:
        build_map(design, model="3d")
    lines = str(caught.value).splitlines()
    assert len(lines) == 1
    assert "reference-2d" in lines[0] and "[cup]" in lines[0]
