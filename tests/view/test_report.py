"""The report: one page that needs nothing else and says what its figures are worth."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise

import numpy as np
import pytest
from messages import names, naming
from validation_record import validated_map

from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.own_drives import scene_of_run
from swgjoint.sim.run import Run
from swgjoint.view.report.plots import envelope, joint_pngs
from swgjoint.view.report.report import write_report
from swgjoint.view.report.tables import Cell, Table
from swgjoint.view.run import run_scene
from swgjoint.view.validity import STEP_KEYS, step_error
from swgjoint.view.words import format_figure, words

SHORT = {"simulation.duration_s": 1.0, "trajectory.settle_s": 0.2}
PNG = b"\x89PNG"
VOID = {"meta", "link", "img", "br", "hr", "input"}


class Page(HTMLParser):
    """Texts, attributes and open tags of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.texts, self.attributes, self.tags, self.open = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):  # noqa: D102
        self.tags.append(tag)
        self.attributes += [(tag, key, value) for key, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):  # noqa: D102
        assert self.open.pop() == tag

    def handle_data(self, data):  # noqa: D102
        self.texts.append(data.strip())


@pytest.fixture
def run(synthetic_map: DriveMap) -> Run:
    return run_scene("bench", overrides=SHORT, drives={"reference-2d": synthetic_map})


WRITTEN: list[tuple[Run, str]] = []
"""The run and the text of the page that tests share: its pictures take seconds."""


@pytest.fixture
def written(synthetic_map: DriveMap, tmp_path) -> tuple[Run, str]:
    """Run ``a``, too fast for the tooth order, beside the rigid ``b``: a whole page."""
    if not WRITTEN:
        fast = {**SHORT, "trajectory.speed_deg_s.joint": 6.0}
        drives = {"reference-2d": synthetic_map}
        run = run_scene("bench", overrides=fast, drives=drives)
        rigid = run_scene(
            "bench", overrides={**fast, "defaults.level": "rigid"}, drives=drives
        )
        path = write_report({"a": run, "b": rigid}, tmp_path / "report.html")
        assert [p.name for p in tmp_path.iterdir()] == ["report.html"]
        WRITTEN.append((run, path.read_text(encoding="utf-8")))
    return WRITTEN[0]


@pytest.fixture
def without_pictures(monkeypatch):
    """The first bytes of a PNG in place of every picture."""
    report = "swgjoint.view.report."
    monkeypatch.setattr(report + "report.joint_pngs", lambda _, all: [PNG for _ in all])
    monkeypatch.setattr(report + "tables.spec_picture", lambda *_: PNG)


def test_the_page_needs_nothing_else(written):
    """No address, no script; every picture is inside and is a PNG."""
    _, text = written
    page = Page(text)
    assert page.open == []
    assert not re.search(r"\w+://|@import|url\(", text)
    assert not {"script", "link", "iframe", "object"} & set(page.tags)
    outside = [a for a in page.attributes if a[1] in ("src", "href", "srcset")]
    assert len(outside) >= 2
    for tag, key, value in outside:
        assert (tag, key) == ("img", "src")
        head, data = value.split(",", 1)
        assert head == "data:image/png;base64"
        assert base64.b64decode(data, validate=True).startswith(b"\x89PNG")
    assert ("meta", "http-equiv", "Content-Security-Policy") in page.attributes


@pytest.mark.usefixtures("without_pictures")
def test_names_from_files_are_text_not_markup(synthetic_map, tmp_path):
    """Markup in the names of drive, scene and run is shown, not obeyed."""
    evil = "<script>alert(1)</script>"
    drive = replace(synthetic_map, name=f"{evil}drive", info={"source": evil})
    run = run_scene(
        "bench",
        overrides={**SHORT, "name": f"{evil}scene", "description": f'"{evil}'},
        drives={"reference-2d": drive},
    )
    table = Table(header=[(evil, evil)], rows=[[Cell(evil, "bad")]], notes=[evil])
    path = write_report({f"{evil}run": run}, tmp_path / "report.html", summary=table)
    text = path.read_text(encoding="utf-8")
    page = Page(text)
    assert "script" not in page.tags
    assert "<script" not in text
    for name in ("drive", "run"):
        assert any(f"{evil}{name}" in item for item in page.texts)
    assert f"Scene {evil}scene" in page.texts


@pytest.mark.usefixtures("without_pictures")
def test_figures_are_those_of_the_metrics(run, tmp_path):
    """Ripple, torsion, error and the use of ratings stand there as in the JSON."""
    path = write_report({"": run}, tmp_path / "report.html", check_step=False)
    page = Page(path.read_text(encoding="utf-8"))
    figures = run.metrics()["joints"]["joint"]
    for value in (
        figures["ripple_rms_percent"],
        figures["torsion_arcmin"]["mean"],
        figures["transmission_error_arcmin"]["pp"],
        figures["ratings"]["peak_Nm"],
        run.assembly.transmissions[0].drive.spec_sheet(("K1_Nm_rad",))["K1_Nm_rad"],
    ):
        assert format_figure(value) in page.texts


def test_every_run_has_its_label_and_error_estimate(written):
    """Level, range of the map, orders left out, and the change at half the step."""
    run, text = written
    page = Page(text)
    assert page.texts.count("a") >= 2 and page.texts.count("b") >= 2
    assert "synthetic (synthetic)" in page.texts
    assert "122" in page.texts  # too fast at 6 deg/s, left out
    error = step_error(run)["joints"]["joint"]
    assert error["ripple_rms_percent"] > 0.0
    assert f"{error['ripple_rms_percent']:.1g}" in page.texts
    assert any("level rigid" in item for item in page.texts)


def test_halving_the_step_keeps_the_orders(synthetic_map):
    """An order that the step leaves out is not counted as an error of the step."""
    fast = {**SHORT, "trajectory.speed_deg_s.joint": 6.0}
    run = run_scene("bench", overrides=fast, drives={"reference-2d": synthetic_map})
    assert [u.order for u in run.assembly.transmissions[0].attached.unresolved] == [122]
    scene, drives = scene_of_run(run.assembly)
    fine = run_scene(scene.with_changes({"simulation.step_s": 0.0005}), drives=drives)
    kept = [r.assembly.transmissions[0].attached.kept_orders for r in (run, fine)]
    assert kept[0] == kept[1]
    assert fine.assembly.load == run.assembly.load


def test_the_finer_run_has_the_whole_window(synthetic_map):
    """It ends with the constant speed, and its figures are those of the whole run."""
    run = run_scene(
        "ur5e-sweep",
        overrides={"simulation.duration_s": 3.5},
        drives={"reference-2d": synthetic_map},
    )
    assert run.steady.stop < 0.7 * run.time.size
    scene, drives = scene_of_run(run.assembly)
    fine = run_scene(scene.with_changes({"simulation.step_s": 0.0005}), drives=drives)
    here, there = (one.metrics()["joints"]["elbow_joint"] for one in (run, fine))
    found = step_error(run)["joints"]["elbow_joint"]
    for key, (name, *parts) in STEP_KEYS.items():
        values = here[name], there[name]
        for part in parts:
            values = values[0][part], values[1][part]
        assert found[key] == abs(values[0] - values[1]) > 0.0


def test_the_error_estimate_falls_with_the_step(synthetic_map):
    """The change at half the step is smaller from a smaller step, for every figure."""
    changes = [
        step_error(
            run_scene(
                "bench",
                overrides={**SHORT, "simulation.step_s": step},
                drives={"reference-2d": synthetic_map},
            )
        )
        for step in (0.001, 0.0000625)
    ]
    assert [found["step_s"] for found in changes] == [0.0005, 0.00003125]
    coarse, fine = (found["joints"]["joint"] for found in changes)
    for key in STEP_KEYS:
        assert fine[key] < 0.5 * coarse[key] or coarse[key] < 1e-9


def test_a_step_that_cannot_be_halved_says_so(run, monkeypatch):
    """A finer run that is too long is not run, with the reason."""
    monkeypatch.setattr("swgjoint.view.validity.MAX_STEPS", 1500)
    found = step_error(run)
    assert "joints" not in found
    assert found["reason"] == "not run: it would take 2e+03 steps"


def test_the_report_is_written_whole_or_not_at_all(run, tmp_path, monkeypatch):
    """A failure on the way leaves nothing; a folder that is missing is refused."""
    with pytest.raises(InputError, match=naming("report.html", "No such file")):
        write_report({"": run}, tmp_path / "none" / "report.html", check_step=False)

    def fail(*_: object) -> None:
        raise RuntimeError("no picture")

    monkeypatch.setattr("swgjoint.view.report.report.joint_pngs", fail)
    with pytest.raises(RuntimeError, match="no picture"):
        write_report({"": run}, tmp_path / "report.html", check_step=False)
    assert list(tmp_path.iterdir()) == []


def test_the_picture_of_a_joint_does_not_depend_on_those_before(synthetic_map):
    """Neither its lines nor its axes; one joint rests and has no spectrum."""
    run = run_scene(
        "ur5e-sweep",
        overrides={"simulation.duration_s": 4.0, "trajectory.end_deg.wrist_3_joint": 0},
        drives={"reference-2d": synthetic_map},
    )
    joints = ["elbow_joint", "wrist_3_joint", "wrist_1_joint", "elbow_joint"]
    runs = {"a": run, "b": run}
    found = list(joint_pngs(runs, joints))
    assert found == [next(joint_pngs(runs, [joint])) for joint in joints]
    assert len(set(found)) == 3


def test_a_thinned_line_keeps_every_peak():
    """Both extremes of a long signal survive, a short one is left as it is."""
    x = np.linspace(0.0, 1.0, 50_000)
    y = np.sin(40.0 * x)
    y[31_234], y[7] = 3.0, -4.0
    thin_x, thin_y = envelope(x, y)
    assert thin_x.size <= 3_002 and (np.diff(thin_x) > 0).all()
    assert thin_y.max() == 3.0 and thin_y.min() == -4.0
    assert thin_x[thin_y.argmax()] == x[31_234]
    assert envelope(x[:100], y[:100])[1].size == 100
    # by pieces, one after the other
    edges = np.linspace(0, y.size, 1501).astype(int)
    pieces = [(low, y[low:high]) for low, high in pairwise(edges)]
    rows = {0, y.size - 1}
    rows |= {low + int(piece.argmin()) for low, piece in pieces}
    rows |= {low + int(piece.argmax()) for low, piece in pieces}
    assert thin_x.tolist() == x[sorted(rows)].tolist()


def test_figures_read_as_people_write_them():
    """Units come from the key; thousands are grouped; small ones keep their digits."""
    assert words("K1_Nm_rad") == ("K1", "N·m/rad")
    assert words("radial_stiffness_N_mm") == ("radial stiffness", "N/mm")
    assert [
        format_figure(v) for v in (None, True, 940884.8, 0.0, 3.14159, 2e-6, "x")
    ] == [
        "-",
        "yes",
        "940,900",
        "0",
        "3.142",
        "2.00e-06",
        "x",
    ]


@pytest.mark.usefixtures("without_pictures")
def test_figures_of_a_map_that_misses_unseen_solves_are_marked(synthetic_map, tmp_path):
    """Alert, ripple and orders with their sign, its meaning, error of the map."""
    drive = validated_map(synthetic_map, {20.0: (0.5, 0.2)})
    load = {"load.joint": {"torque_Nm": 20.0}}
    run = run_scene("bench", overrides=SHORT | load, drives={"reference-2d": drive})
    path = write_report({"": run}, tmp_path / "report.html", check_step=False)
    texts = Page(path.read_text(encoding="utf-8")).texts
    figures = run.metrics()["joints"]["joint"]
    assert f"! {format_figure(figures['ripple_rms_percent'])}" in texts
    assert f"~ {format_figure(figures['transmission_error_arcmin']['pp'])}" in texts
    assert any(names(text, "NOT VALID", "joint", "50 %", "20 N·m") for text in texts)
    assert any(names(text, "! not valid", "30 %") for text in texts)
    (error,) = [text for text in texts if text.startswith("validated")]
    assert names(error, "11 unseen", "50 %", "20 %")
