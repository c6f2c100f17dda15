"""The stability study: what it weighs, what it compares with, and that it can fail."""

from __future__ import annotations

import json
from dataclasses import replace
from math import log, pi

import numpy as np
import pytest
from messages import names

from swgjoint.bench.stability import arms as stability_arms
from swgjoint.bench.stability import stability
from swgjoint.bench.stability.arms import ArmTask, run_arm
from swgjoint.bench.stability.catalogue import catalogue_drives, run_drive
from swgjoint.bench.stability.contact import (
    KINDS,
    MASSES,
    ContactTask,
    chain,
    contact_tasks,
    gain,
    run_contact,
)
from swgjoint.bench.stability.damping import numerical_damping
from swgjoint.bench.stability.grid import GridJoint, grid, run_joint, situations
from swgjoint.bench.stability.impact import drop, drop_joint, impact_speed
from swgjoint.bench.stability.joint import (
    ERROR,
    REACH,
    Course,
    Start,
    hardening_drive,
    make_joint,
)
from swgjoint.bench.stability.reference import reference
from swgjoint.bench.stability.rows import (
    DEFAULT,
    FREE,
    StabilityRow,
    outcome_of,
    shares,
)
from swgjoint.cli.main import main
from swgjoint.maps.drive_map import DriveMap


def course(energy, **keys):
    """A run with the given energies, of 1 J at the start."""
    energy = np.asarray(energy, float)
    zero = np.zeros((energy.size, 2))
    given = dict(scale=1.0, diverged=False, sub_steps=1) | keys
    return Course(
        time=np.arange(float(energy.size)),
        position=zero,
        velocity=zero,
        energy=energy,
        **given,
    )


def test_a_gain_is_sustained_and_a_loss_is_none():
    """A spike is no gain, a tenth of the run above the start is; losses balance."""
    level = np.ones(201)
    spike = level.copy()
    spike[50] += 0.5
    assert course(spike).gain < 0.05
    assert outcome_of(course(spike)) == "ok"
    lasting = level.copy()
    lasting[40:81] += 0.1
    assert course(lasting).gain == pytest.approx(0.1)
    assert course(lasting).balance == 0.0
    assert outcome_of(course(lasting)) == "energy_gain"
    assert outcome_of(course(lasting), own_gain=0.06) == "ok"
    fading = np.linspace(1.0, 0.0, 201)
    assert course(fading).gain == 0.0
    assert course(fading).balance == pytest.approx(-0.95, abs=0.01)
    assert outcome_of(course(level, sub_steps=3)) == "sub_stepped"
    assert outcome_of(course(level, diverged=True)) == "diverged"


def test_the_drive_of_the_grid_is_the_stated_spring():
    """Torque K s (1 + 2/3 (s/s0)²), stiffness three times as high at full torque."""
    drive = hardening_drive(1e4)
    s = np.linspace(-REACH, REACH, 41)
    closed = 1e4 * s * (1.0 + 2.0 / 3.0 * (s / REACH) ** 2)
    np.testing.assert_allclose(drive.coefficients(s, 1)[:, 0, 0], closed, atol=1e-9)
    assert drive.ratings.repeated_peak == pytest.approx(closed[-1])
    assert drive.max_stiffness == pytest.approx(3e4)
    e0 = drive.error_at(drive.phases(0.0, 0.0))[0]
    assert float(e0) == pytest.approx(2.0 * ERROR)  # 1 arcmin at 2 and at 4 per turn


@pytest.mark.parametrize("group", ["free", "loaded"])
def test_the_default_scheme_meets_the_reference_with_second_order(group):
    """Half the step leaves a quarter of the error against DOP853."""
    drive = hardening_drive(1e3)
    start, _ = situations(drive)[group]
    exact = reference(1e3, rotor=1e-4, link=1.0, start=start)
    coarse, fine = (
        exact.error(make_joint(drive, rotor=1e-4, link=1.0, step=step), start, 1)
        for step in (2e-4, 1e-4)
    )
    assert coarse is not None and fine is not None
    assert coarse / fine == pytest.approx(4.0, rel=0.05)
    assert fine < 1e-3  # arcmin


def test_rk4_agrees_with_the_reference():
    """An explicit integrator at a small step is within 1e-7 arcmin of it."""
    drive = hardening_drive(1e3)
    start, _ = situations(drive)["loaded"]
    exact = reference(1e3, rotor=1e-4, link=1.0, start=start)
    joint = make_joint(drive, rotor=1e-4, link=1.0, step=1e-4, integrator="RK4")
    error = exact.error(joint, start, sub_steps=1)
    assert error is not None and error < 1e-7


@pytest.mark.parametrize("step", [2e-4, 1e-3])
def test_numerical_damping_of_known_schemes(step):
    """Implicit Euler for the native tendon, the polynomial of RK4 for RK4."""

    def joint(**keys):
        drive = hardening_drive(1e4)
        plain = drive.with_harmonics(np.zeros(3, dtype=bool))
        return make_joint(plain, rotor=1e-5, link=0.1, step=step, **keys)

    native = joint(level="native")
    # i²J and the link have 0.1 kg·m² each
    x = step * np.sqrt(native.attached.native.linear / 0.05)
    value = 1.0 / complex(1.0, -x)
    expected = -log(abs(value)) / np.hypot(log(abs(value)), np.angle(value))
    assert numerical_damping(native, 1) == pytest.approx(expected, rel=1e-3)

    x = step * np.sqrt(1e4 / 0.05)
    value = 1 + 1j * x - x**2 / 2 - 1j * x**3 / 6 + x**4 / 24
    expected = -log(abs(value)) / np.hypot(log(abs(value)), np.angle(value))
    got = numerical_damping(joint(integrator="RK4"), 1)
    assert got == pytest.approx(expected, rel=1e-3, abs=1e-10)  # round-off
    # ours is far below either, and below that of a drive
    assert 0.0 < numerical_damping(joint(), 1) < min(1e-3, expected)


STIFF = GridJoint(stiffness=1e6, rotor=1e-7, link=1e-4, steps=(1e-3,), others=True)


def test_stiff_joints_fail_where_steps_are_not_cut():
    """Uncut the joint gains energy or diverges, RK4 diverges; cut it does neither."""
    rows = run_joint(STIFF)
    for row in rows:
        if row.scheme == DEFAULT:
            assert row.outcome in ("sub_stepped", "refused"), row
            assert row.reason
            assert not row.unexplained
    own = [row for row in rows if row.scheme == DEFAULT]
    assert [row.outcome for row in own].count("sub_stepped") >= 4
    others = {(row.scheme, row.group): row.outcome for row in rows}
    assert others["RK4", "free"] == "diverged"
    assert others["discrete, never cut", "loaded"] in ("diverged", "energy_gain")


def test_easy_joints_run_at_their_own_step():
    """A real shoulder is not cut, keeps its energy, and has its error stated."""
    task = GridJoint(stiffness=3e4, rotor=1e-4, link=1.0, steps=(5e-4,))
    rows = {row.group: row for row in run_joint(task)}
    for group in ("free", "loaded", "released", "step"):
        assert rows[group].outcome == "ok"
        assert rows[group].largest_gain < 1e-3
        assert abs(rows[group].energy_balance) < 0.02
    assert 0.0 < rows["loaded"].error < 0.1
    assert rows["free"].numerical_damping_ratio < rows["free"].physical_damping_ratio


def test_a_dropped_link_comes_to_rest():
    """The floor takes the energy of the fall, and gravity holds the link down."""
    joint = drop_joint(hardening_drive(1e4), rotor=1e-6, link=0.1, step=1e-3)
    parts = joint.region(impact_speed(), contacts=True).sub_steps
    fallen = drop(joint, duration=2.0, sub_steps=parts)
    assert not fallen.diverged
    assert fallen.balance < -0.9
    assert abs(fallen.position[-1, 1]) < 0.02
    # falling freely it keeps its energy: the first contact comes after 10 ms
    air = fallen.time < 0.01
    np.testing.assert_allclose(
        fallen.energy[air], fallen.energy[0], rtol=2e-3 * fallen.scale
    )


def test_contacts_ask_for_shorter_steps_of_a_light_link():
    """A light link on a stiff drive runs at a step that is cut with contacts."""
    joint = make_joint(hardening_drive(1e5), rotor=1e-4, link=1e-3, step=1e-3)
    assert joint.region(0.0).sub_steps == 1
    region = joint.region(0.0, contacts=True)
    # mean stiffness a little above 1e5 N·m/rad: 1.4 * 1e-3 * sqrt(1e8) = 14 over 2.5
    assert region.sub_steps == 7
    assert "with contacts" in region.exceeded


def test_catalogue_drives_run_free_and_take_their_ratcheting_torque():
    """Ten seconds of free running keep the energy; torque steps do not add any."""
    drives = catalogue_drives()
    assert len(drives) == 22
    [task] = [d for d in drives if d.name == "CSG-25-100"]
    assert (task.rotor, task.ratcheting) == (pytest.approx(4.13e-5), 650.0)
    rows = run_drive(task)
    assert {row.group for row in rows} == {FREE, "ratchet"}
    for row in rows:
        assert row.outcome in ("ok", "sub_stepped")
        assert row.largest_gain < 1e-3
        if row.group == FREE:
            assert abs(row.energy_balance) < 0.05


def test_a_falling_arm_keeps_its_energy(monkeypatch):
    """Kinetic, torsion and gravity energy together stay within 1 % at 2 ms."""
    monkeypatch.setattr(stability_arms, "run_scene", _no_scene)
    [row] = run_arm(ArmTask(scene="panda-sweep", steps=(2e-3,)))[:1]
    assert row.group == "fall"
    assert row.outcome == "sub_stepped"
    assert row.largest_gain < 0.01 and abs(row.energy_balance) < 0.01


@pytest.mark.parametrize("kind", KINDS)
def test_chains_in_contact_come_to_rest(kind):
    """The contact takes the energy of the fall; the torsion of the drives adds none."""
    [drive] = [d for d in catalogue_drives() if d.name == "CSG-17-100"]
    task = ContactTask(drive=drive, kind=kind, mass=0.3, damping_ratios=(0.001,))
    rows = run_contact(task)
    assert [row.outcome for row in rows] == ["ok", "ok", "sub_stepped"]
    assert max(row.largest_gain for row in rows) < 0.05
    assert max(row.energy_balance for row in rows) < -0.1


@pytest.mark.parametrize(("name", "kind"), [("17-120", "floor"), ("17-80", "limit")])
def test_a_chain_without_any_loss_gains_nothing_in_contact(name, kind):
    """It takes its contact damping alone; without, it gains up to 2.3 times its fall.

    A floor of the engine feeds the torsion of a chain that bounces, also under RK4.
    """
    [drive] = [d for d in catalogue_drives() if d.name == f"CSG-{name}"]
    task = ContactTask(
        drive=drive, kind=kind, mass=0.3, steps=(5e-4,), damping_ratios=(0.0,)
    )
    [row] = run_contact(task)
    assert row.outcome == "sub_stepped"
    assert row.largest_gain < 0.05
    assert row.energy_balance < -0.1


def test_only_a_drive_without_losses_has_contact_damping():
    """From a damping ratio of 0.001 on, or with friction, a drive is left as it is."""
    [drive] = [d for d in catalogue_drives() if d.name == "CSG-17-100"]
    task = ContactTask(drive=drive, kind="floor", mass=0.3)
    for ratio, critical in ((0.0, 0.05), (9e-4, 0.05), (0.001, 0.0)):
        _, drives = chain(task, 1e-3, ratio)
        for one in drives:
            whole = 2.0 * np.sqrt(one.stiffness / one.mobility)
            assert one.contact_damping == pytest.approx(critical * whole, rel=1e-12)


def test_a_gain_after_a_loss_is_one():
    """A rise above the lowest mean before counts, also below that at the start."""
    assert gain(np.array([0.0, -1.0, -0.9, -0.7, -0.8])) == pytest.approx(0.3)
    assert gain(np.array([0.0, -0.5, -0.5, -0.6])) == 0.0
    assert gain(np.array([0.0, np.inf])) == np.inf


def test_the_chains_span_the_catalogue():
    """Every drive, both kinds and masses; the quick grid has a few of them."""
    every = contact_tasks(full=True)
    assert len({task.name for task in every}) == 22 * len(KINDS) * len(MASSES)
    few = contact_tasks(full=False)
    assert {task.name for task in few} < {task.name for task in every}
    assert {task.kind for task in few} == set(KINDS)


def _no_scene(*_, **__):
    from types import SimpleNamespace

    none = np.zeros((1, 7))
    assembly = SimpleNamespace(
        sub_steps=1,
        outside={},
        transmissions=[
            SimpleNamespace(attached=SimpleNamespace(natural_frequency=1.0))
        ],
    )
    return SimpleNamespace(position=none, assembly=assembly)


@pytest.fixture
def small(monkeypatch):
    """The study with one joint of the grid and one drive, no arms, no chains."""
    monkeypatch.setattr(stability, "SCENES", ())
    monkeypatch.setattr(stability, "grid", lambda full: [replace(STIFF, others=False)])
    monkeypatch.setattr(stability, "contact_tasks", lambda full: [])
    monkeypatch.setattr(stability, "catalogue_drives", lambda: catalogue_drives()[:1])


def test_the_command_writes_json_table_and_picture(small, capsys, tmp_path):
    """One JSON object with the promised keys; status 0 when nothing is unexplained."""
    out = tmp_path / "out"
    assert main(["stability", "--jobs", "1", "--out", str(out), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["default_scheme"] == DEFAULT
    assert result["unexplained"] == []
    assert sum(result["shares"].values()) == pytest.approx(1.0)
    assert result["refused_share"] == result["shares"]["refused"]
    keys = {"case", "scheme", "step_s", "outcome", "error", "energy_balance"}
    assert all(keys <= row.keys() for row in result["rows"])
    table, picture = sorted(out.iterdir())
    assert len(table.read_text().splitlines()) == 1 + len(result["rows"])
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_command_fails_when_a_run_went_wrong(small, capsys, monkeypatch):
    """An energy gain of the default scheme is listed and gives status 1."""
    wrong = StabilityRow(
        case="made up",
        group=FREE,
        scheme=DEFAULT,
        step_s=1e-3,
        outcome="ok",
        energy_balance=-0.2,
    )
    monkeypatch.setattr(stability, "run_task", lambda task: [wrong])
    assert main(["stability", "--jobs", "1"]) == 1
    assert "free 10 s: made up at 1 ms" in capsys.readouterr().out
    assert replace(wrong, scheme="RK4").unexplained is False
    assert replace(wrong, energy_balance=-0.01).unexplained is False
    assert replace(wrong, group="drop", outcome="diverged").unexplained


def test_bad_jobs_are_refused(capsys):
    """One line on stderr, status 2."""
    assert main(["stability", "--jobs", "0"]) == 2
    assert names(capsys.readouterr().err, "--jobs", "0", "1", "256")


def test_the_grid_spans_what_it_says():
    """Stiffness 1e2 to 1e7, rotor 1e-7 to 1e-3, link 1e-4 to 1e2, 0.01 to 5 ms."""
    joints = grid(full=True)
    assert len(joints) == 6 * 5 * 7
    for name, low, high in (
        ("stiffness", 1e2, 1e7),
        ("rotor", 1e-7, 1e-3),
        ("link", 1e-4, 1e2),
    ):
        values = [getattr(joint, name) for joint in joints]
        assert (min(values), max(values)) == (low, high)
    assert (min(joints[0].steps), max(joints[0].steps)) == (1e-5, 5e-3)
    assert {joint.name for joint in grid(full=False)} < {j.name for j in joints}


def test_a_start_under_torque_is_wound_up_by_it():
    """Torsion at the start is that of the torque; the load then holds or lets go."""
    drive = hardening_drive(1e4)
    full = drive.ratings.repeated_peak
    joint = make_joint(drive, rotor=1e-4, link=1.0, step=1e-4)
    held = joint.run(Start(torque=full, load=full), duration=0.05)
    np.testing.assert_allclose(drive.torsion(*held.position[0]), REACH)
    gone = joint.run(Start(torque=full), duration=0.05)
    # half a period of 2 pi sqrt(0.5 kg·m²/K): it swings through to the other side
    torsion = drive.torsion(*gone.position.T)
    assert torsion.min() == pytest.approx(-REACH, rel=0.1)
    assert pi / np.sqrt(3e4 / 0.5) < 0.05


def test_shares_count_the_default_scheme_only():
    """A refused run of another scheme does not count."""
    row = StabilityRow(
        case="a", group="free", scheme=DEFAULT, step_s=1e-3, outcome="ok"
    )
    rows = [row, replace(row, outcome="refused"), replace(row, scheme="RK4")]
    assert shares(rows)["ok"] == shares(rows)["refused"] == 0.5


@pytest.mark.slow
def test_the_study_finds_nothing_unexplained(monkeypatch):
    """Grid, catalogue and arms: no gain, at most 5 % refused, no arm refused.

    Every fifth joint of the grid, neither of whose lengths is a multiple of five, and
    every fifth chain in contact: both kinds. The other schemes have no claim here.
    """
    every = [replace(joint, others=False) for joint in stability.grid(full=False)]
    chains = contact_tasks(full=False)
    assert {task.kind for task in chains[::5]} == set(KINDS)
    monkeypatch.setattr(stability, "grid", lambda full: every[::5])
    monkeypatch.setattr(stability, "contact_tasks", lambda full: chains[::5])
    result = stability.run_stability(jobs=1)
    assert result["unexplained"] == []
    assert result["refused_share"] < 0.05
    assert result["arms_refused"] == 0


def test_the_maps_of_the_study_have_no_losses():
    """Catalogue maps may have friction and hysteresis; a study of energy has none."""
    from swgjoint.bench.stability.joint import with_kinematic_error

    drive = with_kinematic_error(DriveMap.from_catalogue("CHA-25-100"))
    assert drive.hysteresis == () and drive.friction is None
