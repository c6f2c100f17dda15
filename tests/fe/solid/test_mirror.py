"""Mirror images of 3D equilibria."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.mirror import mirror_state
from swgjoint.fe.tolerances.perfect import PerfectSolid
from swgjoint.gear.wave_generators.wave_generator import has_mirror_symmetry

pytestmark = pytest.mark.fe


def test_the_mirror_image_of_an_equilibrium_is_one(small_drive, loaded):
    """The solver keeps the image under the opposite torque at the opposite angle."""
    image = small_drive.mirror(loaded)
    angle = small_drive.input_angle(image)
    assert angle == -small_drive.input_angle(loaded) != 0.0
    solved = small_drive.load(image, -loaded.torque, angle)
    assert solved.outcome.ok
    # the equilibrium itself was solved to increments of 1e-10 m
    assert solved.history[0] < 1e-9
    moved = small_drive.output_angle(small_drive.to_torque(loaded, 0.9 * loaded.torque))
    apart = small_drive.output_angle(solved) + small_drive.output_angle(loaded)
    assert abs(apart) < 1e-6 * abs(moved - small_drive.output_angle(loaded))
    assert solved.energy == pytest.approx(loaded.energy, rel=1e-9)
    # it follows from a tangent that is kept over the last micrometre
    assert solved.compliance == pytest.approx(loaded.compliance, rel=1e-3)
    assert small_drive.input_torque(solved) == pytest.approx(
        -small_drive.input_torque(loaded), rel=1e-6
    )
    # the figures of the image are those of the equilibrium that is solved from it
    for key in ("torque", "wave_generator_torque", "tooth_moment", "energy"):
        assert getattr(image, key) == pytest.approx(getattr(solved, key), rel=1e-6)


def test_an_unmirrored_state_is_no_equilibrium_under_the_opposite_torque(
    small_drive, loaded
):
    """The law above tells a state from its image."""
    start = small_drive.predict(loaded, -small_drive.input_angle(loaded))
    solved = small_drive.load(start, -loaded.torque, small_drive.input_angle(start))
    assert solved.history[0] > 1e-6


def test_mirrored_contacts_are_those_that_the_search_finds(small_drive, loaded):
    """Derivatives and lever arms of the image's contacts, row by row."""
    image = small_drive.mirror(loaded)
    angle = small_drive.input_angle(image)
    found = small_drive.load(image, -loaded.torque, angle).held

    def order(rows):
        c = rows.contacts
        return np.lexsort([rows.z, c.station, c.side, c.sector])

    one, other = (rows.chosen(order(rows)) for rows in (image.held, found))
    assert (one.contacts.sector == other.contacts.sector).all()
    assert (one.contacts.tooth == other.contacts.tooth).all()
    for key in ("weight", "circular_spline_weight", "rows", "arm"):
        mine, theirs = getattr(one, key), getattr(other, key)
        assert np.abs(mine - theirs).max() < 1e-3 * np.abs(theirs).max()


def test_mirrored_twice_is_the_same(small_drive, loaded):
    """Every array comes back."""
    again = small_drive.mirror(small_drive.mirror(loaded))
    for key in ("faces", "inside", "pressure", "bore_force", "flank_force"):
        assert np.abs(getattr(again, key) - getattr(loaded, key)).max() < 1e-15
    assert (again.touching == loaded.touching).all()
    assert (again.shared == loaded.shared).all()
    assert (again.circular_spline_force == loaded.circular_spline_force).all()


def test_whole_drive_is_mirrored_as_its_half(small_design, few_masters, loaded):
    """Both halves of an image are the image of both halves."""
    whole = solid_sector_model(small_design, orders=few_masters)
    half = solid_sector_model(small_design, half=True, orders=few_masters, like=whole)
    one = mirror_state(half, loaded).of_both_halves()
    other = mirror_state(whole, loaded.of_both_halves())
    for key in ("faces", "inside", "pressure", "flank_force"):
        mine, theirs = getattr(one, key), getattr(other, key)
        assert np.abs(mine - theirs).max() < 1e-12 * np.abs(theirs).max()
    assert (one.circular_spline_force == other.circular_spline_force).all()


@pytest.mark.slow
def test_negative_torques_are_images_of_positive_ones(small_design, small_drive):
    """Half as many solves, with the results of solving both signs."""
    assert has_mirror_symmetry(small_design)
    levels = np.array([4.0, 20.0])
    perfect = PerfectSolid.from_design(small_design, 4)
    assert perfect.symmetric
    both = replace(perfect, symmetric=False)
    found = perfect.under_both_signs(levels)
    wanted = both.under_both_signs(levels)
    one, other = perfect.table(found, levels), both.table(wanted, levels)
    apart = np.abs(one - other).max(axis=(1, 2))
    assert (apart < 1e-6 * np.ptp(other, axis=(1, 2))).all()
    for k, states in enumerate(found):
        assert states.keys() == wanted[k].keys()
