"""Fields of the flexspline: interpolation, the whole ring, the file."""

from __future__ import annotations

import io
import zipfile
from dataclasses import fields, replace

import numpy as np
import pytest
from messages import naming

from swgjoint.errors import MapFileError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fields import DriveFields
from swgjoint.maps.file import map_bytes, map_from_bytes

TEETH, PLACES = 40, 80
TORQUE = np.array([-10.0, 0.0, 20.0])
FIRST = np.array([0.01, 0.0, -0.02])


def moved(place, torque):
    """Displacement of a node: an oval that a torque winds up, linear in it."""
    oval = np.stack(
        [
            -5e-4 * np.sin(2.0 * place),
            *np.array([[1e-3], [1e-4]]) * np.cos(2.0 * place),
        ],
        axis=-1,
    )
    return oval + np.multiply.outer(torque, np.array([1e-6, 0.0, 0.0]))


@pytest.fixture
def shown():
    """Two nodes of a tooth, one triangle that is flat, half a turn."""
    place = np.pi * np.arange(PLACES) / PLACES
    u = np.stack(
        [moved(place + first, t) for first, t in zip(FIRST, TORQUE, strict=True)]
    )
    both = np.stack([u, u], axis=2)
    force = np.stack([np.cos(2 * place), np.ones(PLACES), 0.0 * place], axis=-1)
    by_torque = TORQUE[:, None, None] * force
    return DriveFields(
        torque=TORQUE,
        first_place=FIRST,
        period=np.pi,
        points=np.array([[-1e-3, 0.06, 0.0], [1e-3, 0.06, 0.0]]),
        triangles=np.array([[0, 1, 1]]),
        displacement=both,
        von_mises=np.abs(both[..., 0]) * 1e11,
        tooth_force=by_torque,
        wave_generator_force=-by_torque,
        wave_generator=np.array([[0.0, 0.06], [0.0, -0.06]]),
        circular_spline=np.array([[0.0, 0.061], [0.001, 0.062]]),
    )


def test_samples_come_back_and_places_between_are_near(shown):
    """Exact at samples; a step of the place errs by its square."""
    place = np.pi / PLACES * np.array([0.0, 7.0, 7.5, PLACES + 3.0, -2.0]) - 0.02
    u, stress, tooth, bore = shown.evaluate_at(place, 20.0)
    error = np.abs(u[:, 0] - moved(place, 20.0)).max(axis=1)
    # single precision of a millimetre
    assert error[[0, 1, 3, 4]] == pytest.approx(0.0, abs=1e-9)
    assert 0.0 < error[2] <= 1e-3 * (2.0 * np.pi / PLACES) ** 2 / 8.0 * 1.01
    assert stress.shape == (5, 2)
    assert bore == pytest.approx(-tooth)


def test_beyond_the_torques_the_last_ones_hold(shown):
    """No extrapolation of a picture."""
    place = np.array([0.3])
    assert shown.evaluate_at(place, 99.0)[0] == pytest.approx(
        shown.evaluate_at(place, 20.0)[0]
    )
    assert shown.evaluate_at(place, -99.0)[0] == pytest.approx(
        shown.evaluate_at(place, -10.0)[0]
    )


def test_the_picture_turns_with_everything(shown):
    """Wave generator and flexspline turned alike: the same shape, turned."""
    one = shown.flexspline(TEETH, 0.2, 0.5, 5.0)
    other = shown.flexspline(TEETH, 0.2 + 0.7, 0.5 + 0.7, 5.0)
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    for key in ("points", "tooth_force", "wave_generator_force"):
        expected = pytest.approx(getattr(one, key) @ turn.T, rel=1e-5, abs=1e-5)
        assert getattr(other, key) == expected
    assert other.points == pytest.approx(one.points @ turn.T, abs=1e-7)
    assert other.von_mises == pytest.approx(one.von_mises, rel=1e-5)
    # the oval follows the wave generator: farthest out at its lobes
    radius = np.hypot(*one.points.mean(axis=1)[:, :2].T)
    out = 2.0 * np.pi / TEETH * radius.argmax() + 0.2 - 0.5
    assert abs((out + np.pi / 2) % np.pi - np.pi / 2) <= np.pi / TEETH


@pytest.mark.parametrize(
    ("key", "change", "says"),
    [
        ("period", lambda v: 7.0, ("period", "7.0 rad", "0", "turn")),
        ("torque", lambda v: v[::-1], ("fields", "torque", "[N·m]")),
        ("triangles", lambda v: v + 1, ("fields", "triangles", "nodes")),
        (
            "displacement",
            lambda v: v[:, :-1],
            ("fields", "von_mises", "(3, 80, 2)", "79"),
        ),
        ("von_mises", lambda v: v * np.nan, ("fields", "von_mises", "finite")),
        (
            "tooth_force",
            lambda v: v[..., :2],
            ("fields", "tooth_force", "(3, 80, 2)", "3 3"),
        ),
    ],
)
def test_unsound_fields_are_refused(shown, key, change, says):
    """Shapes that disagree, values that are not finite, nodes that are not there."""
    with pytest.raises(ValueError, match=naming(*says)):
        replace(shown, **{key: change(getattr(shown, key))})


def test_half_of_an_even_flexspline_is_enough(shown):
    """Turned by half a turn it is the other half; not with odd teeth or one lobe."""
    assert shown.repeats(TEETH) == 2
    assert shown.repeats(TEETH + 1) == 1
    assert replace(shown, period=2.0 * np.pi).repeats(TEETH) == 1
    whole = shown.flexspline(TEETH, 0.2, 0.5, 5.0)
    half = shown.flexspline(TEETH, 0.2, 0.5, 5.0, parts=2)
    turned = np.concatenate([half.points, half.points * np.float32([-1, -1, 1])])
    np.testing.assert_allclose(whole.points, turned, atol=1e-7)  # float32
    stress = np.concatenate([half.von_mises, half.von_mises])
    np.testing.assert_allclose(whole.von_mises, stress, rtol=1e-4)


def test_a_file_keeps_them(synthetic_map, shown, tmp_path):
    """Bit for bit; a map without has none."""
    drive = replace(synthetic_map, fields=shown)
    drive.save(tmp_path / "a.swg")
    found = DriveMap.load(tmp_path / "a.swg").fields
    for part in fields(DriveFields):
        was, now = getattr(shown, part.name), getattr(found, part.name)
        assert np.array_equal(now, was)
    assert map_from_bytes(map_bytes(synthetic_map), DriveMap).fields is None


@pytest.mark.parametrize("leave_out", ["fields_torque.npy", "fields_points.npy"])
def test_a_file_with_some_of_them_is_refused(synthetic_map, shown, leave_out):
    """All arrays or none."""
    data = map_bytes(replace(synthetic_map, fields=shown))
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            if name != leave_out:
                new.writestr(name, old.read(name))
    with pytest.raises(
        MapFileError,
        match=naming(
            "15",
            "header.npy",
            "orders.npy",
            "torsion_knots.npy",
            "potential.npy",
            "end_stiffness.npy",
            "kinematic_error.npy",
        ),
    ):
        map_from_bytes(out.getvalue(), DriveMap)
