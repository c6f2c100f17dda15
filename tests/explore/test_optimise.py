"""The search for designs good in several figures: fronts with known answers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import naming

from swgjoint.errors import ComputationError, InputError
from swgjoint.explore.optimise import optimise as optimise_module
from swgjoint.explore.optimise.file import Limit, OptimisationFile
from swgjoint.explore.optimise.front import (
    Candidate,
    beats,
    front_of,
    not_worse,
    objectives_of,
    pick_spread,
)
from swgjoint.explore.optimise.optimise import optimise
from swgjoint.explore.optimise.search import search
from swgjoint.explore.sweep.figures import Record
from swgjoint.explore.sweep.results import place_of
from swgjoint.faults import validate
from swgjoint.gear.design.design import Design
from swgjoint.models_path import bundled_names
from swgjoint.pool import LocalPool
from swgjoint.toml_file import parse_toml
from swgjoint.view.plots.optimise import optimum_picture

pytest.importorskip("optuna", reason="needs swgjoint[tune]")

HEAD = """
design = "reference-2d"
[size]
figures = ["volume_cm3", "length_mm", "outer_diameter_mm"]
[[objectives]]
figure = "volume_cm3"
[[objectives]]
figure = "length_mm"
goal = "maximise"
"""
PLAN = """
[plan]
kind = "nsga2"
designs = {designs}
population = 20
seed = {seed}
[[plan.parameters]]
keys = ["circular_spline.rim_mm"]
low = 1.0
high = 5.0
[[plan.parameters]]
keys = ["drive.face_width_mm"]
low = 5.0
high = 25.0
"""


def read(text: str) -> OptimisationFile:
    return validate(OptimisationFile, parse_toml(text, where="x"), where="x")


def sizes(designs: int = 40, *, seed: int = 0, more: str = "") -> OptimisationFile:
    """Volume against length: best with the thinnest rim, whatever the length."""
    return read(HEAD + more + PLAN.format(designs=designs, seed=seed))


def with_figures(volume, length, *, outcome: str = "ok") -> Candidate:
    figures = {"volume_cm3": volume, "length_mm": length}
    return Candidate(
        values={}, design=None, record=Record(outcome=outcome, figures=figures)
    )


def test_the_front_of_a_known_problem_is_found():
    """Two paraboloids (Schaffer): the front is the line between their feet."""
    asked = []

    def evaluate(generation):
        asked.extend(generation)
        found = []
        for values in generation:
            x = (values["circular_spline.rim_mm"] - 1.0) / 4.0  # 0 to 1
            y = (values["drive.face_width_mm"] - 5.0) / 20.0
            near, far = (x - 0.2) ** 2 + y**2, (x - 0.8) ** 2 + y**2
            found.append(with_figures(near, -far))
        return found

    file = sizes(600)
    start = Design.load("reference-2d")
    tried = [c for part in search(file, start, evaluate) for c in part]
    assert len(asked) == len(tried) == 600
    # the start itself is the first that is tried
    assert asked[0] == {"circular_spline.rim_mm": 2.0, "drive.face_width_mm": 10.0}
    front = [tried[k].record.figures for k in front_of(file, tried)]
    assert len(front) > 20
    # on the line sqrt(near) + sqrt(far) is the distance of the feet, elsewhere more
    lengths = [np.sqrt(f["volume_cm3"]) + np.sqrt(-f["length_mm"]) for f in front]
    assert min(lengths) >= 0.6 - 1e-12
    assert np.median(lengths) < 0.603
    # and it is reached from one foot to the other
    volumes = [f["volume_cm3"] for f in front]
    assert min(volumes) < 0.02**2 and max(volumes) > 0.55**2


def test_the_last_generations_are_better_than_the_first():
    """What a blind draw of as many designs does not do."""

    def evaluate(generation):
        return [
            with_figures(
                sum(
                    (v - m) ** 2 for v, m in zip(values.values(), (3, 15), strict=True)
                ),
                1.0,
            )
            for values in generation
        ]

    file = sizes(200)
    parts = list(search(file, Design.load("reference-2d"), evaluate))
    means = [np.mean([c.record.figures["volume_cm3"] for c in part]) for part in parts]
    assert len(parts) == 10
    assert means[-1] < 0.05 * means[0]


def test_limits_and_failures_keep_the_search_out():
    """Designs without figures or beyond a limit are left; the best is at the limit."""

    def evaluate(generation):
        found = []
        for values in generation:
            rim = values["circular_spline.rim_mm"]
            if values["drive.face_width_mm"] < 10.0:
                found.append(
                    Candidate(values={}, design=None, record=Record(outcome="failed"))
                )
            else:
                found.append(with_figures(rim, 1.0 / rim))
        return found

    file = sizes(400, more='[[limits]]\nfigure = "volume_cm3"\nleast = 2.5\n')
    parts = list(search(file, Design.load("reference-2d"), evaluate))
    tried = [c for part in parts for c in part]
    best = tried[front_of(file, tried)[0]].record.figures["volume_cm3"]
    assert 2.5 <= best < 2.52
    assert sum(not c.record.ok for c in parts[0]) > 0
    assert sum(not c.record.ok for c in parts[-1]) <= 2


def test_no_design_of_the_front_is_beaten_and_every_other_is():
    """The definition, by brute force, with equal and missing values among them."""
    drawn = np.random.default_rng(3).integers(0, 6, (60, 2))
    tried = [with_figures(float(a), float(b)) for a, b in drawn]
    tried += [with_figures(0.0, 9.0, outcome="failed"), with_figures(None, 9.0)]
    file = sizes(more='[[limits]]\nfigure = "length_mm"\nmost = 4.0\n')
    front = front_of(file, tried)
    values = [(float(a), -float(b)) for a, b in drawn]
    within = [k for k in range(60) if values[k][1] >= -4.0]

    def beats(a, b):
        return a != b and all(x <= y for x, y in zip(a, b, strict=True))

    assert all(k in within for k in front)
    for k in within:
        beaten = any(beats(values[n], values[k]) for n in within)
        assert beaten != any(values[n] == values[k] for n in front)
    told = [values[k] for k in front]
    assert told == sorted(set(told))


def test_spread_takes_the_ends_first_and_then_the_gaps():
    """Best of every column; then the design farthest from both."""
    values = np.array([[0.0, 10.0], [0.1, 9.0], [0.5, 5.0], [0.9, 0.5], [1.0, 0.0]])
    assert pick_spread(values, 2) == [0, 4]
    assert pick_spread(values, 3) == [0, 4, 2]
    assert sorted(pick_spread(values, 9)) == [0, 1, 2, 3, 4]
    assert pick_spread(np.array([[1.0], [0.5]]), 1) == [1]


def test_sizes_by_hand():
    """Outside of the circular spline of thesis Table 4.1, and of what is found.

    122 teeth of 1 mm, 0.8 mm dedendum and 2 mm rim on either side: 127.6 mm.
    """
    found = optimise(sizes(60), executor=LocalPool(1))
    figures = found.start.record.figures
    assert figures["outer_diameter_mm"] == pytest.approx(127.6)
    assert figures["length_mm"] == 10.0
    assert figures["volume_cm3"] == pytest.approx(np.pi / 4 * 12.76**2 * 1.0)
    for candidate in found.front:
        made, told = candidate.design, candidate.record.figures
        assert told["length_mm"] == made.drive.face_width_mm
        diameter = 123.6 + 2.0 * made.circular_spline.rim_mm
        assert told["outer_diameter_mm"] == pytest.approx(diameter)
        assert made.circular_spline.rim_mm == candidate.values["circular_spline.rim_mm"]


def test_equal_whatever_computes_it_and_gone_on_with(tmp_path, monkeypatch):
    """One process, two processes, and a search that was stopped and begun again."""
    file, place = sizes(60, seed=5), place_of(tmp_path)
    one = optimise(file, executor=LocalPool(1))
    two = optimise(file, executor=LocalPool(2))
    rows = one.to_json()["rows"]
    assert two.to_json()["rows"] == rows
    assert optimise(sizes(60, seed=6), executor=LocalPool(1)).to_json()["rows"] != rows

    class Stop(Exception):
        pass

    def progress(stage, done, total):
        if stage == "search" and done >= 30:
            raise Stop

    with pytest.raises(Stop):
        optimise(file, executor=LocalPool(1), place=place, progress=progress)
    kept = len(list(tmp_path.rglob("*.json")))
    assert 30 <= kept < 60
    again = optimise(file, executor=LocalPool(1), place=place)
    assert again.to_json()["rows"] == rows
    different = {tuple(c.values.items()) for c in one.tried}
    assert sum(s.computed for s in again.sweeps) == len(different) - kept
    told = []
    optimise(
        file,
        executor=LocalPool(1),
        place=place,
        progress=lambda stage, done, total: told.append((stage, done, total)),
    )
    assert told[-1] == ("search", 60, 60)


def test_the_front_is_confirmed_with_more_care(monkeypatch):
    """Finer mesh and more positions for some of the front and for the rivals."""
    asked = []

    def run_sweep(file, **kwargs):
        asked.append(file)
        return real(file, **kwargs)

    real = optimise_module.run_sweep
    monkeypatch.setattr(optimise_module, "run_sweep", run_sweep)
    file = sizes(20, more="[confirm]\ndesigns = 3\nrefinement = 1.5\n")
    file = file.model_copy(update={"beside": ("reference-2d-dca",)})
    found = optimise(file, executor=LocalPool(1))
    assert [c.values["design"] for c in found.beside] == ["reference-2d-dca"]
    rivals = (found.start, *found.beside)
    assert all(c.confirmed.figures == c.record.figures for c in rivals)
    confirmed = [c for c in found.front if c.confirmed is not None]
    assert len(confirmed) == 3
    assert found.front[0] in confirmed and found.front[-1] in confirmed
    first, *searched, front, others = asked
    for sweep, count in ((front, 3), (others, 2)):
        parts = {p.column: p.values for p in sweep.plan.parameters}
        assert parts["mesh.refinement"] == (1.5,) * count
    assert all(
        "mesh.refinement" not in p.keys
        for s in [first, *searched]
        for p in s.plan.parameters
    )
    assert optimum_picture(found).startswith(b"\x89PNG")


def test_designs_beyond_a_limit_say_so():
    """The start and every design that was tried, also without a confirmation."""
    limit = '[[limits]]\nfigure = "volume_cm3"\nmost = 120.0\n'
    result = optimise(sizes(20, more=limit), executor=LocalPool(1)).to_json()
    assert result["start"]["volume_cm3"] > 120.0
    rows = [result["start"], *result["rows"], *result["front"]]
    assert {bool(row["missed"]) for row in rows} == {True, False}
    for row in rows:
        assert row["missed"] == ["volume_cm3"] * (row["volume_cm3"] > 120.0)


def test_care_changes_the_tasks_it_is_for():
    """Positions of the meshing, model of meshing and map; the figures stay."""
    text = """
design = "stress-cup"
[meshing]
figures = ["von_mises_MPa"]
model = "2d"
[spec]
figures = ["K1_Nm_rad"]
model = "ring"
[[objectives]]
figure = "von_mises_MPa"
[confirm]
positions = 35
model = "3d"
"""
    file = read(text + PLAN.format(designs=4, seed=0))
    columns = {"drive.face_width_mm": [9.0, 10.0]}
    quick, careful = (file.sweep(columns, confirm=c) for c in (False, True))
    assert (quick.meshing.model, quick.meshing.positions) == ("2d", 6)
    assert (careful.meshing.model, careful.meshing.positions) == ("3d", 35)
    assert (quick.spec.model, careful.spec.model) == ("ring", "3d")
    assert careful.meshing.figures == quick.meshing.figures


def test_confirmed_figures_decide_where_both_have_them():
    """A design that only looked better in the search is not called so."""
    file = sizes()

    def one(quick, careful):
        records = [
            None
            if pair is None
            else Record(
                outcome="ok",
                figures=dict(zip(("volume_cm3", "length_mm"), pair, strict=True)),
            )
            for pair in (quick, careful)
        ]
        return Candidate(
            values={}, design=None, record=records[0], confirmed=records[1]
        )

    rival = one((2.0, 5.0), (2.0, 5.0))
    assert not_worse(file, one((1.0, 5.0), None), rival)
    assert not_worse(file, one((1.0, 5.0), (2.0, 5.0)), rival)
    assert not not_worse(file, one((1.0, 5.0), (2.1, 5.0)), rival)
    assert not not_worse(file, one((1.0, 4.9), None), rival)


def test_a_front_that_the_confirmation_refutes_says_so():
    """A design that another one beats with confirmed figures is called beaten."""
    file = sizes(20, more="[confirm]\ndesigns = 2\n")
    found = optimise(file, executor=LocalPool(1))
    first, last = (replace(found.front[k]) for k in (0, -1))
    assert not any(row["beaten_by"] for row in found.to_json()["front"])
    worse = {**last.confirmed.figures, "length_mm": first.record.figures["length_mm"]}
    record = replace(last.confirmed, figures=worse)  # heavier, and no longer
    front = (*found.front[:-1], replace(last, confirmed=record))
    rows = replace(found, front=front).to_json()["front"]
    assert [row["beaten_by"] for row in rows[:-1]] == [[]] * (len(rows) - 1)
    assert rows[-1]["beaten_by"] == ["reference-2d", "front 1"]
    # nothing beyond a limit beats a design
    most = first.confirmed.figures["volume_cm3"] - 1.0
    strict = file.model_copy(
        update={"limits": (Limit(figure="volume_cm3", most=most),)}
    )
    assert not beats(strict, front[0], front[-1]) and beats(file, front[0], front[-1])


def test_files_that_it_names_lie_relative_to_it(tmp_path, monkeypatch):
    """The start and the designs beside; one that is not there ends it at once."""
    monkeypatch.chdir(tmp_path)
    there = tmp_path / "there"
    there.mkdir()
    for name, rim in (("one", 2.0), ("two", 2.5)):
        made = Design.load("reference-2d").with_changes({"circular_spline.rim_mm": rim})
        (there / f"{name}.toml").write_text(made.to_toml())
    text = HEAD.replace("reference-2d", "one.toml") + PLAN.format(designs=4, seed=0)
    (there / "search.toml").write_text('beside = ["two.toml"]\n' + text)
    file = OptimisationFile.load("there/search.toml")
    found = optimise(file, executor=LocalPool(1))
    rivals = [c.design.circular_spline.rim_mm for c in (found.start, *found.beside)]
    assert rivals == [2.0, 2.5]
    gone = file.model_copy(update={"beside": ("three.toml",)})
    with pytest.raises(
        InputError, match=naming("'three.toml'", "models/drives", "reference-2d")
    ):
        optimise(gone, executor=LocalPool(1))


def test_a_lost_design_ends_the_search_with_what_is_kept(tmp_path, monkeypatch):
    """Told as one without figures it would lead elsewhere than another run."""
    file, place, real = sizes(40), place_of(tmp_path), optimise_module.run_sweep

    def run_sweep(file, **kwargs):
        found = real(file, **kwargs)
        if len(found.records) < 3:
            return found
        records = (Record(outcome="lost", reason="no memory"), *found.records[1:])
        return replace(found, records=records)

    with monkeypatch.context() as patched:
        patched.setattr(optimise_module, "run_sweep", run_sweep)
        with pytest.raises(ComputationError, match=naming("1", "lost", "no memory")):
            optimise(file, executor=LocalPool(1), place=place)
    again = optimise(file, executor=LocalPool(1), place=place)
    fresh = optimise(file, executor=LocalPool(1))
    assert again.to_json()["rows"] == fresh.to_json()["rows"]


def test_a_design_that_fails_with_care_is_not_called_as_good():
    """Whatever the search had seen of it."""
    rival = with_figures(2.0, 5.0)
    good = with_figures(1.0, 5.0)
    assert not_worse(sizes(), good, rival)
    failed = replace(good, confirmed=Record(outcome="failed"))
    assert not not_worse(sizes(), failed, rival)


def test_long_paths_and_names_are_no_hindrance(tmp_path):
    """Of the file of the start, and of the start itself."""
    folder = tmp_path / ("a" * 120) / ("b" * 120)
    folder.mkdir(parents=True)
    made = Design.load("reference-2d").with_changes({"drive.name": "n" * 100})
    (folder / "one.toml").write_text(made.to_toml())
    text = HEAD.replace("reference-2d", "one.toml") + PLAN.format(designs=4, seed=0)
    (folder / "search.toml").write_text(text)
    found = optimise(
        OptimisationFile.load(folder / "search.toml"), executor=LocalPool(1)
    )
    assert all(d.drive.name.startswith("nnn") for d in found.designs("search"))


def test_a_search_that_finds_nothing_is_one_line():
    """Limits that no design keeps; a start that has no figures."""
    file = sizes(20, more='[[limits]]\nfigure = "volume_cm3"\nmost = 1.0\n')
    with pytest.raises(
        ComputationError, match=naming("20 designs", "limits", "beyond a limit")
    ):
        optimise(file, executor=LocalPool(1))


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            'figure = "length_mm"',
            'figure = "mass_kg"',
            (
                "objectives[1].figure",
                "'mass_kg'",
                "volume_cm3",
                "length_mm",
                "outer_diameter_mm",
            ),
        ),
        (
            'figure = "length_mm"',
            'figure = "volume_cm3"',
            ("objectives[1].figure", "'volume_cm3'"),
        ),
        ('design = "reference-2d"\n', "", ("x: design", "size", "scene")),
        (
            "rim_mm",
            "rim",
            (
                "plan.parameters[0].keys[0]",
                "'circular_spline.rim'",
                "circular_spline.rim_mm",
            ),
        ),
        (
            'keys = ["circular_spline.rim_mm"]',
            'keys = ["design"]',
            ("plan.parameters", "'design'", "sweep"),
        ),
        ('goal = "maximise"', "least = 3", ("objectives[1].least", "figure", "goal")),
        (
            "high = 5.0",
            "high = 5.0\ncount = 3",
            ("plan.parameters[0].count", "plan.designs"),
        ),
        ('kind = "nsga2"', 'kind = "grid"', ("plan.kind", "'grid'", "'nsga2'")),
        (
            "[plan]",
            "[confirm]\npositions = 3\n[plan]",
            ("confirm.positions", "meshing"),
        ),
        (
            "[plan]",
            '[meshing]\nfigures = ["transmission_error_pp_arcsec"]\n'
            "[confirm]\npositions = 1\n[plan]",
            ("confirm.positions", "transmission_error_pp_arcsec", "2"),
        ),
        (
            "[plan]",
            '[confirm]\nmodel = "2d"\n[plan]',
            ("confirm.model", "meshing", "maps"),
        ),
        (
            "[plan]",
            '[[limits]]\nfigure = "length_mm"\n[plan]',
            ("limits[0].most", "least", "both"),
        ),
        (
            "[plan]",
            '[[limits]]\nfigure = "length_mm"\nleast = 3.0\nmost = 2.0\n[plan]',
            ("limits[0].most", "2 mm", "3 mm"),
        ),
    ],
)
def test_a_file_that_cannot_be_used_is_one_line_a_fault(old, new, told):
    """What, where, and what would be accepted."""
    text = HEAD + PLAN.format(designs=4, seed=0)
    assert old in text
    with pytest.raises(InputError, match=naming(*told)):
        read(text.replace(old, new))


def test_care_and_search_do_not_both_choose_the_mesh():
    """Or the confirmation would fail after the whole search."""
    text = HEAD + "[confirm]\nrefinement = 2.0\n" + PLAN.format(designs=4, seed=0)
    keys = '"drive.face_width_mm"'
    with pytest.raises(
        InputError, match=naming("confirm.refinement", "mesh.refinement", "one")
    ):
        read(text.replace(keys, f'{keys}, "mesh.refinement"'))


def test_a_start_outside_the_ranges_is_no_hindrance():
    """It is computed and told, and the search draws as it does without it."""
    text = HEAD + PLAN.format(designs=20, seed=0)
    found = optimise(
        read(text.replace("low = 1.0", "low = 2.5")), executor=LocalPool(1)
    )
    assert found.start.record.ok
    assert min(c.values["circular_spline.rim_mm"] for c in found.tried) >= 2.5


def test_lists_and_whole_numbers_are_drawn_as_they_are():
    """Of tables and texts as of numbers."""
    text = HEAD + PLAN.format(designs=40, seed=0)
    text += """
[[plan.parameters]]
keys = ["wave_generator"]
values = [{kind = "elliptical", minor_axis_coefficient = 1.0}, {kind = "cosine"}]
[[plan.parameters]]
keys = ["tolerances.seed"]
low = 1
high = 3
"""
    asked = []

    def evaluate(generation):
        asked.extend(generation)
        return [with_figures(1.0, 1.0) for _ in generation]

    list(search(read(text), Design.load("reference-2d"), evaluate))
    assert {v["wave_generator"]["kind"] for v in asked} == {"elliptical", "cosine"}
    assert {v["tolerances.seed"] for v in asked} == {1, 2, 3}


@pytest.mark.parametrize("name", bundled_names("optimisations", ".toml"))
def test_bundled_searches_begin_with_a_design_in_their_ranges(name):
    """The first design tried is the one to start from, and the rivals are not it."""
    file = OptimisationFile.load(name)
    start = Design.load(file.design)
    generation = next(iter(search(file, start, lambda g: [_kept(file, v) for v in g])))
    first = file.sweep({k: [v] for k, v in generation[0].values.items()}, confirm=False)
    assert (
        start.with_changes(
            {key: p.values[0] for p in first.plan.parameters for key in p.keys}
        )
        == start
    )
    for rival in file.beside:
        assert Design.load(rival).content_hash() != start.content_hash()


def _kept(file, values) -> Candidate:
    figures = {name: 1.0 for name in file.figures}
    return Candidate(
        values=values, design=None, record=Record(outcome="ok", figures=figures)
    )


def test_objectives_are_what_is_to_be_small():
    """A figure to be large counts with the other sign."""
    values = objectives_of(sizes(), [with_figures(2.0, 3.0)])
    np.testing.assert_array_equal(values, [[2.0, -3.0]])
