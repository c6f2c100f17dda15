"""The spec procedures: loop, output turn, ripple, on maps that are known exactly."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from messages import names, naming
from validation_record import validated_map

from swgjoint.errors import ComputationError, InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.sheet import spec_sheet as sheets
from swgjoint.maps.sheet.loop import TorqueLoop, torque_loop
from swgjoint.maps.sheet.spec_sheet import KEYS, measure_spec
from swgjoint.maps.sheet.turn import error_turn, period_of, ripple_turn
from swgjoint.maps.torsion_law import potential_of_stiffness
from swgjoint.units import arcmin


def with_angles(drive: DriveMap, orders, amplitudes) -> DriveMap:
    """A copy with kinematic error of the given orders and no other harmonic."""
    n = 1 + len(orders)
    potential = np.zeros((n, *drive.potential.shape[1:]))
    ends = np.zeros((n, 2, 2))
    potential[0], ends[0] = drive.potential[0], drive.end_stiffness[0]
    return replace(
        drive,
        orders=np.array([(0, 0), *orders]),
        potential=potential,
        end_stiffness=ends,
        kinematic_error=np.array([(0.0, 0.0), *amplitudes]),
    )


def with_clearance(gap: float, held: float = 0.0) -> DriveMap:
    """Constant stiffness outside a gap in which the output is free, or nearly so.

    A torque ``held`` [N·m] holds it at the ends of the gap.
    """
    knots = np.array([-0.02, -0.5 * gap, 0.5 * gap, 0.02])
    drive = DriveMap.linear(1e4)
    potential, ends = potential_of_stiffness(
        np.array([-0.02, 0.02]), np.array([1e4, 1e4])
    )
    potential = np.zeros((1, 2, 3, 5))
    h = 0.02 - 0.5 * gap
    potential[0, 0, 0, :3] = [0.5e4 * h**2 + held * h, -1e4 * h - held, 0.5e4]
    potential[0, 0, 1, 1:3] = [-held, held / gap]
    potential[0, 0, 2, 1:3] = [held, 0.5e4]
    return replace(drive, torsion_knots=knots, potential=potential, end_stiffness=ends)


def test_linear_map_gives_its_stiffness_everywhere():
    """Constant stiffness: K1 = K2 = K3 = K, lost motion 8 % of rated over K."""
    sheet = DriveMap.linear(1e4, rated_torque=50.0).spec_sheet()
    for key in ("K1_Nm_rad", "K2_Nm_rad", "K3_Nm_rad"):
        assert sheet[key] == pytest.approx(1e4, rel=1e-9)
    lost = 0.08 * 50.0 / 1e4 / arcmin
    assert sheet["lost_motion_arcmin"] == pytest.approx(lost, rel=1e-9)


def test_stiffness_of_a_hardening_map(synthetic_map):
    """Without angle harmonics each K is the chord of the exact curve."""
    drive = synthetic_map.with_harmonics([True, False, False, False, False])
    sheet = drive.spec_sheet()
    # T = K x (1 + 2 (x/x0)^2), K x0 = 100 N·m: roots by hand
    x0 = 100.0 / 2e4
    x = [
        x0 * next(r.real for r in np.roots([2.0, 0, 1, -T / 100.0]) if r.imag == 0)
        for T in (10.0, 30.0, 100.0)
    ]
    chords = [10.0 / x[0], 20.0 / (x[1] - x[0]), 70.0 / (x[2] - x[1])]
    found = [sheet[f"K{k}_Nm_rad"] for k in (1, 2, 3)]
    assert found == pytest.approx(chords, rel=1e-6)


def test_output_angle_balances_the_torque(synthetic_map):
    """The drive exerts the given torque there, inside and beyond the sampled range."""
    rng = np.random.default_rng(5)
    theta = rng.uniform(-400, 400, 300)
    torque = rng.uniform(-900, 900, 300)
    psi = output_angle(synthetic_map, theta, torque)
    found = synthetic_map.forces(theta, psi)[1]
    assert np.abs(found - torque).max() < 1e-9 * np.abs(torque).max()


def test_accuracy_equals_a_dense_evaluation(synthetic_map):
    """Accuracy is the peak to peak of the error on a grid 20 times finer."""
    sheet = synthetic_map.spec_sheet(
        ["transmission_accuracy_arcmin", "transmission_accuracy_rated_arcmin"]
    )
    # dense around the extremes of the coarse turn only: the whole turn has 40,000 waves
    for key, torque in (
        ("transmission_accuracy_arcmin", 0.0),
        ("transmission_accuracy_rated_arcmin", 50.0),
    ):
        turn = error_turn(synthetic_map, torque)
        angle, error = turn.output_turn()
        assert angle[-1] == pytest.approx(60 * 2 * np.pi)
        step, ends = angle[1], []
        for sign in (1, -1):
            worst = angle[np.argsort(sign * error)[-30:]]
            theta = (worst[:, None] + step * np.linspace(-1, 1, 41)).ravel()
            e = output_angle(synthetic_map, theta, torque) + theta / 60.0
            ends.append((sign * e).max())
        assert sheet[key] == pytest.approx(sum(ends) / arcmin, rel=1e-4)


def test_turn_holds_for_harmonics_that_move_with_the_torsion(monkeypatch):
    """Tooth orders of the output turn by 1 rad of phase: still the full map's angle."""
    drive = with_angles(
        DriveMap.linear(1e4, rated_torque=50.0),
        [(2, 0), (0, 200), (200, -200)],
        [(3e-5, 0.0), (0.0, 1e-5), (2e-6, 1e-6)],
    )
    turn = error_turn(drive, 50.0)
    theta, error = turn.output_turn()
    some = np.arange(0, theta.size, theta.size // 300)
    wanted = output_angle(drive, theta[some], 50.0) - theta[some] / drive.ratio
    assert (200 * np.abs(wanted)).max() > 0.5
    assert np.abs(error[some] - wanted).max() < 1e-4 * 1e-5  # of the highest order
    # by the second linearisation, not position by position
    monkeypatch.delattr("swgjoint.maps.ideal_motion.output_angle")
    assert np.array_equal(error_turn(drive, 50.0).signal, turn.signal)


def test_no_load_error_is_the_kinematic_error():
    """Without angle-dependent energy the unloaded output stands at e0 exactly."""
    orders, amplitudes = [(2, 0), (0, 2)], [(3e-5, 0.0), (0.0, 1e-5)]
    drive = with_angles(DriveMap.linear(1e4), orders, amplitudes)
    turn = error_turn(drive)
    theta, error = turn.output_turn()
    psi = theta / drive.ratio + error
    e0 = 3e-5 * np.cos(2 * theta) + 1e-5 * np.sin(2 * (theta - psi))
    assert np.abs(error - e0).max() < 1e-12
    # the two orders beat: 4 and 4 - but at 2 and 2 (1 - 1/i) per input turn
    order, amplitude = turn.lines()
    strongest = order[np.argsort(amplitude)[-2:]]
    assert sorted(strongest) == pytest.approx([2.0, 2.0 * 1.01])
    assert turn.peak_to_peak() == pytest.approx(8e-5, rel=1e-3)


def test_constant_torque_lowers_the_error_by_the_torsion():
    """Under load the transmission error of a linear drive is e0 - T/K."""
    drive = with_angles(DriveMap.linear(1e4), [(4, 0)], [(2e-5, 1e-5)])
    free, loaded = error_turn(drive), error_turn(drive, 100.0)
    # the slope of e0 is no part of the balance at the output
    assert np.abs(free.signal - loaded.signal - 0.01).max() < 1e-12


def test_ripple_of_a_linear_drive():
    """Output on its ideal motion: ripple K e0, in percent of the rated torque."""
    drive = with_angles(DriveMap.linear(1e4), [(4, 0)], [(3e-5, 4e-5)])
    sheet = drive.spec_sheet()
    amplitude = 1e4 * 5e-5
    assert sheet["ripple_pp_percent"] == pytest.approx(2 * amplitude, rel=1e-3)
    assert sheet["ripple_rms_percent"] == pytest.approx(amplitude / 2**0.5, rel=1e-9)
    (line,) = sheet["orders"]
    assert line["order"] == 4.0
    assert line["ripple_percent"] == pytest.approx(amplitude, rel=1e-9)
    assert line["kinematic_error_arcmin"] == pytest.approx(5e-5 / arcmin, rel=1e-9)
    assert ripple_turn(drive, 100.0).signal.mean() == pytest.approx(100.0)


def test_period_of_the_pattern():
    """One cycle without beta; all members back together with it."""
    drive = DriveMap.linear(1e4, teeth_flexspline=121, teeth_circular_spline=123)
    only_alpha = with_angles(drive, [(4, 0), (6, 0)], [(1e-5, 0), (1e-5, 0)])
    assert period_of(only_alpha)[0] == Fraction(1, 2)
    with_beta = with_angles(drive, [(4, 0), (0, 1)], [(1e-5, 0), (1e-5, 0)])
    period, _ = period_of(with_beta)
    assert period == 121  # i = -60.5: two output turns
    turn = error_turn(with_beta)
    later = output_angle(with_beta, 2 * np.pi * 121 + 1.0, 0.0)
    first = output_angle(with_beta, 1.0, 0.0)
    assert later - first == pytest.approx(-4 * np.pi, abs=1e-12)
    assert turn.output_turn()[0][-1] == pytest.approx(2 * np.pi * 60.5)


def test_clearance_shows_as_the_width_of_the_loop():
    """A free output rests where the load left it: width and lost motion by hand."""
    gap = 2e-4
    drive = with_clearance(gap)
    sheet = drive.spec_sheet()
    assert sheet["hysteresis_loss_arcmin"] == pytest.approx(gap / arcmin, rel=1e-4)
    lost = gap + 2 * 4.0 / 1e4
    assert sheet["lost_motion_arcmin"] == pytest.approx(lost / arcmin, rel=1e-6)
    assert sheet["K2_Nm_rad"] == pytest.approx(1e4, rel=1e-6)
    assert float(output_angle(drive, 0.0, 0.0)) == 0.0


def test_a_held_clearance_is_named_as_no_part_of_the_loss():
    """0.1 % of the rated torque holds the output, as in maps with errors of teeth."""
    gap = 4e-4
    sheet = with_clearance(gap, held=0.1).spec_sheet()
    assert sheet["hysteresis_loss_arcmin"] is None
    reason = sheet["missing"]["hysteresis_loss_arcmin"]
    assert names(reason, f"{gap / arcmin:.2g} arcmin", "0.1 %", "--only")
    stiff = DriveMap.linear(1e4).spec_sheet()["missing"]["hysteresis_loss_arcmin"]
    assert not names(stiff, "clearance")


def test_loop_with_hysteresis():
    """A parallelogram loop: width, mid-line and stiffness do not see the first leg."""
    K, w, top = 1e4, 3e-4, 60.0
    up, down = np.linspace(-top, top, 121), np.linspace(top, -top, 121)
    torque = np.concatenate([np.linspace(0, top, 61), down, up])
    torsion = np.concatenate(
        [np.linspace(0, top / K - w / 2, 61), down / K + w / 2, up / K - w / 2]
    )
    loop = TorqueLoop(torque=torque, torsion=torsion)
    assert loop.hysteresis_loss() == pytest.approx(w)
    assert loop.stiffness(0.0, 20.0) == pytest.approx(K)
    assert loop.lost_motion(100.0) == pytest.approx(8.0 / K)
    assert np.isnan(loop.stiffness(50.0, 70.0))


def test_noise_does_not_turn_the_path():
    """A noisy torque signal is still two legs, not hundreds."""
    rng = np.random.default_rng(2)
    torque = np.concatenate([np.linspace(-50, 50, 400), np.linspace(50, -50, 400)])
    noisy = torque + 0.1 * rng.standard_normal(800)
    loop = TorqueLoop(torque=noisy, torsion=torque / 1e4)
    assert [rising for rising, _, _ in loop.legs()] == [True, False]


def test_only_what_is_asked_for(monkeypatch, synthetic_map):
    """Stiffness turns no gear, accuracy runs no loop; other keys do not appear."""

    def forbidden(*_, **__):
        raise AssertionError("not asked for")

    with monkeypatch.context() as patch:
        patch.setattr(sheets, "measure_turns", forbidden)
        sheet = measure_spec(synthetic_map, only=["K2_Nm_rad", "wall_s"])
        assert list(sheet.figures) == ["K2_Nm_rad"]
    monkeypatch.setattr(sheets, "torque_loop", forbidden)
    alone = with_angles(DriveMap.linear(1e4), [(4, 0)], [(1e-5, 0)])
    sheet = measure_spec(alone, only=["transmission_accuracy_arcmin"])
    assert list(sheet.turns) == ["no_load"]


def test_every_key_has_a_value_or_a_reason(synthetic_map):
    """Each null of the sheet has its reason in ``missing``, nothing else has one."""
    for drive in (synthetic_map, DriveMap.linear(1e4)):
        sheet = drive.spec_sheet()
        assert set(KEYS) <= set(sheet)
        empty = {key for key in KEYS if sheet[key] is None}
        assert set(sheet["missing"]) == empty
        assert all(sheet["missing"].values())


def test_unknown_keys_are_refused():
    """A key that the sheet does not have: one line with the nearest."""
    both = ".*K1_Nm_rad" * 2  # the nearest, and among what is accepted
    pattern = naming("'K1'", "T1_Nm", "radial_stiffness_N_mm") + both
    with pytest.raises(InputError, match=pattern):
        DriveMap.linear(1e4).spec_sheet(["K1"])


def test_continued_range_is_said(synthetic_map):
    """A loop beyond the sampled torque is marked."""
    assert not synthetic_map.spec_sheet(["T1_Nm"])["validity"]["beyond_range"]
    far = replace(synthetic_map.ratings, repeated_peak=400.0)
    drive = replace(synthetic_map, ratings=far)
    assert drive.spec_sheet(["T1_Nm"])["validity"]["beyond_range"]


def test_unreachable_torque_is_reported():
    """A torque that the map never exerts is an error, not an endless search."""
    drive = DriveMap.linear(1e4)
    fields = {"end_stiffness": np.zeros((1, 2, 2))}
    with pytest.raises(
        ComputationError, match=naming("torque", "1000 N·m", "'linear'")
    ):
        output_angle(replace(drive, **fields), 0.0, 1000.0)


def test_loop_starts_and_ends_at_rest(synthetic_map):
    """0 -> Tmax -> 0 -> -Tmax -> 0 with Tmax the repeated peak."""
    loop = torque_loop(synthetic_map)
    ends = loop.torque[[0, -1]]
    assert list(np.abs(ends)) == [0.0, 0.0]
    assert (loop.torque.max(), loop.torque.min()) == (100.0, -100.0)
    assert np.argmax(loop.torque) < np.argmin(loop.torque)
    assert abs(loop.torsion[0]) < 1e-15


def test_high_orders_are_not_aliased():
    """A weak high order is sampled too; one beyond every bound is refused."""
    orders = [(2, 0), (0, 300)]
    drive = with_angles(DriveMap.linear(1e4), orders, [(1e-4, 0), (1e-6, 0)])
    order, amplitude = error_turn(drive).lines()
    high = order > 100
    # between 2 alpha and 300 beta, 300 (1 + 1/100) per input turn
    assert order[high][np.argmax(amplitude[high])] == pytest.approx(303.0)
    assert amplitude[high].max() == pytest.approx(1e-6, rel=1e-3)
    assert amplitude[~high].max() == pytest.approx(1e-4, rel=1e-6)
    beyond = with_angles(DriveMap.linear(1e4), [(0, 900_000)], [(1e-4, 0)])
    with pytest.raises(
        ComputationError, match=naming("'linear'", "909000", "10000000", "harmonics")
    ):
        error_turn(beyond)


def test_ripple_that_the_map_cannot_tell_at_rated_torque_is_no_figure(synthetic_map):
    """Rated 50 N·m: a bad row there takes the ripple out, one at 15 N·m does not."""
    there = validated_map(synthetic_map, {15.0: (0.0, 0.0), 50.0: (0.4, 0.02)})
    sheet = there.spec_sheet()
    for key in ("ripple_rms_percent", "ripple_pp_percent"):
        assert sheet[key] is None
        assert names(sheet["missing"][key], "40 %", "input torque", "50 N·m")
    assert {line["ripple_percent"] for line in sheet["orders"]} == {None}
    assert sheet["transmission_accuracy_rated_arcmin"] > 0.0
    assert set(sheet["uncertain"]) == {"orders"}
    elsewhere = validated_map(synthetic_map, {15.0: (0.4, 0.02), 50.0: (0.0, 0.0)})
    own, good = elsewhere.spec_sheet(), synthetic_map.spec_sheet()
    assert own["ripple_rms_percent"] == good["ripple_rms_percent"]
    assert own["uncertain"] == {} and own["validation"]["worst"] == 0.4


def test_figures_are_uncertain_by_the_quantity_that_they_depend_on(synthetic_map):
    """Accuracy by the output error, K by the stiffness, ripple by both."""
    ripple = {"ripple_rms_percent", "ripple_pp_percent", "orders"}
    accuracy = {f"transmission_accuracy{load}_arcmin" for load in ("", "_rated")}
    K = {"K1_Nm_rad", "K2_Nm_rad", "K3_Nm_rad"}
    for row, stiffness, keys in (
        ((0.05, 0.05), 0.01, set()),
        ((0.2, 0.05), 0.01, ripple),
        ((0.05, 0.2), 0.01, ripple | accuracy),
        ((0.05, 0.05), 0.2, K),
    ):
        drive = validated_map(synthetic_map, {50.0: row}, stiffness)
        sheet = drive.spec_sheet()
        assert set(sheet["uncertain"]) == keys
        assert all(one["largest"] == 0.2 for one in sheet["uncertain"].values())
        assert sheet["ripple_rms_percent"] is not None
