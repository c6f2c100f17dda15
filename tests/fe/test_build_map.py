"""From finite elements to a map: every layout, unseen torques, refusals."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from messages import names, naming
from solved import coarse, few_teeth

from swgjoint.drives import solve_map as solving
from swgjoint.drives.build_map import build_map
from swgjoint.errors import ComputationError, InputError, Outcome
from swgjoint.fe.common import sampling
from swgjoint.fe.common.columns.torque_columns import ColumnGrid
from swgjoint.fe.common.sampling import sample_map
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.tolerances import sampling as tolerance_sampling
from swgjoint.fe.tolerances.sampling import sample_tolerances
from swgjoint.gear.design.design import Design
from swgjoint.maps import unfinished
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.file import map_bytes
from swgjoint.maps.fit.between_angles import with_mirrored_torques
from swgjoint.maps.fit.fit import fit_map
from swgjoint.maps.unfinished import Unfinished, UnfinishedSeries

LAYOUTS = ("circular_spline_fixed", "flexspline_fixed", "wave_generator_fixed")
ANGLES, COARSE_ANGLES = 14, 12


@pytest.fixture
def samples(layout, coarse_samples):
    """Of the same drive with another member fixed."""
    if layout == LAYOUTS[0]:
        return coarse_samples
    design = coarse("reference-2d-simplified", **{"drive.layout": layout})
    return sample_map(design, angles=ANGLES)


@pytest.mark.fe
@pytest.mark.parametrize("layout", LAYOUTS)
def test_map_of_a_design(samples):
    """The pattern repeats, energy and the unseen input torque agree with the map."""
    drive = fit_map(samples, keep=0.0)
    second = drive.info["second_pitch"]
    assert second["largest_difference_rad"] < 1e-3 * second["peak_to_peak_rad"]
    assert (
        abs(drive.info["mirror"]["difference_rad"]) < 1e-3 * second["peak_to_peak_rad"]
    )
    check = drive.info["energy_check"]
    assert check["strain_energy_relative"] < 1e-3
    # few positions alias the corners of the ripple
    assert check["relative"] < 0.25
    assert drive.info["stiffness_range_Nm_rad"][0] > 0.0
    assert not drive.info["truncated"]
    mean = samples.input_torque.mean(axis=1)
    mean = mean[samples.solved]
    wanted = samples.torque[samples.solved] / drive.ratio
    assert mean == pytest.approx(wanted, rel=0.01, abs=1e-4)
    record = drive.info["validation"]
    assert not set(record["torques_Nm"]) & set(samples.torque)
    # so few angles alias the corners of the ripple, and the record says so
    assert 0.0 < record["output_error"]["rms"] < record["output_error"]["largest"]
    assert names(record["reason"], "angles", "error")


def test_mirrored_torques_count_from_the_same_rest():
    """Both signs keep their difference from rest, which is its own mirror image."""
    rng = np.random.default_rng(3)
    given = {0.0: rng.normal(size=(4, 6)), 2.0: rng.normal(size=(4, 6))}
    found = with_mirrored_torques(given)
    opposite = np.array([-1.0, 1.0, 1.0, -1.0])[:, None]
    at_minus_theta = -np.arange(6)
    for torque, values in found.items():
        image = opposite * values[:, at_minus_theta]
        assert found[-torque] == pytest.approx(image)
    # output error and energy: what the torque adds
    gain, wanted = found[2.0] - found[0.0], given[2.0] - given[0.0]
    assert gain[:2] == pytest.approx(wanted[:2])


@pytest.mark.fe
def test_energy_follows_from_torque(coarse_samples):
    """Strain energy of the samples against the integral of torque over torsion."""
    given = coarse_samples
    zero = int(np.flatnonzero(given.torque == 0.0)[0])
    torsion = given.output_error[zero] - given.output_error
    gained = given.energy - given.energy[zero]
    # trapezoidal steps with the tangent's correction: exact for cubic torque
    d, k = np.diff(torsion, axis=0), 1.0 / given.compliance
    mean = 0.5 * (given.torque[1:] + given.torque[:-1])[:, None]
    steps = mean * d + (k[:-1] - k[1:]) * d**2 / 12.0
    work = np.concatenate([np.zeros((1, COARSE_ANGLES)), np.cumsum(steps, axis=0)])
    work -= work[zero]
    assert np.abs(work - gained).max() < 0.02 * gained.max()


@pytest.mark.fe
def test_build_map_is_cached(tmp_path, monkeypatch):
    """A second call reads what the first one computed, bit for bit."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path))
    design = few_teeth()
    calls = []
    first = build_map(design, angles=2, progress=lambda *a: calls.append(a))
    count = len(calls)
    assert count > 0
    again = build_map(design, angles=2, progress=lambda *a: calls.append(a))
    assert len(calls) == count
    assert np.array_equal(first.potential, again.potential)


class Stop(Exception):
    """An interruption."""


def stopping(after: int):
    """A progress that interrupts the work after some calls."""
    calls = 0

    def progress(stage: str, done: int, total: int) -> None:
        nonlocal calls
        calls += 1
        if calls > after:
            raise Stop

    return progress


@pytest.mark.fe
@pytest.mark.parametrize("spoil", [False, True], ids=["sound", "damaged"])
def test_an_interrupted_map_goes_on_bit_for_bit(monkeypatch, tmp_path, spoil):
    """Every finished equilibrium is read, a damaged one alone solved again."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path))
    monkeypatch.setattr(sampling, "LEVELS", (0.35, 1.0))
    monkeypatch.setattr(unfinished, "SHARED", 0.0)
    design = few_teeth()
    whole = sampling.sample_map(design, angles=4)
    # two positions of three solves, and one of the third
    with pytest.raises(Stop):
        build_map(design, angles=4, progress=stopping(6))
    parts = sorted(tmp_path.rglob("*.npz"))
    assert [part.stem for part in parts] == [f"solve-{k:04d}" for k in range(7)]
    if spoil:
        parts[1].write_bytes(parts[1].read_bytes()[:-200])
    written = []
    write = UnfinishedSeries.write

    def noted(series, arrays):
        written.append(series.number)
        write(series, arrays)

    monkeypatch.setattr(UnfinishedSeries, "write", noted)
    drive = build_map(design, angles=4)
    assert written[:2] == ([1] if spoil else []) + [*range(7, 8 if spoil else 9)]
    assert list(tmp_path.rglob("*.npz")) == []
    wanted = fit_map(whole)
    # all but the time that it took, and the reasons that build_map adds
    other = {"sampling_wall_s": 0.0, "missing": {}}
    assert map_bytes(replace(drive, info=drive.info | other)) == map_bytes(
        replace(wanted, info=wanted.info | other)
    )


@pytest.mark.fe
def test_solves_of_a_second_share_a_file_and_all_are_kept(monkeypatch, tmp_path):
    """An interruption writes what is pending; a damaged file is solved anew."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path))
    monkeypatch.setattr(sampling, "LEVELS", (0.35, 1.0))
    monkeypatch.setattr(unfinished, "SHARED", 1e9)
    solved = []
    figures = ColumnGrid._recalled

    def counted(grid, theta, torque, solve):
        def noted():
            solved.append((theta, torque))
            return solve()

        return figures(grid, theta, torque, noted)

    monkeypatch.setattr(ColumnGrid, "_recalled", counted)
    for _ in range(2):
        with pytest.raises(Stop):
            build_map(few_teeth(), angles=4, progress=stopping(6))
        assert [part.stem for part in tmp_path.rglob("*.npz")] == ["solve-0000"]
        assert len(solved) == 7  # the second time, all are read
    (part,) = tmp_path.rglob("*.npz")
    part.write_bytes(part.read_bytes()[:-200])
    with pytest.raises(Stop):
        build_map(few_teeth(), angles=4, progress=stopping(6))
    assert solved == 2 * solved[:7]


def test_a_failed_solve_is_not_tried_again(monkeypatch, tmp_path, caplog):
    """An interrupted run keeps failures, too, each for its own angle and torque."""
    tried = []

    def grid():
        series = UnfinishedSeries(keep=Unfinished(folder=tmp_path), name="solve-{}")
        nothing = dict.fromkeys(("follow", "tick"))
        numbers = {"period": 1.0, "finest": 4, "levels": [], "small": 0.1}
        return ColumnGrid(**nothing, **numbers, keep=series)

    def failing():
        tried.append(True)
        return SimpleNamespace(outcome=Outcome.DIVERGED)

    monkeypatch.setattr(unfinished, "SHARED", 0.0)
    for _ in range(2):
        assert grid().solve_at(0.0, 1.0, failing) is None
    assert len(tried) == 1
    assert grid().solve_at(0.25, 1.0, failing) is None
    assert len(tried) == 2
    assert names(caplog.text, "another angle", "computed again")


@pytest.mark.fe
def test_a_map_is_kept_before_its_equilibria_are_removed(monkeypatch, tmp_path):
    """A kill between the last solve and the entry of the cache costs no equilibrium."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path))
    monkeypatch.setattr(sampling, "LEVELS", (0.35, 1.0))

    def stopped(*_: object) -> None:
        raise Stop

    with monkeypatch.context() as patch:
        patch.setattr(DriveMap, "save", stopped)
        with pytest.raises(Stop):
            build_map(few_teeth(), angles=2)
    monkeypatch.setattr(Unfinished, "write", stopped)
    build_map(few_teeth(), angles=2)


@pytest.mark.fe
def test_the_superposition_of_errors_is_counted_and_goes_on(monkeypatch, tmp_path):
    """Torques and linearisations of a position are steps; finished ones are kept."""
    monkeypatch.setitem(tolerance_sampling.LEVELS, "2d", (1.0,))
    monkeypatch.setitem(tolerance_sampling.CHECKS, "2d", 1)
    monkeypatch.setattr(tolerance_sampling, "CHUNK", 62)
    design = few_teeth(**{"tolerances.circular_spline_eccentricity_um": 5.0})
    options = {"repeated_peak": 20.0, "rated_torque": 10.0, "phases": 2}
    whole = sample_tolerances(design, **options)
    calls: list[tuple[str, int, int]] = []

    def until_the_second(stage: str, done: int, total: int) -> None:
        calls.append((stage, done, total))
        if "superposition" in stage and done == total // 2 + 1:
            raise Stop

    keep = Unfinished(folder=tmp_path)
    with pytest.raises(Stop):
        sample_tolerances(design, **options, progress=until_the_second, keep=keep)
    steps = [call[1:] for call in calls if "superposition" in call[0]]
    total = 2 * (2 * (len(whole.torque) // 2) + 1)
    total += 2 * 2  # linearisations under both signs of the torque
    assert steps == [(k, steps[0][1]) for k in range(len(steps))]
    assert steps[0][1] in (total, total - 4)  # a clearance adds its ends afterwards
    superposed = []
    table = tolerance_sampling.respond_over_torque

    def counted(rest, gap_changes, *others):
        superposed.append(len(gap_changes(rest.at)))
        return table(rest, gap_changes, *others)

    monkeypatch.setattr(tolerance_sampling, "respond_over_torque", counted)
    found = sample_tolerances(design, **options, keep=keep)
    # the drive without errors, twice; with them only what was not finished
    assert sorted(superposed) == [1, 1, 62]
    for key in ("torque", "table", "perfect"):
        assert np.array_equal(getattr(found, key), getattr(whole, key))
    # nor are the full solves that were finished
    monkeypatch.setattr(Continuation, "with_errors", None)
    again = sample_tolerances(design, **options, keep=keep)
    assert np.array_equal(again.solved.output_error, whole.solved.output_error)


def test_a_map_in_3d_says_at_once_that_it_takes_long(monkeypatch):
    """Before the first equilibrium, with the quicker fidelities."""
    said = []

    def stopped(*_: object, **__: object) -> None:
        raise ComputationError("stopped")

    monkeypatch.setattr(solving, "sample_map", stopped)
    with pytest.raises(ComputationError, match="stopped"):
        build_map(
            Design.load("size-25-100"),
            model="3d",
            progress=lambda *step: said.append(step),
            cache=False,
        )
    (first,) = said
    assert names(first[0], "size-25-100", "3D", "min", "2d", "ring")


@pytest.mark.parametrize(
    ("function", "design", "options", "parts"),
    [
        (build_map, "reference-2d", {}, ("reference-2d", "str", "Design.load")),
        (build_map, None, {"angles": 0}, ("angles", "0", ">= 1")),
        (simulate_meshing, "reference-2d", {}, ("reference-2d", "str", "Design.load")),
        (simulate_meshing, None, {"torque": np.nan}, ("torque", "nan N·m", "finite")),
        (simulate_meshing, None, {"steps": 0}, ("steps", "0", ">= 1")),
        (simulate_meshing, None, {"turn": np.nan}, ("turn", "nan turns", "finite")),
    ],
)
def test_arguments_without_a_result_are_refused(function, design, options, parts):
    """A name for a design, no positions, or a torque or turn that is not a number."""
    given = design or Design.load("reference-2d")
    with pytest.raises(InputError, match=naming(*parts)):
        function(given, **options)
