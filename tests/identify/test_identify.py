"""Identification from logs of a simulated bench, and its command."""

from __future__ import annotations

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from messages import names, naming
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from swgjoint.cli.identify import result_of
from swgjoint.cli.main import main
from swgjoint.errors import InputError
from swgjoint.identify.identification import identify
from swgjoint.identify.least_squares import correlation_factor, rms
from swgjoint.identify.log import (
    BenchLog,
    mean_acceleration,
    mean_rate,
    read_log,
)
from swgjoint.joint.attach import attach
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import Jenkin

TEETH = {"teeth_flexspline": 200, "teeth_circular_spline": 202}
STEP = 5e-4
INERTIA = 4e-5
NOISE = {"output": 0.5, "motor": 5e-3, "link_angle": 2e-6, "motor_angle": 1e-5}
"""Deviations: a quarter percent of a 200 N·m sensor, current noise, fine encoders."""
WINDOW = 0.005
BENCH = """
<mujoco>
  <option timestep="{step}" integrator="RK4" gravity="0 0 0"/>
  <worldbody>
    <body><joint name="j" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/></body>
  </worldbody>
</mujoco>
"""


def true_drive(**changes) -> DriveMap:
    """CSG-25-100 with kinematic error of both members and hysteresis."""
    drive = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0)
    orders = np.array([(0, 0), (2, 0), (4, 0), (0, 2)])
    potential = np.zeros((4, *drive.potential.shape[1:]))
    potential[0] = drive.potential[0]
    ends = np.zeros((4, 2, 2))
    ends[0] = drive.end_stiffness[0]
    error = 1e-4 * np.array([[0, 0], [1.2, -0.6], [0.3, 0.5], [-0.8, 0.4]])
    return replace(
        drive,
        orders=orders,
        potential=potential,
        end_stiffness=ends,
        kinematic_error=error,
        hysteresis=(Jenkin(stiffness=1.2e4, yield_torque=3.0),),
        **changes,
    )


def simulated(drive: DriveMap, seconds: float, swing: float):
    """A bench at level full: PD on the motor, a load that swings; samples at 1 kHz.

    Sensors give the mean of their period. Link and load tell the torque behind the
    drive, as a sensor between them.
    """
    spec = mujoco.MjSpec.from_string(BENCH.format(step=STEP))
    got = attach(spec, joint="j", drive=drive, rotor_inertia=INERTIA, friction=True)
    model = spec.compile()
    data = mujoco.MjData(model)
    r, k = (int(model.joint(name).dofadr[0]) for name in (got.rotor, "j"))
    i, n = drive.ratio, round(seconds / STEP)
    t = STEP * np.arange(n + 1)
    # there and back once; a faster part beside it, that moves the rotor's inertia
    psi = swing * np.sin(2 * np.pi * t / 8.0) if seconds <= 8.0 else 0.0
    if seconds > 8.0:
        psi = swing * np.sin(2 * np.pi * t / seconds)
    psi = psi + 0.008 * np.sin(2 * np.pi * 2.0 * t)
    rate = np.gradient(psi, STEP)
    load = 110.0 * np.sin(2 * np.pi * 0.43 * t)
    inertia, omega = INERTIA + 1.0 / i**2, 2 * np.pi * 8.0
    angles, torques = np.empty((n + 1, 2)), np.empty((n, 2))
    data.qvel[[r, k]] = i * rate[0], rate[0]
    for j in range(n):
        angles[j] = data.qpos[[r, k]]
        before = data.qvel[k]
        motor = inertia * (
            omega**2 * (i * psi[j] - data.qpos[r])
            + 2 * omega * (i * rate[j] - data.qvel[r])
        )
        motor += load[j] / i
        data.qfrc_applied[[r, k]] = motor, -load[j]
        mujoco.mj_step(model, data)
        torques[j] = (data.qvel[k] - before) / STEP + load[j], motor
    angles[n] = data.qpos[[r, k]]
    middle = 0.5 * (angles[1:] + angles[:-1])
    rows = np.column_stack([t[:-1] + STEP / 2, middle, torques])
    return rows.reshape(-1, 2, 5).mean(axis=1), got.damping


def log_of(rows: np.ndarray, rng=None, **left_out) -> BenchLog:
    """Samples with noise."""
    t, motor_angle, link_angle, output, motor = rows.T.copy()
    if rng is not None:
        motor_angle += NOISE["motor_angle"] * rng.standard_normal(len(t))
        link_angle += NOISE["link_angle"] * rng.standard_normal(len(t))
        output += NOISE["output"] * rng.standard_normal(len(t))
        motor += NOISE["motor"] * rng.standard_normal(len(t))
    channels = {"output_torque": output, "motor_torque": motor, **left_out}
    return BenchLog(time=t, motor_angle=motor_angle, link_angle=link_angle, **channels)


@pytest.fixture(scope="module")
def bench():
    """Eight seconds of a drive without error of the flexspline: truth and samples."""
    drive = true_drive().with_harmonics([True, True, True, False])
    rows, damping = simulated(drive, 8.0, 0.35)
    return drive, rows, truth_of(drive, damping)


def truth_of(drive: DriveMap, damping: float) -> dict[str, float]:
    found = {f"K{k}": drive.info["stated"][f"K{k}_Nm_rad"] for k in (1, 2, 3)}
    for (p, q), (a, b) in zip(drive.orders[1:], drive.kinematic_error[1:], strict=True):
        found |= {f"error_{p}_{q}_cos": a, f"error_{p}_{q}_sin": b}
    law, element = drive.friction, drive.hysteresis[0]
    return found | {
        "zero": 0.0,
        "damping": damping,
        "hysteresis_stiffness": element.stiffness,
        "hysteresis_yield_torque": element.yield_torque,
        "friction_coulomb": law.coulomb,
        "friction_load": law.load,
        "friction_viscous": law.viscous,
        "rotor_inertia": INERTIA,
        "link_skew": 0.0,
    }


def settings(drive: DriveMap) -> dict:
    orders = [tuple(pq) for pq in drive.orders[1:].tolist()]
    return {**TEETH, "ratings": drive.ratings, "orders": orders, "window": WINDOW}


def assert_recovers(found, truth: dict[str, float], part: float) -> None:
    """Damping and zero are no parameters of a drive that a log of this kind tells."""
    for name in truth.keys() - {"damping", "zero", "link_skew"}:
        size = abs(truth[name])
        if name.startswith("error"):  # of the amplitude
            size = np.hypot(truth[f"{name[:-3]}cos"], truth[f"{name[:-3]}sin"])
        assert found.estimates[name].value == pytest.approx(
            truth[name], abs=part * size
        ), name


def test_log_with_noise_gives_all_parameters(bench):
    """Stiffness, hysteresis, friction, error and inertia within 5 %."""
    drive, rows, truth = bench
    found = identify(log_of(rows, np.random.default_rng(1)), **settings(drive))
    assert found.estimates.keys() == truth.keys()
    assert_recovers(found, truth, 0.05)


def test_residuals_that_are_alike_widen_the_intervals():
    """Of x_k = a x_(k-1) + noise the factor is (1 + a)/(1 - a); 1 of white noise."""
    noise = np.random.default_rng(1).normal(size=40_000)
    assert correlation_factor(noise) == pytest.approx(1.0, abs=0.05)
    alike = lfilter([1.0], [1.0, -0.6], noise)
    assert correlation_factor(alike) == pytest.approx(4.0, rel=0.1)


@pytest.mark.slow
def test_intervals_cover_the_truth(bench):
    """Every parameter lies in its interval of 95 % in at least 24 of 30 repeats.

    Fewer are in six of ten thousand such series by the binomial distribution; of all
    450 intervals it leaves the bounds below in one of a thousand. 25 and 93.8 % were
    seen. Intervals too narrow or too wide by half are far out.
    """
    drive, rows, truth = bench
    inside = dict.fromkeys(truth, 0)
    repeats = 30
    for seed in range(repeats):
        found = identify(log_of(rows, np.random.default_rng(seed)), **settings(drive))
        assert_recovers(found, truth, 0.05)
        for name, value in truth.items():
            inside[name] += found.estimates[name].low <= value
            inside[name] -= found.estimates[name].high < value
    assert min(inside.values()) >= 24, inside
    # no wider than they need be
    assert 0.915 < sum(inside.values()) / (repeats * len(truth)) < 0.98


def with_element(stiffness: float, yield_torque: float):
    """Another drive on the bench: itself, samples, truth."""
    element = Jenkin(stiffness=stiffness, yield_torque=yield_torque)
    drive = replace(true_drive(), hysteresis=(element,))
    drive = drive.with_harmonics([True, True, True, False])
    rows, damping = simulated(drive, 8.0, 0.35)
    return drive, rows, truth_of(drive, damping)


@pytest.mark.parametrize(
    ("stiffness", "yield_torque"),
    [
        (1.2e4, 0.3),
        (3e3, 3.0),
        *(
            pytest.param(*pair, marks=pytest.mark.slow)
            for pair in ((1.2e4, 1.0), (3e3, 1.0), (5e4, 1.0), (2e4, 6.0))
        ),
    ],
)
def test_elements_of_many_drives_are_found(stiffness, yield_torque):
    """Soft and stiff, weak and strong: 2 % from a log without noise, else in noise."""
    drive, rows, truth = with_element(stiffness, yield_torque)
    options = settings(drive)
    found = identify(log_of(rows), **options)
    names = ("hysteresis_stiffness", "hysteresis_yield_torque")
    for name in names:
        assert found.estimates[name].value == pytest.approx(truth[name], rel=0.02)
    found = identify(log_of(rows, np.random.default_rng(1)), **options)
    for name in names:
        e = found.estimates[name]
        assert abs(e.value - truth[name]) < 3.0 * e.deviation
        assert e.deviation < 0.08 * truth[name]
    assert found.notes == ()
    assert rms(found.residuals["output_torque"]) < 1.05 * NOISE["output"] / np.sqrt(5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stiffness", "yield_torque"), [(3e3, 3.0), (1.2e4, 0.3)], ids=["soft", "weak"]
)
def test_intervals_cover_the_truth_of_other_drives(stiffness, yield_torque):
    """Of 20 repeats 15 at least for every parameter, and 91 to 98 % of all.

    Fewer are in three of ten thousand series; 16 and 93.3 % were seen.
    """
    drive, rows, truth = with_element(stiffness, yield_torque)
    inside = dict.fromkeys(truth, 0)
    repeats = 20
    for seed in range(repeats):
        found = identify(log_of(rows, np.random.default_rng(seed)), **settings(drive))
        for name, value in truth.items():
            e = found.estimates[name]
            inside[name] += int(e.low <= value <= e.high)
    assert min(inside.values()) >= 15, inside
    assert 0.91 < sum(inside.values()) / (repeats * len(truth)) < 0.98


@pytest.fixture(scope="module")
def without_hysteresis(bench):
    """The same bench with a drive that has none, and its samples."""
    drive = replace(bench[0], hysteresis=())
    return drive, simulated(drive, 8.0, 0.35)[0]


@pytest.mark.parametrize("seed", [1, 13])
def test_no_hysteresis_is_said(without_hysteresis, seed):
    """A drive without it: a note and no element, whichever way noise pulls the fit."""
    drive, rows = without_hysteresis
    found = identify(log_of(rows, np.random.default_rng(seed)), **settings(drive))
    (note,) = found.notes
    assert note.startswith("no hysteresis: ")
    assert found.drive.hysteresis == ()
    assert "hysteresis_yield_torque" not in found.estimates


@pytest.mark.parametrize(("column", "offset"), [(3, 5.0), (4, 0.05)])
def test_offset_of_a_sensor_counts_and_is_said(bench, column, offset):
    """The mean is part of rms and weight; one note, and none where there is none."""
    drive, rows, _ = bench
    rows = rows.copy()
    rows[:, column] += offset
    found = identify(log_of(rows, np.random.default_rng(1)), **settings(drive))
    (note,) = found.notes
    assert "offset of a sensor?" in note
    told = result_of(found)["residuals"]
    for key, rest in found.residuals.items():
        assert abs(rest.mean()) > rest.std()
        size = np.hypot(rest.mean(), rest.std())
        assert told[key]["rms_Nm"] == pytest.approx(size)
    # at the minimum the pulls of both torques at the zero, with these weights, balance
    model = found.model
    values = np.array([e.value for e in found.estimates.values()])
    step = 1e-7 * (np.array(list(found.estimates)) == "zero")
    ahead, behind = model.torques(values + step), model.torques(values - step)
    pulls = [
        np.mean((ahead[key] - behind[key]) * rest) / told[key]["rms_Nm"] ** 2
        for key, rest in found.residuals.items()
    ]
    assert abs(sum(pulls)) < 0.15 * np.abs(pulls).sum()


@pytest.mark.parametrize("factor", [np.pi / 180.0, 180.0 / np.pi])
def test_angles_in_a_wrong_unit_are_doubted(bench, factor):
    """Radians for degrees and degrees for radians: a note with the torsion."""
    drive, rows, _ = bench
    rows = rows * np.array([1.0, factor, factor, 1.0, 1.0])
    found = identify(log_of(rows), **settings(drive))
    assert any(
        "arcmin; plausible: 0.3 to 60 arcmin" in note and "check the units" in note
        for note in found.notes
    )


@pytest.mark.parametrize(
    ("noise", "window", "shifted"),
    [
        (1.0, 0.001, ["rotor_inertia"]),
        (5.0, 0.001, ["hysteresis_stiffness", "rotor_inertia"]),
        (20.0, 0.005, ["hysteresis_stiffness"]),
    ],
)
def test_noise_that_shifts_parameters_is_doubted(
    bench, noise, window, shifted, monkeypatch
):
    """What it shifts beyond the interval, and in which direction."""
    drive, rows, _ = bench
    options = {**settings(drive), "window": window}
    encoders = {key: NOISE[key] for key in ("motor_angle", "link_angle")}

    def found_with(noise, seed):  # of the encoders; that of the torques stays
        for key, deviation in encoders.items():
            monkeypatch.setitem(NOISE, key, noise * deviation)
        return identify(log_of(rows, np.random.default_rng(seed)), **options)

    for seed in (3, 4):
        clean, noisy = found_with(0.0, seed), found_with(noise, seed)
        assert not clean.doubts
        (doubt,) = noisy.doubts
        assert names(doubt, "noise of the angles", "--window", *shifted)
        for name in shifted:
            moved = noisy.estimates[name].value - clean.estimates[name].value
            # part of the inertia is lost already, and the rest loses less
            assert 0.2 < noisy.shifts[name] / moved < 3.0, name


def test_usual_noise_shifts_nothing_beyond_its_interval(bench):
    """With the window by default, by a tenth of the interval."""
    drive, rows, _ = bench
    found = identify(log_of(rows, np.random.default_rng(3)), **settings(drive))
    assert not found.doubts
    for name in ("K1", "K3", "hysteresis_stiffness", "rotor_inertia"):
        assert abs(found.shifts[name]) < 0.2 * found.estimates[name].deviation, name


def test_windows_too_long_for_the_kinematic_error_are_doubted(bench):
    """Three times the window turns its phase by three times as much: a note."""
    drive, rows, _ = bench
    options = settings(drive)
    assert identify(log_of(rows), **options).notes == ()
    found = identify(log_of(rows), **{**options, "window": 3.0 * WINDOW})
    (note,) = found.notes
    fastest = np.abs(np.gradient(rows[:, 1], rows[:, 0])).max()
    assert found.model.phase_step == pytest.approx(12.0 * WINDOW * fastest, rel=0.1)
    assert "in a window of 0.015 s" in note and "--window 0.00" in note
    # with samples 0.015 s apart, no window is shorter
    found = identify(log_of(rows[::15]), **{**options, "window": 3.0 * WINDOW})
    (note,) = (line for line in found.notes if "phase" in line)
    assert "sample every 0.00" in note and "--window" not in note


def test_the_map_moves_as_the_drive(bench):
    """The found map gives the torques of the true one at new torsions and angles."""
    drive, rows, _ = bench
    found = identify(log_of(rows), **settings(drive)).drive
    rng = np.random.default_rng(2)
    theta = rng.uniform(-20, 20, 200)
    torsion = rng.uniform(-2.5e-3, 2.5e-3, 200)
    psi = theta / drive.ratio - torsion
    wanted, got = (d.law(theta, psi).output_force for d in (drive, found))
    np.testing.assert_allclose(got, wanted, rtol=0.0, atol=0.2)
    (element,) = found.hysteresis
    assert element.yield_torque == pytest.approx(3.0, rel=0.01)
    assert found.friction.load == pytest.approx(drive.friction.load, rel=0.01)


@pytest.mark.parametrize("absent", ["output_torque", "motor_torque"])
def test_one_torque_is_enough(bench, absent):
    """Without a torque sensor the motor tells the stiffness, and the other way."""
    drive, rows, truth = bench
    log = log_of(rows, np.random.default_rng(3), **{absent: None})
    options = settings(drive)
    if absent == "output_torque":
        options["rotor_inertia"] = INERTIA
    found = identify(log, **options)
    part = 0.1 if absent == "output_torque" else 0.05
    for name in ("K1", "K2", "K3", "error_2_0_cos"):
        assert found.estimates[name].value == pytest.approx(truth[name], rel=part)
    has = "friction_coulomb" in found.estimates
    assert has == (absent == "output_torque") == (found.drive.friction is not None)


def test_a_line_that_the_log_does_not_reach_is_left_out(bench):
    """T2 above every torque of the log: no K3, which would be any number."""
    drive, rows, truth = bench
    high = replace(drive.ratings, T2=200.0)
    found = identify(log_of(rows), **settings(drive) | {"ratings": high})
    assert "K3" not in found.estimates
    # one line in place of two
    assert 0.9 * truth["K1"] < found.estimates["K1"].value < 1.1 * truth["K1"]
    assert truth["K2"] < found.estimates["K2"].value < truth["K3"]
    assert any("T2 200 N·m: no K3" in note for note in found.notes)
    # the error and the friction do not depend on it
    assert found.estimates["error_2_0_cos"].value == pytest.approx(
        truth["error_2_0_cos"], rel=0.05
    )
    # beyond the log the last line goes on
    np.testing.assert_allclose(
        found.drive.end_stiffness[0, 0], found.estimates["K2"].value, rtol=1e-9
    )


@pytest.mark.parametrize("layout", ["flexspline_fixed", "circular_spline_fixed"])
def test_zero_of_the_encoder_turns_the_error(bench, layout):
    """A log whose motor counts from elsewhere gives the same map."""
    drive, _, _ = bench
    drive = replace(drive, layout=layout, friction=None, hysteresis=())
    i = drive.ratio
    t = 1e-3 * np.arange(6000)
    psi = 0.3 * np.sin(0.5 * t)
    theta = i * (psi + 3e-3 * np.sin(9.0 * t))
    torque = drive.law(theta, psi).output_force
    log = BenchLog(
        time=t, motor_angle=theta + 0.4, link_angle=psi, output_torque=torque
    )
    options = {**settings(drive), "hysteresis": False, "layout": layout}
    found = identify(log, **options)
    assert found.estimates["zero"].value == pytest.approx(-0.4 / i, rel=1e-3)
    np.testing.assert_allclose(
        found.drive.kinematic_error, drive.kinematic_error, rtol=0.0, atol=1e-6
    )


def test_cubic_spring():
    """A hardening spring: both coefficients, and the map has their torque."""
    t = 1e-3 * np.arange(4000)
    x = 2e-3 * np.sin(4.0 * t)
    torque = 2e4 * x + 4e9 * x**3 + 0.1 * np.random.default_rng(4).standard_normal(4000)
    log = BenchLog(
        time=t, motor_angle=-100.0 * x, link_angle=0.0 * t, output_torque=torque
    )
    found = identify(log, **TEETH, ratings=60.0, spring="cubic", orders=[])
    assert found.estimates["stiffness"].value == pytest.approx(2e4, rel=0.01)
    assert found.estimates["hardening"].value == pytest.approx(4e9, rel=0.05)
    assert found.drive.hysteresis == () and "no hysteresis" in found.notes[0]
    at = float(found.drive.coefficients(1.5e-3, 1)[0, 0])
    assert at == pytest.approx(2e4 * 1.5e-3 + 4e9 * 1.5e-3**3, rel=0.01)


@pytest.mark.slow
def test_a_whole_turn_tells_both_members():
    """Errors of circular spline and flexspline, found apart, within 5 %."""
    drive = true_drive()
    rows, damping = simulated(drive, 48.0, 3.2)
    log = log_of(rows, np.random.default_rng(5))
    found = identify(log, **{**settings(drive), "orders": None})
    assert "error_1_-1_cos" in found.estimates
    assert_recovers(found, truth_of(drive, damping), 0.05)


def test_means_of_derivatives_are_of_fourth_order():
    """Rate and acceleration from means of a sine, at two steps."""
    errors = []
    for h in (0.1, 0.05):
        edges = np.arange(0.0, 6.0, h)
        means = -np.diff(np.cos(edges)) / h
        rate, bend = (f(means, h)[2:-2] for f in (mean_rate, mean_acceleration))
        errors.append(
            [
                np.abs(rate - np.diff(np.sin(edges))[2:-2] / h).max(),
                np.abs(bend - np.diff(np.cos(edges))[2:-2] / h).max(),
            ]
        )
    assert (np.log2(np.divide(*errors)) > 3.9).all()


@pytest.fixture(scope="module")
def csv_file(bench, tmp_path_factory):
    _, rows, _ = bench
    log = log_of(rows, np.random.default_rng(6))
    path = tmp_path_factory.mktemp("log") / "bench.csv"
    columns = [
        log.time,
        np.degrees(log.motor_angle),
        np.degrees(log.link_angle),
        log.output_torque,
        log.motor_torque,
    ]
    head = "time_s,motor_angle_deg,link_angle_deg,output_torque_Nm,motor_torque_Nm"
    text = "\n".join(",".join(map(repr, row)) for row in np.array(columns).T.tolist())
    path.write_text(f"# bench 3\n{head}\n{text}\n")
    return path


def test_command(bench, csv_file, tmp_path, capsys):
    """From the file to intervals, a picture, and a map that loads."""
    _, _, truth = bench
    out = tmp_path / "out"
    options = ["--teeth", "200/202", "--rated", "67", "--corners", "14/48"]
    options += ["--orders", "2:0,4:0", "--out", str(out)]
    assert main(["identify", str(csv_file), *options, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    for name in ("K1", "K2", "K3", "hysteresis_yield_torque", "friction_load"):
        row = result["estimates"][name]
        assert row["value"] == pytest.approx(truth[name], rel=0.05)
        assert row["low"] < row["value"] < row["high"]
    assert result["residuals"]["output_torque"]["rms_Nm"] == pytest.approx(
        NOISE["output"] / np.sqrt(5), rel=0.1
    )
    assert [(e["alpha"], e["beta"]) for e in result["kinematic_error"]] == [
        (2, 0),
        (4, 0),
    ]
    drive = DriveMap.load(out / "identified.swg")
    assert drive.mean_torsion(14.0) == pytest.approx(14.0 / 31e3, rel=0.05)
    assert (out / "identified.png").read_bytes()[:4] == b"\x89PNG"
    assert main(["identify", str(csv_file), *options[:6]]) == 0
    assert "K1 [N·m/rad]" in capsys.readouterr().out
    assert main(["identify", str(csv_file), *options]) == 0
    # what the map cannot hand to a joint is printed with its value and its key
    line = capsys.readouterr().out.splitlines()[-1]
    rotor = result["estimates"]["rotor_inertia"]["value"]
    assert names(line, "damping_ratio", f"rotor_inertia_kgm2 = {rotor:.4g}")


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"--teeth": "200"}, ("--teeth", "200", "FS/CS")),
        (
            {"--teeth": "202/200"},
            ("teeth", "202", "200", "0", "flexspline", "circular spline"),
        ),
        ({"--rated": "0"}, ("rated torque 0 N·m", "> 0 N·m")),
        ({"--corners": "40/20"}, ("40", "20 N·m", "T1 < T2")),
        (
            {"--layout": "free"},
            (
                "layout",
                "'free'",
                "circular_spline_fixed",
                "flexspline_fixed",
                "wave_generator_fixed",
            ),
        ),
        (
            {"--layout": "flexspline_fixed"},
            ("flexspline_fixed", "101", "circular_spline_fixed", "ratio -100"),
        ),
        ({"--orders": "2:x"}, ("--orders", "2:x", "P:Q")),
        ({"--orders": "2:0,2:0"}, ("orders", "2:0, 2:0", "0:0")),
        ({"--orders": f"2:0,{10**20}:0"}, ("orders", f"{10**20}:0", "1000000")),
        ({"--window": "0"}, ("window 0 s", "> 0 s")),
        ({"--window": "1"}, ("bench.csv", "8", "1 s", "200")),
        ({"--window": "1e-300"}, ("window", "1e-300 s", "0.001 s", "bench.csv")),
        ({"--rotor-inertia": "-1"}, ("rotor inertia", "-1 kg·m²", "> 0 kg·m²")),
    ],
)
def test_bad_options_are_one_line(csv_file, capsys, change, line):
    """What, the value, what is accepted; status 2."""
    options = {"--teeth": "200/202", "--rated": "67", **change}
    words = [word for pair in options.items() for word in pair]
    assert main(["identify", str(csv_file), *words]) == 2
    err = capsys.readouterr().err
    assert names(err, *line) and len(err.splitlines()) == 1


def test_what_a_log_cannot_tell_is_named():
    """A motor at rest: no friction, and no error at all from the zero of its angle."""
    t = 1e-3 * np.arange(4000)
    x = 2e-3 * np.sin(4.0 * t)
    log = BenchLog(time=t, motor_angle=0.0 * t, link_angle=-x, output_torque=2e4 * x)
    options = {**TEETH, "ratings": 60.0, "hysteresis": False}
    with pytest.raises(InputError, match=naming("log") + r".*\b(zero|error_2_0)"):
        identify(log, **options, orders=[(2, 0)])
    assert identify(log, **options, orders=[]).estimates["K1"].value == pytest.approx(
        2e4, rel=1e-3
    )
    still = replace(log, motor_torque=-2e2 * x)
    with pytest.raises(
        InputError, match=naming("log", "0", "800", "200", "motor_torque_Nm")
    ):
        identify(still, **options, orders=[])


@pytest.mark.parametrize(
    ("columns", "line"),
    [
        ([1, 2], ("torsion", "0 rad")),
        ([3], ("output torque", "0 N·m")),
        ([4], ("motor torque", "0 N·m")),
        ([3, 4], ("output torque", "0 N·m")),
    ],
)
def test_constant_channels_are_one_line(bench, columns, line):
    """Angles or a torque that say nothing."""
    drive, rows, _ = bench
    rows = rows.copy()
    rows[:, columns] = 0.0
    with pytest.raises(InputError, match=naming("log", *line)):
        identify(log_of(rows), **settings(drive))


def test_unknown_columns_are_named(tmp_path):
    """A misspelled torque beside a known one is not ignored in silence."""
    path = tmp_path / "log.csv"
    path.write_text(
        "time_s,motor_angle_deg,link_angle_deg,motor_torque_Nm,ouput_torque_Nm\n"
        "0,1,2,3,4\n1,1,2,3,4\n"
    )
    with pytest.warns(UserWarning, match=naming("log.csv", "ouput_torque_Nm")):
        log = read_log(path)
    assert log.output_torque is None


def test_bad_logs_are_one_line(tmp_path):
    """Missing columns, no torque, times that go back, gaps."""
    path = tmp_path / "log.csv"
    path.write_text("time_s,motor_angle_deg\n0,1\n")
    with pytest.raises(
        InputError,
        match=naming(
            "log.csv", "link_angle_deg", "link_angle_rad", "link_angle_arcmin"
        ),
    ):
        read_log(path)
    path.write_text("time_s,motor_angle_deg,link_angle_deg\n0,1,2\n")
    with pytest.raises(
        InputError, match=naming("log.csv", "output_torque_Nm", "motor_torque_Nm")
    ):
        read_log(path)
    with pytest.raises(InputError, match=naming("absent.csv", "No such file")):
        read_log(tmp_path / "absent.csv")
    t = 1e-3 * np.arange(3000)
    zero = np.zeros(3000)
    for times, line in (
        (np.where(t == t[7], 0.0, t), ("time_s", "0", "0.006")),
        (np.where(t > 1.0, t + 1.0, t), ("sample", "1 s", "0.01 s")),
    ):
        with pytest.raises(InputError, match=naming("log", *line)):
            BenchLog(
                time=times, motor_angle=zero, link_angle=zero, output_torque=zero
            ).average(0.01)


def late_by(rows: np.ndarray, seconds: float) -> np.ndarray:
    """The same samples with late link angles; the ends, where none are, are cut."""
    rows = rows.copy()
    rows[:, 2] = CubicSpline(rows[:, 0], rows[:, 2])(rows[:, 0] - seconds)
    return rows[20:-20]


@pytest.mark.parametrize("late", [1e-4, 5e-4, 1e-3, -2e-3])
def test_a_late_link_encoder_is_found_and_corrected(bench, late):
    """Its delay comes back within its interval or 5 µs, the drive as without it."""
    drive, rows, truth = bench
    log = log_of(late_by(rows, late), np.random.default_rng(1))
    found = identify(log, **settings(drive))
    skew = found.estimates["link_skew"]
    assert abs(skew.value - late) < max(3.0 * skew.deviation, 5e-6)
    assert_recovers(found, truth, 0.05)
    assert any("link_angle" in note and "ms" in note for note in found.notes)
    assert found.doubts == ()


def test_a_good_log_has_no_doubts(bench):
    """Neither a skew beyond its interval nor a line of doubt."""
    drive, rows, _ = bench
    found = identify(log_of(rows, np.random.default_rng(4)), **settings(drive))
    skew = found.estimates["link_skew"]
    assert abs(skew.value) < max(3.0 * skew.deviation, 5e-6)
    assert found.notes == () and found.doubts == ()


def test_a_late_link_without_torque_behind_the_drive_is_doubted(bench):
    """The motor cannot tell it from viscous friction: below zero, and said so."""
    drive, rows, _ = bench
    log = log_of(late_by(rows, 1e-3), np.random.default_rng(1), output_torque=None)
    found = identify(log, **{**settings(drive), "rotor_inertia": INERTIA})
    assert "link_skew" not in found.estimates
    assert any("friction_viscous" in line for line in found.doubts)
    assert "clocks" in " ".join(found.doubts)


def test_torque_that_is_not_explained_ends_with_status_one(csv_file, tmp_path, capsys):
    """More than a few percent left: a doubt with the share, map written, status 1."""
    rows = np.genfromtxt(csv_file, delimiter=",", skip_header=2)
    rng = np.random.default_rng(3)
    rows[:, 3] += 80.0 * np.sign(rng.standard_normal(len(rows)))
    head = csv_file.read_text().splitlines()[1]
    path = tmp_path / "noisy.csv"
    np.savetxt(path, rows, delimiter=";", header=head.replace(",", ";"))
    out = tmp_path / "out"
    options = ["--teeth", "200/202", "--rated", "67", "--orders", "2:0"]
    assert main(["identify", str(path), *options, "--out", str(out), "--json"]) == 1
    result = json.loads(capsys.readouterr().out)
    assert any(names(line, "output_torque", "5%") for line in result["doubts"])
    assert (out / "identified.swg").exists()
    assert main(["identify", str(csv_file), *options, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["doubts"] == []


@pytest.mark.parametrize(
    ("layout", "sign", "parts"),
    [
        ("flexspline_fixed", 1.0, ("101", "layout circular_spline_fixed", "-100")),
        ("circular_spline_fixed", -1.0, ("-100", "sign", "layout flexspline_fixed")),
        ("wave_generator_fixed", 1.0, ("1.01", "layout circular_spline_fixed")),
    ],
)
def test_another_layout_or_sign_is_told_from_the_angles(bench, layout, sign, parts):
    """The slope of link over motor angle, and what would fit it."""
    drive, rows, _ = bench
    rows = rows * np.array([1.0, 1.0, sign, sign, 1.0])
    with pytest.raises(InputError, match=naming("log", layout, *parts)):
        identify(log_of(rows), **{**settings(drive), "layout": layout})
