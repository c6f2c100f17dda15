"""``swgjoint advise``: it is right, and says so when nothing will do."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from messages import names, naming

from swgjoint.bench.joint.scenes import exact
from swgjoint.cli.main import main
from swgjoint.errors import ComputationError, InputError
from swgjoint.explore.advise import reference as advise_reference
from swgjoint.explore.advise import search as advise_search
from swgjoint.explore.advise.advise import STEPS, advise
from swgjoint.explore.advise.bound import parse_bound
from swgjoint.explore.advise.reference import settle
from swgjoint.explore.advise.search import ALIKE, choose_row
from swgjoint.joint.attach import LEVELS
from swgjoint.sim.accuracy import (
    SCENE_INTEGRATORS,
    Setting,
    SettingOutcome,
    attempt,
    common_samples,
    errors,
)
from swgjoint.sim.motion.trajectory import time_grid


@pytest.fixture(scope="module")
def best(bench):
    """The bench by DOP853."""
    setting = Setting(level="full", integrator="RK4", step=1e-4)
    got = attempt(bench.scene, setting, bench.drives)
    return exact(got.run, got.assembly)


@pytest.mark.parametrize(
    ("text", "quantity", "value"),
    [
        ("0.1arcmin", "link_angle", 0.1),
        ("6 arcsec", "link_angle", 0.1),
        ("2.908882086657216e-5rad", "link_angle", 0.1),
        ("1E-3deg", "link_angle", 0.06),
        ("0.05mm", "tool_position", 0.05),
        ("50um", "tool_position", 0.05),
    ],
)
def test_errors_take_units(text, quantity, value):
    """Angles become arc minutes, lengths millimetres."""
    bound = parse_bound(text)
    assert (bound.quantity, bound.value) == (quantity, pytest.approx(value))


UNITS = ("rad", "deg", "arcmin", "arcsec", "m", "mm", "um")


@pytest.mark.parametrize(
    "text",
    [
        *("0.1", "arcmin", "0arcmin", "-1mm", "1inch", "1.2.3mm", "nanmm", "1e999mm"),
        "1e308rad",  # finite, but not in arc minutes
        "1e308m",
    ],
)
def test_other_errors_are_refused(text):
    """The message has what was given and what would be accepted."""
    with pytest.raises(InputError, match=naming("--error", f"'{text}'", "> 0", *UNITS)):
        parse_bound(text)


def test_the_reference_is_the_solution(bench, best):
    """Extrapolated steps of the scheme meet DOP853 within what is said of them."""
    found = settle(bench.scene, parse_bound("0.02arcmin"), bench.drives)
    off = errors(found.run, best)["link_angle"]
    assert found.error <= 0.02 * 0.02
    assert off < 0.05 * 0.02


@pytest.mark.parametrize("text", ["2arcmin", "0.02arcmin", "0.01mm"])
def test_the_advice_is_right(bench, best, text):
    """Within the bound by DOP853, and no cheaper setting that was tried is."""
    bound = parse_bound(text)
    found = advise(bench.scene, bound, drives=bench.drives)
    errors_by_setting = {}
    for row in found["rows"]:
        setting = Setting(
            level=row["level"], integrator=row["integrator"], step=row["step_s"]
        )
        run = attempt(bench.scene, setting, bench.drives).run
        errors_by_setting[setting] = (
            row["cost"],
            None if run is None else errors(run, best)[bound.quantity],
        )
    chosen = Setting(
        level=found["level"], integrator=found["integrator"], step=found["step_s"]
    )
    cost, error = errors_by_setting.pop(chosen)
    assert error <= bound.value
    assert error == pytest.approx(found["expected_error"], rel=0.05)
    for other_cost, other in errors_by_setting.values():
        assert other is None or other > bound.value or ALIKE * other_cost >= cost


LEVEL_COST = dict(zip(LEVELS, (1.0, 1.2, 1.3, 1.5, 3.0), strict=True))


def cost_by_rule(own, rigid=None):
    """Of an arm, without a clock: level, integrator, step of the engine."""
    [one] = own.assembly.transmissions
    by = 1.0 if own.assembly.scene.simulation.integrator == "discrete" else 3.0
    return LEVEL_COST[one.attached.level] * by * 1e-3 / own.assembly.step


@pytest.mark.parametrize("text", ["1.7arcmin", "0.15arcmin"])
def test_the_advice_is_the_best_of_all_settings(bench, best, text, monkeypatch):
    """Every level, integrator and step is run; none that is within costs less."""
    bound, steps = parse_bound(text), (1e-3, 2e-3, 5e-3)
    monkeypatch.setattr(advise_search, "relative_cost", cost_by_rule)
    within = {}
    for level in LEVELS:
        for integrator in SCENE_INTEGRATORS:
            for step in steps:
                setting = Setting(level=level, integrator=integrator, step=step)
                got = attempt(bench.scene, setting, bench.drives)
                if got.run is None:
                    continue
                error = errors(got.run, best)[bound.quantity]
                if error <= bound.value:
                    cost = cost_by_rule(SimpleNamespace(assembly=got.assembly))
                    within[level, integrator, step] = cost
    found = advise(bench.scene, bound, drives=bench.drives, steps=steps)
    assert min(within, key=within.get) == tuple(
        found[key] for key in ("level", "integrator", "step_s")
    )
    assert len(within) > 1


def test_costs_that_timing_cannot_tell_apart_are_equal():
    """Then the lower level, then the smaller error; a few per cent decide nothing."""

    def row(level, cost, error, within=True):
        return {"level": level, "cost": cost, "error": error, "within": within}

    for noise in (0.99, 1.0, 1.01):
        rows = [
            row("native", 1.00, 0.1),
            row("linear", 1.03 * noise, 0.3),
            row("linear", 1.02 / noise, 0.2),
            row("rigid", 1.09 * noise, 0.1),
            row("rigid", 0.50, 9.0, within=False),
        ]
        assert choose_row(rows) is choose_row(rows[::-1]) is rows[2]
    assert choose_row(rows[4:]) is None


def test_levels_that_cannot_do_it_are_left_early(bench):
    """A rigid joint does not come nearer by shorter steps: they are not tried."""
    found = advise(bench.scene, parse_bound("0.02arcmin"), drives=bench.drives)
    tried = [row for row in found["rows"] if row["level"] == "rigid" and row["cost"]]
    assert 1 <= len(tried) < len(STEPS)
    assert found["level"] == "full"


def test_nothing_reaches_it(bench):
    """The message names the best that was reached."""
    with pytest.raises(
        ComputationError,
        match=naming("bench", "1e-04arcmin", "full", "ms", "arcmin", "--error"),
    ):
        advise(
            bench.scene,
            parse_bound("1e-04arcmin"),
            drives=bench.drives,
            steps=(1e-3, 2e-3),
            levels=("rigid", "full"),
        )


def test_a_run_that_fails_ends_what_was_settled_before(bench, monkeypatch):
    """Two extrapolations that agreed say nothing of the steps after a failure."""
    outcomes = iter(["ok", "ok", "ok", "cut", "ok", "ok"])

    def attempted(*_):
        outcome = next(outcomes)
        run = object() if outcome == "ok" else None
        return SettingOutcome(run=run, assembly=None, outcome=outcome, reason=outcome)

    monkeypatch.setattr(advise_reference, "attempt", attempted)
    monkeypatch.setattr(advise_reference, "_extrapolated", lambda fine, coarse: fine)
    # not yet settled, and near enough to be taken in the end
    monkeypatch.setattr(advise_reference, "errors", lambda *_: {"link_angle": 0.1})
    with pytest.raises(
        ComputationError, match=naming("bench", "full", "reference", "cut")
    ):
        settle(bench.scene, parse_bound("1arcmin"), bench.drives)


def test_a_scene_with_a_sampled_loop_gets_its_advice(bench):
    """It keeps every step: every 0.2 ms in a run, every 0.125 ms in the reference."""
    scene = bench.scene.with_changes(
        {
            "controller": {
                "kind": "computed_torque",
                "natural_frequency_Hz": 8.0,
                "damping_ratio": 1.0,
            }
        }
    )
    found = advise(
        scene,
        parse_bound("0.3arcmin"),
        drives=bench.drives,
        levels=("full",),
        steps=(2e-4,),
    )
    assert found["step_s"] == 2e-4
    assert 0.0 < found["expected_error"] <= 0.3


@pytest.mark.parametrize(
    ("own", "other", "common"),
    [
        (2e-4, 1.25e-4, 1e-3),
        (1e-3, 1e-3 / 64, 1e-3),
        (5e-4, 5e-3, 5e-3),
        (3e-4, 1e-3, 3e-3),
        (1e-3, 1e-3, 1e-3),
    ],
)
def test_common_samples_of_two_runs(own, other, common):
    """They are one least common multiple of the two intervals apart."""
    # runs end at the whole step that is nearest to 11 s
    times = [time_grid(11.0, step) for step in (own, other)]
    runs = [SimpleNamespace(time=time) for time in times]
    slices = common_samples(*runs)
    kept = [time[part] for time, part in zip(times, slices, strict=True)]
    expected = common * np.arange(len(kept[0]))
    assert np.allclose(kept[0], expected, rtol=0.0, atol=1e-9)
    assert np.allclose(kept[1], expected, rtol=0.0, atol=1e-9)
    assert len(kept[0]) > 10.99 / common


def test_runs_without_common_samples_are_refused():
    """The start alone is no comparison; neither are times that drift apart."""
    for own, other in ((np.arange(5) * 0.1, np.arange(5) * 0.09), ([0, 1], [0, 3])):
        runs = [SimpleNamespace(time=np.asarray(time)) for time in (own, other)]
        with pytest.raises(ValueError, match="samples at the same times"):
            common_samples(*runs)


def test_a_bound_beyond_the_reference(bench, monkeypatch):
    """A reference that does not settle is no reference."""
    monkeypatch.setattr(advise_reference, "REFERENCE_STEPS", (2e-3, 1e-3, 5e-4))
    with pytest.raises(
        ComputationError,
        match=naming("bench", "reference", "1e-4arcmin", "0.5 ms", "--error"),
    ):
        settle(bench.scene, parse_bound("1e-4arcmin"), bench.drives)


SCENE = """
name = "short"
arm = "bench"
[defaults]
drive = "CSG-25-100"
rotor_inertia_kgm2 = 1e-4
[trajectory]
kind = "sweep"
hold_s = 0.05
ramp_s = 0.1
[trajectory.start_deg]
joint = 0.0
[trajectory.end_deg]
joint = 2.0
[load.joint]
rated_fraction = 0.3
[simulation]
duration_s = 0.5
"""


def test_advise_command(tmp_path, capsys, monkeypatch):
    """One JSON object with the contract's keys for a scene file; then lines."""
    # a busy machine may time the kinematic arm as cheaper than the rigid one
    monkeypatch.setattr(advise_search, "relative_cost", cost_by_rule)
    path = tmp_path / "short.toml"
    path.write_text(SCENE)
    assert main(["advise", str(path), "--error", "20arcmin", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["level"] == "rigid" and result["step_s"] == 5e-3
    assert result["integrator"] == "discrete"
    assert 0.0 < result["expected_error_arcmin"] <= 20.0
    assert any(row["within"] for row in result["rows"]) and result["cost"] > 0.0
    assert main(["advise", str(path), "--error", "0.1mm"]) == 0
    assert "short within 0.1mm: level" in capsys.readouterr().out


def test_advise_refuses(tmp_path, capsys):
    """One line, exit status 2; 1 where the computation finds nothing."""
    assert main(["advise", "bench", "--error", "0.1"]) == 2
    assert names(capsys.readouterr().err, "--error", "'0.1'", "> 0", *UNITS)
    assert main(["advise", "no-such-scene", "--error", "0.1arcmin"]) == 2
    capsys.readouterr()
    path = tmp_path / "short.toml"
    path.write_text(SCENE)
    assert main(["advise", str(path), "--error", "1e-9arcmin"]) == 1
    line = capsys.readouterr().err.splitlines()[-1]
    assert names(line, "short.toml", "1e-9arcmin", "0.015625 ms", "--error")
