"""Maps from measurements: what a known map was made to show comes back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import names, naming

from swgjoint.errors import InputError
from swgjoint.gear.ratings import Ratings
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.file import map_bytes
from swgjoint.maps.fit.torsion_fit import REACHES, fit_torsion
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.maps.sheet.loop import TorqueLoop, torque_loop
from swgjoint.units import arcmin, deg

TEETH = {"teeth_flexspline": 120, "teeth_circular_spline": 122}


def write(path, header, *columns, comment="# rig 3\n"):
    rows = "\n".join(
        ",".join(f"{v:.17g}" for v in row) for row in zip(*columns, strict=True)
    )
    path.write_text(f"{comment}{header}\n{rows}\n")
    return path


def hysteresis_loop(drive, *, width=0.0, noise=0.0, shift=0.0, top=100.0, n=300):
    """Torque and torsion of a loop about the mean curve of a map, twice around."""
    rng = np.random.default_rng(11)
    lap = np.concatenate([np.linspace(-top, top, n), np.linspace(top, -top, n)])
    torque = np.concatenate([lap, lap])
    x = np.array([drive.mean_torsion(T) for T in lap])
    x = np.concatenate([x, x]) + shift
    # the branches meet where the torque turns
    x += (
        np.where(np.gradient(torque) > 0, -0.5, 0.5) * width * (1 - (torque / top) ** 2)
    )
    return torque, x + noise * rng.standard_normal(x.size)


@pytest.mark.parametrize("unit", ["arcmin", "rad"])
def test_a_known_curve_comes_back(synthetic_map, tmp_path, unit):
    """Torque over torsion within 0.2 % of the peak, although the zero is off."""
    drive = synthetic_map.with_harmonics([True] + [False] * 4)
    torque, x = hysteresis_loop(drive, shift=2e-3, n=301)
    factor = arcmin if unit == "arcmin" else 1.0
    path = write(tmp_path / "a.csv", f"torque_Nm,torsion_{unit}", torque, x / factor)
    found = DriveMap.from_measurement(path, ratings=synthetic_map.ratings, **TEETH)
    inside = np.linspace(*found.torsion_knots[[0, -1]], 300)
    ours = found.coefficients(inside, 1)[:, 0, 0]
    wanted = drive.coefficients(inside, 1)[:, 0, 0]
    assert np.abs(ours - wanted).max() < 0.002 * 100.0
    report = found.info["fit"]["torsion"]
    assert found.hysteresis == ()
    assert report["torsion_at_zero_torque_arcmin"] == pytest.approx(
        2e-3 / arcmin, rel=1e-3
    )
    assert report["residual_max_Nm"] < 0.2
    assert found.coefficients(0.0, 1)[0, 0] == pytest.approx(0.0, abs=1e-9)
    map_bytes(found)


SHEET = (
    "K1_Nm_rad",
    "K2_Nm_rad",
    "K3_Nm_rad",
    "hysteresis_loss_arcmin",
    "lost_motion_arcmin",
)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_catalogue_drive_comes_back(tmp_path, noise):
    """The loop of a known map with hysteresis gives its sheet within 2 %.

    Twice around, zero off; noise 0.02 arcmin of a loop one arcmin wide. The yield
    torque comes back within 2 %, too, although no element that is tried has the yield
    torsion of the map.
    """
    drive = DriveMap.from_catalogue("CHA-25-100")
    loop = torque_loop(drive)
    rng = np.random.default_rng(3)
    torque, x = np.tile(loop.torque, 2), np.tile(loop.torsion, 2) + 1e-3
    x += noise * arcmin * rng.standard_normal(x.size)
    path = write(tmp_path / "a.csv", "torque_Nm,torsion_rad", torque, x)
    found = DriveMap.from_measurement(
        path,
        teeth_flexspline=200,
        teeth_circular_spline=202,
        ratings=drive.ratings,
    )
    wanted, ours = drive.spec_sheet(SHEET), found.spec_sheet(SHEET)
    for key in SHEET:
        assert ours[key] == pytest.approx(wanted[key], rel=0.02)
    report = found.info["fit"]["torsion"]
    [element] = drive.hysteresis
    assert report["yield_torque_Nm"] == pytest.approx(element.yield_torque, rel=0.02)
    # what the spring without elements leaves is the half width of the loop
    assert report["residual_rms_without_hysteresis_Nm"] > 0.9 * element.yield_torque
    stiffness = report["residual_rms_Nm"] / (report["residual_rms_arcmin"] * arcmin)
    assert 3e4 < stiffness < 7e4
    assert report["residual_rms_arcmin"] < max(0.01, 1.3 * noise)
    played = ours["hysteresis_loss_arcmin"]
    assert report["hysteresis_loss_map_arcmin"] == pytest.approx(played)
    assert "arcmin wide" in found.spec_sheet(["T1_Nm"])["validity"]["hysteresis"]
    map_bytes(found)


def test_one_lap_of_few_samples_is_enough(tmp_path):
    """60 samples from rest, once around: the sheet comes back within 2 %."""
    drive = replace(
        DriveMap.linear(2e4, rated_torque=50.0, **TEETH),
        hysteresis=(
            Jenkin(stiffness=1e4, yield_torque=1.0),
            Jenkin(stiffness=2e4, yield_torque=2.0),
        ),
    )
    loop = torque_loop(drive)
    keep = np.arange(0, loop.torque.size, 6)
    path = write(
        tmp_path / "a.csv",
        "torque_Nm,torsion_rad",
        loop.torque[keep],
        loop.torsion[keep],
    )
    found = DriveMap.from_measurement(path, ratings=drive.ratings, **TEETH)
    wanted, ours = drive.spec_sheet(SHEET), found.spec_sheet(SHEET)
    for key in SHEET:
        assert ours[key] == pytest.approx(wanted[key], rel=0.02)


def test_round_off_does_not_choose_the_elements():
    """Samples farther apart than most yield torsions: the fit is still unique."""
    drive = replace(
        DriveMap.linear(2e4, rated_torque=50.0, **TEETH),
        hysteresis=(Jenkin(stiffness=2e4, yield_torque=2.0),),
    )
    loop = torque_loop(drive)
    keep = np.arange(0, loop.torque.size, 6)
    fits = [
        fit_torsion(
            replace(
                loop,
                torque=loop.torque[keep]
                * (1.0 + 1e-13 * rng.standard_normal(len(keep))),
                torsion=loop.torsion[keep],
            )
        )
        for rng in map(np.random.default_rng, range(4))
    ]
    assert len(fits[0].yields) < len(REACHES)
    for fit in fits[1:]:
        np.testing.assert_allclose(fit.yields, fits[0].yields, rtol=1e-6, atol=1e-9)


def test_a_lens_is_many_elements(tmp_path):
    """A loop with parabolic branches about a line (Rayleigh) is followed throughout."""
    drive = DriveMap.linear(2e4, rated_torque=50.0, **TEETH)
    torque, x = hysteresis_loop(drive, width=2e-4)
    path = write(tmp_path / "a.csv", "torque_Nm,torsion_rad", torque, x)
    found = DriveMap.from_measurement(path, ratings=drive.ratings, **TEETH)
    wanted, ours = drive.spec_sheet(SHEET), found.spec_sheet(SHEET)
    for key in SHEET[:3]:
        assert ours[key] == pytest.approx(wanted[key], rel=0.03)
    assert ours[SHEET[3]] == pytest.approx(2e-4 / arcmin, rel=0.05)
    assert len(found.hysteresis) > 2
    assert found.info["fit"]["torsion"]["residual_rms_Nm"] < 0.1


def test_the_curve_is_monotone_whatever_the_noise(synthetic_map, tmp_path):
    """Stiffness stays positive with noise as large as a tenth of the travel."""
    drive = synthetic_map.with_harmonics([True] + [False] * 4)
    torque, x = hysteresis_loop(drive, noise=5e-4, n=40)
    path = write(tmp_path / "a.csv", "torque_Nm,torsion_rad", torque, x)
    found = DriveMap.from_measurement(path, ratings=50.0, **TEETH)
    x = np.linspace(*(1.2 * found.torsion_knots[[0, -1]]), 500)
    assert (found.coefficients(x, 2)[:, 0, 0] > 0).all()
    assert "0.2 and 0.6 of rated" in found.ratings.source


def error_record(drive, n=20_000, noise=0.0):
    """Output angle and error [rad] of one output turn, unloaded, unequal steps."""
    rng = np.random.default_rng(4)
    theta = np.sort(rng.uniform(0.0, 2 * np.pi * abs(drive.ratio), n))
    theta[[0, -1]] = 0.0, 2 * np.pi * abs(drive.ratio)
    psi = output_angle(drive, theta, 0.0)
    return psi, psi - theta / drive.ratio + noise * rng.standard_normal(n) + 3e-4


def test_harmonics_come_back(tmp_path):
    """Amplitude and phase of every order of alpha and beta, from output and error."""
    orders = [(0, 0), (2, 0), (4, 0), (0, 2), (3, 1)]
    rng = np.random.default_rng(1)
    amplitudes = np.concatenate([[[0, 0]], 3e-5 * rng.uniform(0.2, 1, (4, 2))])
    linear = DriveMap.linear(2e4, **TEETH)
    fields = {k: getattr(linear, k) for k in linear.__dataclass_fields__}
    potential = np.zeros((5, *linear.potential.shape[1:]))
    ends = np.zeros((5, 2, 2))
    potential[0], ends[0] = linear.potential[0], linear.end_stiffness[0]
    fields |= {
        "orders": np.array(orders),
        "kinematic_error": amplitudes,
        "potential": potential,
        "end_stiffness": ends,
    }
    drive = DriveMap(**fields)
    loop = write(
        tmp_path / "loop.csv", "torque_Nm,torsion_rad", *hysteresis_loop(drive)
    )
    psi, error = error_record(drive)
    record = write(
        tmp_path / "error.csv",
        "time_s,output_deg,error_arcmin",
        np.arange(psi.size),
        psi / deg,
        error / arcmin,
    )
    found = DriveMap.from_measurement(
        loop,
        kinematic_error=record,
        ratings=drive.ratings,
        orders=[(1, 0), *orders[1:], (122, 0), (0, 5)],
        **TEETH,
    )
    assert [tuple(pq) for pq in found.orders] == [(0, 0), *orders[1:]]
    assert np.abs(found.kinematic_error - amplitudes).max() < 1e-10
    report = found.info["fit"]["kinematic_error"]
    assert report["residual_max_arcmin"] < 1e-6
    assert [(d["alpha"], d["beta"]) for d in report["dropped"]] == [
        (1, 0),
        (122, 0),
        (0, 5),
    ]
    key = "transmission_accuracy_arcmin"
    assert found.spec_sheet([key])[key] == pytest.approx(drive.spec_sheet([key])[key])


@pytest.mark.parametrize(("noise", "told"), [(0.05, 0), (0.3, 1)])
def test_what_the_harmonics_leave_of_an_error_is_said(tmp_path, noise, told):
    """Noise of 5 % of the rms of the record is silent, noise of 30 % is one line."""
    drive = DriveMap.from_numbers(
        stiffness=2e4, rated_torque=50.0, ratio=60, kinematic_error={2: 1.0}
    )
    loop = write(
        tmp_path / "loop.csv", "torque_Nm,torsion_rad", *hysteresis_loop(drive)
    )
    psi, error = error_record(drive)
    error = error + noise * error.std() * np.random.default_rng(2).normal(size=psi.size)
    record = write(
        tmp_path / "e.csv", "output_deg,error_arcmin", psi / deg, error / arcmin
    )
    found = DriveMap.from_measurement(
        loop, kinematic_error=record, ratings=50.0, **TEETH
    )
    lines = [one for one in found.info["fit"]["loop"]["warnings"] if "leave" in one]
    assert len(lines) == told
    assert all(names(line, "kinematic error", "29%") for line in lines)


def test_orders_that_the_samples_cannot_tell_are_listed(synthetic_map, tmp_path):
    """A coarse record gives the low orders and says which it cannot carry."""
    drive = synthetic_map.with_harmonics([True, True, True, False, False])
    loop = write(
        tmp_path / "loop.csv", "torque_Nm,torsion_rad", *hysteresis_loop(drive)
    )
    psi, error = error_record(drive, n=2000)
    record = write(
        tmp_path / "e.csv", "output_deg,error_arcmin", psi / deg, error / arcmin
    )
    found = DriveMap.from_measurement(
        loop,
        kinematic_error=record,
        ratings=50.0,
        orders=[(2, 0), (4, 0), (122, 0)],
        **TEETH,
    )
    assert found.info["fit"]["kinematic_error"]["unresolved"] == [[122, 0]]
    told = found.info["fit"]["loop"]["warnings"]
    # 2.5 samples for each of the 122 waves of 60 turns of the input
    (line,) = [one for one in told if names(one, "122:0")]
    assert names(line, "kinematic error", "2000 samples", "need 18300")
    assert [tuple(pq) for pq in found.orders] == [(0, 0), (2, 0), (4, 0)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("torque_Nm,torsion\n1,2\n", ("torsion_arcmin", "torsion_rad", "'torsion'")),
        ("torque_Nm,torsion_rad\n1,2\n3\n", ("line 3", "1", "2")),
        (
            "# x\ntorque_Nm,torsion_rad\n1,x\n",
            ("line 3", "torsion_rad", "'x'", "finite"),
        ),
        (
            "torque_Nm,torsion_rad\n1,nan\n",
            ("line 2", "torsion_rad", "'nan'", "finite"),
        ),
        ("", ("empty", "torque_Nm", "torsion_arcmin", "torsion_rad")),
        ("torque_Nm,torsion_rad\n", ("no line of numbers",)),
        ("torque_Nm,torsion_rad\n-1,0\n1,1\n", ("samples: 2", "8")),
        (
            "torque_Nm,torsion_rad\n" + "\n".join(f"{k},{k}" for k in range(20)),
            ("torque_Nm", "0", "19 N·m", "signs"),
        ),
        (
            "torque_Nm,torsion_rad\n" + "\n".join(f"{k},{-k}" for k in range(-9, 10)),
            ("torsion", "torque", "sign"),
        ),
        (
            "torque_Nm,torsion_rad\n" + "\n".join(f"{k},1e300" for k in range(-9, 10)),
            ("line 2", "torsion_rad", "1e300", "1e+12"),
        ),
    ],
)
def test_bad_loops(tmp_path, text, message):
    """A file that is no loop is refused in one line that names file and place."""
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        DriveMap.from_measurement(path, ratings=50.0, **TEETH)
    assert names(str(caught.value), *message)
    assert "bad.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_error_in_the_wrong_unit_is_named(synthetic_map, tmp_path):
    """Minutes of arc in a column of radians are refused where the file is read."""
    torque, x = hysteresis_loop(synthetic_map.with_harmonics([True] + [False] * 4))
    loop = write(tmp_path / "loop.csv", "torque_Nm,torsion_rad", torque, x)
    angle = np.linspace(0.0, 2.0 * np.pi, 400)
    errors = write(
        tmp_path / "e.csv", "output_rad,error_rad", angle, 5.0 * np.sin(2.0 * angle)
    )
    with pytest.raises(InputError, match=naming("e.csv", "rad", "half a turn", "unit")):
        DriveMap.from_measurement(loop, ratings=50.0, kinematic_error=errors, **TEETH)


def test_bad_options(synthetic_map, tmp_path):
    """Missing file, half a turn, ratings and teeth that cannot be."""
    drive = synthetic_map.with_harmonics([True, True, False, False, False])
    loop = write(
        tmp_path / "loop.csv", "torque_Nm,torsion_rad", *hysteresis_loop(drive)
    )
    psi, error = error_record(drive, n=2000)
    half = write(
        tmp_path / "half.csv",
        "output_deg,error_arcmin",
        psi[:1000] / deg,
        error[:1000] / arcmin,
    )
    for path, options, message in (
        (tmp_path / "none.csv", {}, ("none.csv", "No such file")),
        (
            loop,
            {"kinematic_error": half},
            ("half.csv", "183.115 deg", "1000", "360 deg", "16"),
        ),
        (loop, {"ratings": -1.0}, ("rated torque", "-1 N·m", "> 0 N·m")),
        (
            loop,
            {"layout": "x"},
            (
                "layout",
                "'x'",
                "circular_spline_fixed",
                "flexspline_fixed",
                "wave_generator_fixed",
            ),
        ),
        (loop, {"intervals": 0}, ("intervals", "0", "1")),
    ):
        with pytest.raises(InputError, match=naming(*message)):
            DriveMap.from_measurement(path, **{"ratings": 50.0, **TEETH, **options})
    with pytest.raises(
        InputError, match=naming("teeth", "122", "120", "flexspline", "circular spline")
    ):
        DriveMap.from_measurement(
            loop, ratings=50.0, teeth_flexspline=122, teeth_circular_spline=120
        )
    given = Ratings(
        rated_torque=1.0, repeated_peak=2.0, momentary_peak=3.0, T1=0.2, T2=0.6
    )
    found = DriveMap.from_measurement(loop, ratings=given, name="rig", **TEETH)
    assert (found.name, found.ratings) == ("rig", given)


def three_line_loop(kind: str, *, width: float, n: int, sine: bool, noise: float = 0.0):
    """Torque and torsion of a loop about three lines, twice around; width in arcmin.

    ``constant`` and ``load`` have no Maxwell slip: the branches do not meet at the tip.
    """
    top, corners = 100.0, (14.0, 48.0)
    lap = np.concatenate(
        [np.linspace(-top, top, n)[:-1], np.linspace(top, -top, n)[:-1]]
    )
    if sine:
        lap = top * np.sin(np.pi * np.arange(2 * n) / n)
    torque = np.tile(lap, 2)
    size = np.abs(torque)
    x = np.minimum(size, corners[0]) / 31e3
    x += np.clip(size - corners[0], 0.0, corners[1] - corners[0]) / 50e3
    x += np.maximum(size - corners[1], 0.0) / 57e3
    shape = {
        "constant": np.ones_like(size),
        "load": 1.0 + 2.0 * size / top,
        "closing": 1.0 - (size / top) ** 2,
    }[kind]
    x = np.sign(torque) * x
    x -= 0.5 * width * arcmin * shape * np.sign(np.gradient(torque))
    rng = np.random.default_rng(8)
    return torque, x + noise * arcmin * rng.standard_normal(x.size)


DRIVE = {"teeth_flexspline": 200, "teeth_circular_spline": 202, "ratings": 67.0}


@pytest.mark.parametrize(
    ("kind", "width", "n", "sine", "noise"),
    [
        ("constant", 1.0, 300, False, 0.0),
        ("constant", 1.0, 300, False, 0.02),
        ("constant", 0.3, 40, False, 0.0),
        ("constant", 1.0, 300, True, 0.0),
        ("load", 1.0, 300, False, 0.0),
        ("closing", 1.0, 300, True, 0.02),
        ("closing", 0.3, 300, False, 0.0),
    ],
)
def test_the_map_reads_as_its_loop(tmp_path, kind, width, n, sine, noise):
    """Hysteresis loss and lost motion within 5 % of the loop, whatever its form."""
    torque, x = three_line_loop(kind, width=width, n=n, sine=sine)
    wanted = TorqueLoop(torque=torque, torsion=x)
    torque, x = three_line_loop(kind, width=width, n=n, sine=sine, noise=noise)
    path = write(tmp_path / "loop.csv", "torque_Nm,torsion_arcmin", torque, x / arcmin)
    drive = DriveMap.from_measurement(path, **DRIVE)
    played = torque_loop(drive)
    assert played.hysteresis_loss() == pytest.approx(wanted.hysteresis_loss(), rel=0.05)
    assert played.lost_motion(67.0) == pytest.approx(wanted.lost_motion(67.0), rel=0.05)
    told = drive.info["fit"]["loop"]
    # parallel elements have a constant width in torque
    wide_under_load = [True] if kind == "load" else []
    assert [names(line, "rms") for line in told["warnings"]] == wide_under_load
    for key in ("hysteresis_loss_arcmin", "lost_motion_arcmin"):
        pair = told[key]
        assert pair["predicted"] == pytest.approx(pair["measured"], rel=0.08)
    # most of what is left is where the branches of a drive meet
    assert noise < told["rms_arcmin"] < {"load": 1.5}.get(kind, 0.35)
    # the mid-line under load is what it was
    mid = played.mid_line([-60.0, 60.0]) / arcmin
    assert np.diff(mid)[0] == pytest.approx(
        np.diff(wanted.mid_line([-60.0, 60.0]) / arcmin)[0],
        # three times as wide at the tips, where elements have one width
        rel=0.12 if kind == "load" else 0.03,
    )


@pytest.mark.parametrize(
    ("torque", "torsion", "head", "parts"),
    [
        (1e3, 1.0, "torsion_rad", ("1e+05 N·m", "1493 x", "67 N·m", "mN·m")),
        (1e-3, 1.0, "torsion_rad", ("0.1 N·m", "0.001493 x", "67 N·m", "kN·m")),
        (1.0, 1.0 / arcmin, "torsion_rad", ("arcmin under torsion_rad",)),
        (1.0, 1.0, "torsion_arcmin", ("rad under torsion_arcmin",)),
    ],
)
def test_a_loop_in_another_unit_is_refused(tmp_path, torque, torsion, head, parts):
    """A thousand times the rated torque, arcmin as rad: one line with a likely unit."""
    T, x = three_line_loop("closing", width=1.0, n=40, sine=False)
    path = write(tmp_path / "a.csv", f"torque_Nm,{head}", torque * T, torsion * x)
    with pytest.raises(InputError, match=naming("a.csv", *parts)) as caught:
        DriveMap.from_measurement(path, **DRIVE)
    assert "\n" not in str(caught.value)


def test_an_unlikely_torsion_is_doubted(tmp_path):
    """Degrees as rad, fifty times as soft as a catalogue drive: a map, a warning."""
    T, x = three_line_loop("closing", width=1.0, n=40, sine=False)
    path = write(tmp_path / "a.csv", "torque_Nm,torsion_rad", T, x / deg)
    (line,) = DriveMap.from_measurement(path, **DRIVE).info["fit"]["loop"]["warnings"]
    assert names(line, "arcmin", "67 N·m", "60 arcmin")


def test_a_loop_that_runs_backwards_is_named(tmp_path):
    """Rows in reverse give energy: refused with the sign; noise has no direction."""
    T, x = three_line_loop("constant", width=1.0, n=300, sine=False, noise=0.02)
    path = write(tmp_path / "a.csv", "torque_Nm,torsion_rad", T[::-1], x[::-1])
    with pytest.raises(InputError, match=naming("a.csv", "arcmin", "sign", "-0.9974")):
        DriveMap.from_measurement(path, **DRIVE)
    T, x = three_line_loop("constant", width=-1e-3, n=300, sine=False, noise=0.02)
    path = write(tmp_path / "b.csv", "torque_Nm,torsion_rad", T, x)
    assert DriveMap.from_measurement(path, **DRIVE).hysteresis == ()
