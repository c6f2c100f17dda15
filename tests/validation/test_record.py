"""Records of simulations: right numbers, kept, taken up again, failures included."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from swgjoint.errors import ComputationError, Outcome
from swgjoint.fe import meshing
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.meshing_run import MeshingStep
from swgjoint.gear.design.design import Design
from swgjoint.validation.thesis import record
from swgjoint.validation.thesis.cases import KINDS
from swgjoint.validation.thesis.record import RunSpec, compute, record_run
from swgjoint.validation.thesis.stress_places import StressPlaces

SHORT = RunSpec(
    design=Design.preset("reference-2d"), torque=20.0, positions=2, turn=0.01
)


@cache
def short():
    return compute(SHORT)


@pytest.fixture
def cache_here(tmp_path, monkeypatch):
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path))
    return tmp_path / "studies"


def test_averages_are_those_of_the_simulation():
    """The record repeats what swgjoint meshing reports: averages, set-up, last."""
    run = simulate_meshing(
        SHORT.design, torque=20.0, steps=2, turn=0.01, half=True
    ).to_json()
    found = short()
    assert found.ok and found.failed_positions == 0
    average = run["flexspline"]["average_max_MPa"]
    assert found.average == pytest.approx(average, rel=1e-12)
    for kind in KINDS:
        steps = run["per_step"][f"{kind}_MPa"]
        assert found.per_position[kind] == pytest.approx(steps, rel=1e-12)
        assert found.last[kind] == pytest.approx(steps[-1], rel=1e-12)
        assert sum(found.places[kind].values()) == 2
    assert list(found.setup) == ["wave_generator", "meshed", "torque"]
    for state in run["setup_MPa"]:
        assert found.setup[state["state"]] == pytest.approx(state["flexspline"])


def test_tensile_stress_of_the_reference_sits_in_a_fillet():
    """Thesis section 4.6: the largest tensile stress is in the root of the teeth."""
    found = short()
    assert set(found.places["tensile"]) == {"fillet"}
    assert found.away["tensile"] == found.average["tensile"]


def test_contact_neighbourhood_holds_the_loaded_nodes():
    """Teeth in contact have one, around the flank node that carries most force."""
    run = simulate_meshing(SHORT.design, torque=20.0, steps=1, half=True)
    state, element = run.steps[0].state, run.model.element
    near = StressPlaces(model=run.model).near_contact(state)
    force = state.flank_force.reshape(len(near), -1, 2)
    load = np.linalg.norm(force, axis=-1)
    mesh = element.mesh
    flank = np.concatenate([mesh.flank_right[:-1], mesh.flank_left[:-1]])
    loaded = load.max(axis=1) > 0.0
    # two to three pairs a lobe touch, thesis section 4.5
    assert 2 <= loaded.sum() <= 4
    assert np.array_equal(near.any(axis=1), loaded)
    for sector in np.flatnonzero(loaded):
        assert near[sector, flank[load[sector].argmax()]]
    assert near[loaded].mean() < 0.3


def test_stress_away_from_contacts_is_no_larger():
    """Leaving out nodes never raises a maximum."""
    found = short()
    assert all(found.away[kind] <= found.average[kind] for kind in KINDS)


def test_resumes_from_the_cache(cache_here, monkeypatch):
    """A second study takes the record up again; a damaged one is computed again."""
    calls = []

    def counted(spec):
        calls.append(spec)
        return short()

    monkeypatch.setattr(record, "compute", counted)
    first = record_run(SHORT)
    assert record_run(SHORT) == first == short()
    assert len(calls) == 1
    (entry,) = cache_here.iterdir()
    entry.write_text(entry.read_text()[:100])
    assert record_run(SHORT) == first
    assert len(calls) == 2
    monkeypatch.setenv("SWGJOINT_CACHE", "")
    record_run(SHORT)
    assert len(calls) == 3


def test_key_depends_on_everything():
    """Design, torque, positions and turn each change the key; the name does not."""
    finer = SHORT.design.with_changes({"mesh.refinement": 2})
    others = [
        RunSpec(design=SHORT.design, torque=2.0, positions=2, turn=0.01),
        RunSpec(design=SHORT.design, torque=20.0, positions=3, turn=0.01),
        RunSpec(design=SHORT.design, torque=20.0, positions=2, turn=0.02),
        RunSpec(design=finer, torque=20.0, positions=2, turn=0.01),
    ]
    assert len({spec.name for spec in (SHORT, *others)}) == 5
    renamed = SHORT.design.with_changes({"drive.name": "other"})
    again = RunSpec(design=renamed, torque=20.0, positions=2, turn=0.01)
    assert again.name == SHORT.name


def test_a_failure_is_recorded(monkeypatch):
    """A set-up that cannot be solved is a record with the advice, not an exception."""

    def stuck(*_, **__):
        raise ComputationError(f"loading failed: {Outcome.DIVERGED.value}")

    monkeypatch.setattr(meshing, "simulate_meshing", stuck)
    found = compute(SHORT)
    assert found.outcome == "failed" and not found.ok
    assert "lower the torque" in found.message
    assert found.average == {}


def test_positions_that_fail_are_counted(monkeypatch):
    """Averages are over the positions that were solved; the others are counted."""

    def last_fails(*args, **options):
        run = simulate_meshing(*args, **options)
        bad = MeshingStep(input_angle=1.0, outcome=Outcome.MAX_ITERATIONS)
        return replace(run, steps=(run.steps[0], bad))

    monkeypatch.setattr(meshing, "simulate_meshing", last_fails)
    found = compute(SHORT)
    assert found.outcome == "max_iterations" and found.failed_positions == 1
    assert "use smaller load steps" in found.message
    for kind in KINDS:
        first = short().per_position[kind][0]
        assert found.per_position[kind] == [first, None]
        assert found.average[kind] == first
        assert found.last[kind] is None


def test_a_tooth_that_cannot_be_built_is_recorded():
    """A design whose tooth does not close is refused, in the record."""
    design = SHORT.design.with_changes({"flexspline.profile.root_radius_mm": 1.9})
    found = compute(RunSpec(design=design, torque=20.0, positions=2, turn=0.01))
    assert found.outcome == "refused"
    assert "flexspline.profile." in found.message
