"""Journals of tuning: refused in one line when they are damaged or of another run."""

from __future__ import annotations

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from messages import naming

from swgjoint.errors import InputError
from swgjoint.explore.tune.result import TuneSettings
from swgjoint.explore.tune.search import JOURNAL, GainSearch, run_search, write_journal
from swgjoint.explore.tune.tune import tune
from swgjoint.maps.drive_map import DriveMap
from swgjoint.store import arrays_content


def settings(**changes):
    """Two generations of plain PD."""
    keys = {
        "environment": "JointTracking-v0",
        "controller": "pd",
        "evaluations": 12,
        "arguments": {"episode_s": 0.5, "max_speed_rad_s": 0.3},
        "population": 6,
        "training": 2,
        "held_out": 2,
    }
    return TuneSettings(**(keys | changes))


@pytest.fixture
def search():
    """One of two parameters and two generations, by differential evolution."""
    made = GainSearch()
    go_on(made)
    return made


def go_on(search, *, optimiser="de", generations=2, costs=None, after=lambda: None):
    """Run a search to so many generations of a bowl."""
    run_search(
        optimiser,
        search,
        costs=costs or (lambda x: np.square(x - 0.3).sum(axis=1, keepdims=True)),
        more=lambda: len(search.places) < generations,
        start=np.array([0.5, 0.5]),
        size=6,
        seed=3,
        clock=lambda: 0.0,
        after=after,
    )


def test_resumption_asks_for_its_own_journal(tmp_path):
    """Another seed, a missing or a damaged journal: one line, asked for or not."""
    chosen = settings()
    with pytest.raises(InputError, match=naming(JOURNAL, "resume", "--out")):
        tune(chosen, folder=tmp_path, resume=True)
    first = tune(chosen, folder=tmp_path)
    journal = tmp_path / JOURNAL
    whole = journal.read_bytes()
    other, older = settings(seed=1), io.BytesIO()
    np.savez(older, **arrays_content(whole))  # without a checksum
    flipped = whole.replace(b"costs", b"coins")
    for resume in (False, True):
        with pytest.raises(InputError, match=naming(JOURNAL, "seed 0", "1", "--out")):
            tune(other, folder=tmp_path, resume=resume)
        for damaged in (whole[:300], b"", b"x", flipped, older.getvalue()):
            journal.write_bytes(damaged)
            with pytest.raises(InputError, match=naming(JOURNAL, "journal", "--out")):
                tune(chosen, folder=tmp_path, resume=resume)
            assert journal.read_bytes() == damaged
        journal.write_bytes(whole)
    assert tune(chosen, folder=tmp_path).best.values == first.best.values
    assert journal.read_bytes() == whole


@pytest.mark.parametrize("header", [[], ["seed"], 3, None, "seed", True])
def test_a_header_is_an_object(header, tmp_path, search):
    """Any other JSON value is a damaged journal, not a traceback."""
    write_journal(tmp_path, header, {"pd": search})
    with np.load(tmp_path / JOURNAL) as file:
        assert json.loads(str(file["header"])) == header
    with pytest.raises(InputError, match=naming(JOURNAL, "journal", "--out")):
        tune(settings(), folder=tmp_path, resume=True)


@pytest.mark.parametrize("optimiser", ["de", "cma", "optuna"])
def test_a_journal_of_other_places_is_refused(optimiser):
    """Every optimiser lets the line through, also one that catches value errors."""
    if optimiser != "de":
        pytest.importorskip(optimiser)
    search = GainSearch()
    go_on(search, optimiser=optimiser)
    search.places[1][0, 0] += 1e-9
    with pytest.raises(
        InputError,
        match=naming("tune.npz", "generation 2", "swgjoint", "scipy", "cma", "optuna"),
    ):
        go_on(search, optimiser=optimiser, generations=3)


def test_errors_of_costs_and_journals_are_kept():
    """What goes wrong in a generation arrives as what it was."""

    def full():
        raise InputError("cannot write tune.npz: No space left on device")

    def broken(places):
        raise TypeError("of the environment")

    with pytest.raises(InputError, match="No space left"):
        go_on(GainSearch(), after=full)
    with pytest.raises(TypeError, match="of the environment"):
        go_on(GainSearch(), costs=broken)


def test_a_changed_drive_is_another_run(tmp_path):
    """The path alone does not tell: the file may hold another drive by now."""

    def written(error):
        drive = DriveMap.linear(
            16e3,
            teeth_flexspline=200,
            teeth_circular_spline=202,
            rated_torque=40.0,
        )
        shape = np.zeros((2, 2))
        shape[1, 0] = error
        potential, ends = (
            np.concatenate([x, np.zeros_like(x)])
            for x in (drive.potential, drive.end_stiffness)
        )
        replace(
            drive,
            orders=[[0, 0], [2, 0]],
            potential=potential,
            end_stiffness=ends,
            kinematic_error=shape,
        ).save(path)

    path = tmp_path / "own.swg"
    arguments = settings().arguments | {"drive": str(path)}
    chosen, folder = settings(arguments=arguments), tmp_path / "out"
    written(1e-4)
    tune(chosen, folder=folder)
    written(2e-4)
    with pytest.raises(
        InputError, match=naming(JOURNAL, "drive_content") + r".*'\w{16}'.*'\w{16}'"
    ):
        tune(chosen, folder=folder, resume=True)
    written(1e-4)
    assert tune(chosen, folder=folder, resume=True).best.values
