"""Catalogue drives: the procedures measure on the map what the tables state."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from messages import names, naming

from swgjoint.errors import InputError
from swgjoint.gear import catalogue_stated
from swgjoint.gear.catalogue import catalogue_rows, table
from swgjoint.gear.catalogue_stated import _faults
from swgjoint.gear.kinematics import LAYOUTS
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.file import map_bytes, map_from_bytes
from swgjoint.maps.fit.error_spectrum import with_assumed_error
from swgjoint.maps.from_catalogue import (
    catalogue_names,
    is_catalogue_name,
    three_lines,
    with_stated_error,
)
from swgjoint.maps.torsion_law import potential_of_stiffness, torque_at_knots

drive_of = cache(DriveMap.from_catalogue)
"""A drive as several tests measure it; making one takes longer than many a figure."""


def one_of_each_spring() -> list[str]:
    """Names whose stiffness rows differ; ratios of one class share their row."""
    found = {}
    for name in catalogue_names():
        series, size, ratio = name.split("-")
        found[series, size, max(c for c in (30, 50, 80) if c <= int(ratio))] = name
    return list(found.values())


@pytest.mark.parametrize("name", catalogue_names())
def test_the_loop_returns_the_stiffness_of_the_row(name):
    """K1 to K3 and hysteresis loss measured on the loop are the tables' within 2 %."""
    drive = drive_of(name)
    sheet = drive.spec_sheet(["K1_Nm_rad", "K2_Nm_rad", "K3_Nm_rad", "T1_Nm", "T2_Nm"])
    _, size, ratio = name.split("-")
    ratio_class = max(c for c in (30, 50, 80) if c <= int(ratio))
    row = next(
        row
        for row in table("stiffness")
        if (row["size"], row["ratio_class"]) == (int(size), ratio_class)
    )
    for k in ("K1", "K2", "K3"):
        stated = 1e4 * row[f"{k}_1e4Nm_rad"]
        assert sheet[f"{k}_Nm_rad"] == pytest.approx(stated, rel=0.02)
    assert (sheet["T1_Nm"], sheet["T2_Nm"]) == (row["T1_Nm"], row["T2_Nm"])
    loss = drive.info["stated"]["hysteresis_loss_arcmin"]
    assert bool(drive.hysteresis) == (loss is not None) == name.startswith("CHA")
    if loss:
        sheet = drive.spec_sheet(["hysteresis_loss_arcmin"])
        assert sheet["hysteresis_loss_arcmin"] == pytest.approx(loss, rel=0.02)
        assert "upper bound" in sheet["validity"]["hysteresis"]
    assert drive.ratio == -int(ratio)


def test_torsion_at_the_limits_by_hand():
    """CSG-25-100: T1/K1 = 1.553 arcmin at 14 N·m, 3.89 arcmin at 48 N·m, odd."""
    drive = DriveMap.from_catalogue("CSG-25-100")
    arcmin = np.pi / 10800
    for sign in (1, -1):
        # the corners are rounded: the curve lies beside them by less than 1 %
        at_T1, at_T2 = (drive.mean_torsion(sign * T) / arcmin for T in (14.0, 48.0))
        assert at_T1 == pytest.approx(sign * 1.5525, rel=0.01)
        assert at_T2 == pytest.approx(sign * (1.5525 + 2.3377), rel=0.01)
        # beyond the corner it runs on the line of the catalogue
        far = sign * (1.5525 + 2.3377 + 52.0 / 5.7e4 / arcmin)
        assert drive.mean_torsion(sign * 100.0) / arcmin == pytest.approx(far, rel=1e-4)


def test_map_is_sound_and_reaches_the_momentary_peak():
    """A catalogue map passes the checks of the file and is stored without loss."""
    whole = one_of_each_spring()
    for name in catalogue_names():
        drive = drive_of(name)
        if name in whole:
            stored = map_bytes(drive)
            assert map_bytes(map_from_bytes(stored, DriveMap)) == stored
        assert drive.torque_range[1] >= drive.ratings.momentary_peak * (1 - 1e-12)


def turn_of(drive: DriveMap) -> np.ndarray:
    """e0 over one turn of the output, from the cosines and sines by hand [arcmin]."""
    psi = np.linspace(0.0, 2.0 * np.pi, 400_001)
    angle = np.outer(drive.angle_orders[:, 0], drive.ratio * psi)
    angle += np.outer(drive.angle_orders[:, 1], psi)
    a, b = drive.kinematic_error.T
    return (a @ np.cos(angle) + b @ np.sin(angle)) * 10800.0 / np.pi


@pytest.mark.parametrize("name", ["CSG-14-50", "CSG-25-100", "CHA-32-160"])
def test_the_kinematic_error_is_the_stated_accuracy(name):
    """Peak to peak of e0 over one output turn, and on the sheet, is what is stated."""
    drive = drive_of(name)
    stated = drive.info["stated"]["transmission_accuracy_arcmin"]
    assert np.ptp(turn_of(drive)) == pytest.approx(stated, rel=2e-5)
    per_input_turn = drive.angle_orders[1:]
    assert sorted(map(tuple, per_input_turn.tolist())) == [(2, 0), (4, 0)]
    sheet = drive.spec_sheet(["transmission_accuracy_arcmin", "ripple_pp_percent"])
    assert sheet["transmission_accuracy_arcmin"] == pytest.approx(stated, rel=1e-3)
    assert sheet["ripple_pp_percent"] > 1.0 and sheet["missing"] == {}
    label = sheet["validity"]["kinematic_error"]
    assert names(label, "assumed", f"{stated:g} arcmin", "2 and 4", "seed 0")
    assert label == drive.info["kinematic_error"]


def test_the_seed_draws_share_and_phases():
    """Specimens of two seeds differ in both and agree in size, of one in nothing."""
    one, same, other = (
        DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=2.5, seed=seed)
        for seed in (3, 3, 4)
    )
    assert np.array_equal(one.kinematic_error, same.kinematic_error)
    sizes = [np.hypot(*drive.kinematic_error[1:].T) for drive in (one, other)]
    assert all(0.25 <= size[1] / size[0] <= 0.75 for size in sizes)
    assert abs(sizes[0][1] / sizes[0][0] - sizes[1][1] / sizes[1][0]) > 1e-3
    for drive, seed in ((one, 3), (other, 4)):
        assert np.ptp(turn_of(drive)) == pytest.approx(2.5, rel=2e-5)
        assert names(drive.info["kinematic_error"], "2.5 arcmin", f"seed {seed}")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_an_assumed_error_repeats_with_the_input(layout):
    """Of any layout it depends on the input alone, and a joint's name moves it."""
    plain = replace(DriveMap.linear(1e4), layout=layout)
    drives = [
        with_assumed_error(plain, 1e-4, seed=1, joint=joint)
        for joint in ("", "elbow", "wrist")
    ]
    errors = [drive.kinematic_error for drive in drives]
    assert not np.array_equal(errors[0], errors[1])
    assert not np.array_equal(errors[1], errors[2])
    theta = np.linspace(0.0, 2.0 * np.pi, 20_001)
    for drive in drives:
        e0 = [drive.error_at(drive.phases(theta, psi))[0] for psi in (0.0, 1.234)]
        assert np.allclose(e0[0], e0[1], rtol=0, atol=1e-18)
        assert np.ptp(e0[0]) == pytest.approx(1e-4, rel=1e-6)
    assert names(drives[1].info["kinematic_error"], "assumed", "seed 1", "elbow")


def test_without_a_stated_accuracy_there_is_no_error():
    """The record says that the tables state none; a value of one's own is taken."""
    drive = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0)
    stated = drive.info["stated"] | {"transmission_accuracy_arcmin": None}
    silent = replace(drive, info={**drive.info, "stated": stated})
    left = with_stated_error(silent)
    assert not left.kinematic_error.any()
    assert names(left.info["kinematic_error"], "none", "accuracy", "CSG-25-100")
    assert with_stated_error(silent, 2.0).kinematic_error.any()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"kinematic_error_arcmin": -1.0}, ("-1", "0", "60 arcmin")),
        ({"kinematic_error_arcmin": 61.0}, ("61", "0", "60 arcmin")),
        ({"kinematic_error_arcmin": float("nan")}, ("nan", "60 arcmin")),
        ({"seed": -1}, ("seed", "-1", ">= 0")),
        ({"seed": 1.5}, ("seed", "1.5", ">= 0")),
    ],
)
def test_options_out_of_range(options, words):
    """A negative or absurd error and a seed that is none are refused in a line."""
    with pytest.raises(InputError, match=naming(*words)):
        DriveMap.from_catalogue("CSG-25-100", **options)


def test_what_is_switched_off_is_told():
    """Without error the sheet has null and the catalogue's bound as reason."""
    drive = DriveMap.from_catalogue("CSG-14-50", kinematic_error_arcmin=0)
    assert not drive.kinematic_error.any() and len(drive.orders) == 1
    assert drive.info["stated"]["transmission_accuracy_arcmin"] == 1.5
    sheet = drive.spec_sheet()
    assert sheet["transmission_accuracy_arcmin"] is None
    assert "1.5 arcmin" in sheet["missing"]["transmission_accuracy_arcmin"]
    assert sheet["hysteresis_loss_arcmin"] is None
    assert "conservative" in sheet["missing"]["hysteresis_loss_arcmin"]
    assert drive.info["stated"]["input_inertia_kgm2"] == pytest.approx(3.3e-6)


def test_lost_motion_is_not_above_the_bound_of_the_size():
    """The elastic lost motion stays below the one arcmin that the tables bound."""
    bounds = {row["size"]: row["lost_motion_arcmin"] for row in table("accuracy")[:15]}
    for name in one_of_each_spring():
        lost = drive_of(name).spec_sheet(["lost_motion_arcmin"])
        assert 0 < lost["lost_motion_arcmin"] <= bounds[int(name.split("-")[1])]


def catalogue_faults() -> list[str]:
    """Contradictions in the shipped tables, one line each; none in a sound release.

    K1 < K2 < K3 and T1 < T2; torsion T1/K1 similar over the sizes of a ratio class;
    rated <= repeated peak <= momentary peak, T2 below the repeated peak.
    """
    faults = [
        fault for row in catalogue_stated.table("stiffness") for fault in _faults(row)
    ]
    for row in catalogue_rows():
        if not row.rated_torque <= row.repeated_peak <= row.momentary_peak:
            faults.append(f"{row.name}: torques of ratings.csv do not increase")
        if row.T2 >= row.repeated_peak:
            faults.append(f"{row.name}: T2 {row.T2:g} N·m is above the repeated peak")
    return faults


def test_tables_agree_with_themselves(monkeypatch):
    """The shipped tables have no contradiction; a swapped or misplaced digit is one."""
    assert catalogue_faults() == []
    rows = table("stiffness")
    for key, value, parts in (
        ("K2_1e4Nm_rad", 0.3, ("K1 < K2 < K3", "0.47, 0.3, 0.71")),
        ("K1_1e4Nm_rad", 0.0047, ("T1/K1", "98.3", "1.6")),
        ("T2_Nm", 1.0, ("T1 < T2", "2, 1 N·m")),
    ):
        row = next(r for r in rows if (r["size"], r["ratio_class"]) == (14, 80))
        changed = tuple({**r, key: value} if r is row else r for r in rows)
        monkeypatch.setattr(
            catalogue_stated,
            "table",
            lambda name, c=changed: c if name[0] == "s" else table(name),
        )
        assert any(names(fault, *parts) for fault in catalogue_faults())
        with pytest.raises(
            InputError, match=naming("stiffness.csv", "14", "80", *parts)
        ):
            DriveMap.from_catalogue("CSG-14-100")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("CSG-26-100", ["ratings.csv", "CSG-25-100"]),
        ("CSG-25-70", ["CSG-25-80"]),
        ("SHG-25-100", ["ratings", "CHA", "CSG", "CSG-25-100"]),
        ("CHA-26-100", ["ratings.csv", "CHA-25-100"]),
        ("csg25", ["SERIES-SIZE-RATIO", "CSG-25-100"]),
        ("", ["SERIES-SIZE-RATIO"]),
    ],
)
def test_unknown_names(name, words):
    """A name without a row is refused in one line with the nearest ones."""
    with pytest.raises(InputError) as caught:
        DriveMap.from_catalogue(name)
    assert names(str(caught.value), repr(name), *words)
    assert "\n" not in str(caught.value)


def test_names_are_told_from_designs():
    """A series with a number is the catalogue in any case; a design or file is not."""
    assert DriveMap.from_catalogue(" csg-25-100 ").name == "CSG-25-100"
    for text in ("CSG-25-100", "csg-8-30", "CHA-25-100", "hfuc20", "CSG"):
        assert is_catalogue_name(text)
    for text in ("size-25-100", "reference-2d", "csg.toml", "chain", "shg/a.toml"):
        assert not is_catalogue_name(text)


def test_potential_is_the_integral_of_the_stiffness():
    """Torque and energy of the law against quadrature of a stiffness by hand."""
    knots, stiffness = three_lines(10.0, 30.0, 1e4, 2e4, 3e4, largest=90.0)
    potential, ends = potential_of_stiffness(knots, stiffness)
    assert list(ends[0, 0]) == [3e4, 3e4]
    x = np.linspace(0.0, knots[-1], 200_001)
    k = np.interp(x, knots, stiffness)
    step = x[1]
    torque = np.concatenate([[0.0], np.cumsum(0.5 * (k[1:] + k[:-1]) * step)])
    energy = np.concatenate([[0.0], np.cumsum(0.5 * (torque[1:] + torque[:-1]) * step)])
    drive = DriveMap.linear(1e4)
    fields = {key: getattr(drive, key) for key in drive.__dataclass_fields__}
    fields |= {"torsion_knots": knots, "potential": potential, "end_stiffness": ends}
    drive = DriveMap(**fields)
    for sign in (1, -1):
        ours = drive.coefficients(sign * x, 1)[:, 0, 0]
        assert np.abs(ours - sign * torque).max() < 1e-6 * torque[-1]
        ours = drive.coefficients(sign * x, 0)[:, 0, 0]
        assert np.abs(ours - energy).max() < 1e-6 * energy[-1]
    assert torque_at_knots(knots, stiffness)[-1] == pytest.approx(90.0, rel=1e-12)


def test_law_starts_at_zero_inside_a_bend():
    """V and T vanish at zero torsion also where the stiffness changes there."""
    knots, stiffness = np.array([-0.3, 0.2, 0.5]), np.array([1.0, 4.0, 2.0])
    potential, _ = potential_of_stiffness(knots, stiffness)
    # k = 2.8 + 6 x on the first piece: V = 1.4 x^2 + x^3 by hand
    at = np.polynomial.polynomial.polyval(np.array([0.0, 0.3, 0.5]), potential[0, 0, 0])
    x = np.array([-0.3, 0.0, 0.2])
    assert at == pytest.approx(1.4 * x**2 + x**3, abs=1e-15)
    assert torque_at_knots(knots, stiffness)[1] == pytest.approx(0.56 + 0.12)
