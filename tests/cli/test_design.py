"""``swgjoint design``: checks, picture, outlines; refusals with status 2."""

from __future__ import annotations

import json

import numpy as np
import pytest
from messages import names

from swgjoint.cli.main import main
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.gear.wave_generators.wave_generator import wave_generator
from swgjoint.models_path import bundled_names

LAYERS = ("flexspline", "circular_spline", "wave_generator")


def outcome(capsys, *arguments):
    """Status, JSON object of stdout, lines of stderr."""
    status = main(["design", *arguments, "--json"])
    out, err = capsys.readouterr()
    return status, json.loads(out) if out else None, err.splitlines()


def infeasible(tmp_path, changes):
    """A design file that loads and cannot be built."""
    design = Design.load("reference-2d").with_changes(changes)
    path = tmp_path / "bad.toml"
    path.write_text(design.to_toml())
    return str(path)


ROLLERS = {"kind": "four_roller", "aperture_deg": 10.0, "roller_radius_mm": 10.0}


def test_check_lists_figures_against_limits(capsys):
    """Keys of the contract; every figure of a feasible design is within its limit."""
    status, result, lines = outcome(capsys, "check", "reference-2d-parabolic")
    assert status == 0
    assert lines == []
    assert result["feasible"] is True
    assert result["design"] == "reference-2d-parabolic"
    for check in result["checks"]:
        assert set(check) == {"name", "ok", "value", "unit", "limit", "numerical"}
        assert check["ok"] is True
        name, value, limit = (check[key] for key in ("name", "value", "limit"))
        if name.endswith("at most"):
            assert value <= limit
        elif name.endswith("at least"):
            assert value >= limit
        else:
            assert name.endswith("above")
            assert value > limit


@pytest.mark.parametrize(
    "chosen",
    [
        ["reference-2d", "reference-2d-four-roller", "size-25-100"],
        pytest.param(bundled_names("drives", ".toml"), marks=pytest.mark.slow),
    ],
    ids=["some", "all"],
)
def test_all_presets_in_one_call(capsys, chosen):
    """Several designs at once: all bundled ones are feasible."""
    names = chosen
    status, result, lines = outcome(capsys, "check", *names)
    assert status == 0
    assert lines == []
    assert result["feasible"] is True
    assert [one["design"] for one in result["designs"]] == names
    assert all(one["feasible"] for one in result["designs"])
    assert {check["design"] for check in result["checks"]} == set(names)


def test_check_finds_what_show_draws(capsys):
    """Clearance of the rigid flanks, the number that goes with the picture."""
    from swgjoint.gear.teeth.tooth_path import tooth_path

    least = tooth_path(Design.preset("size-25-100")).smallest_clearance * 1e6
    assert least < 0.0
    _, found, _ = outcome(capsys, "check", "size-25-100")
    assert found["tooth_path"]["interference_um"] == pytest.approx(-least)
    (row,) = [check for check in found["checks"] if "rigid flanks" in check["name"]]
    assert (row["value"], row["unit"]) == (pytest.approx(least), "µm")
    assert main(["design", "check", "size-25-100"]) == 0
    assert names(capsys.readouterr().out, "overlap", f"{-least:.3g} µm")


def test_round_off_is_shown_where_it_fails(tmp_path, capsys, monkeypatch):
    """Gaps of 1e-15 mm are no lines of the table, unless they are too large."""
    from swgjoint.gear.design import feasibility

    def lines():
        main(["design", "check", "reference-2d-four-roller"])
        return capsys.readouterr().out.splitlines()

    before = lines()
    assert not any("gap between segments" in line for line in before)
    monkeypatch.setattr(feasibility, "CLOSED", 0.0)
    after = [line for line in lines() if "gap between segments" in line]
    assert after and all(line.endswith("BAD") for line in after)


def test_defaults_that_are_taken_are_told(tmp_path, capsys):
    """A file without [material]: steel, with its numbers, in check and in show."""
    text = Design.load("reference-2d-four-roller").to_toml()
    head, _, rest = text.partition("[material]")
    path = tmp_path / "bare.toml"
    path.write_text(head + "[flexspline]" + rest.split("[flexspline]", 1)[1])
    for arguments in (["check"], ["show", "--out", str(tmp_path / "out")]):
        assert main(["design", arguments[0], str(path), *arguments[1:]]) == 0
        out = capsys.readouterr().out
        assert names(out, "steel", "material.youngs_modulus_GPa = 210.0")


def test_new_writes_a_feasible_design(tmp_path, capsys):
    """The file has teeth, module and name as asked, and can be built as it is."""
    path = tmp_path / "my.toml"
    asked = ["--teeth", "160/162", "--module", "0.4", "--set", "flexspline.rim_mm=0.6"]
    status, result, lines = outcome(
        capsys, "new", "reference-2d", *asked, "-o", str(path)
    )
    assert status == 0 and lines == [] and result["files"] == [str(path)]
    assert result["design"] == "my" and result["feasible"] is True
    drive = Design.load(path).drive
    assert (drive.teeth_flexspline, drive.teeth_circular_spline) == (160, 162)
    assert drive.module_mm == 0.4 and Design.load(path).flexspline.rim_mm == 0.6
    status, result, lines = outcome(capsys, "check", str(path))
    assert status == 0 and lines == [] and result["defaults"] == {}


def test_new_keeps_its_template(tmp_path, capsys, monkeypatch):
    """A design is not scaled in place, which would lose its comments and old values."""
    text = "# mine\n" + Design.preset("reference-2d").to_toml()
    (tmp_path / "a.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    scaled = ("new", str(tmp_path / "a.toml"), "--module", "2", "-o", "a.toml")
    assert main(["design", *scaled]) == 2
    assert names(capsys.readouterr().err, "'a.toml'", "another file")
    assert (tmp_path / "a.toml").read_text() == text


def test_infeasible_design_is_status_2_with_one_line_per_fault(tmp_path, capsys):
    """Two faults, two lines with key, value and what is accepted."""
    changes = {"wave_generator": ROLLERS, "circular_spline.dedendum_coefficient": 0.55}
    path = infeasible(tmp_path, changes)
    status, result, lines = outcome(capsys, "check", path)
    assert status == 2
    assert result["feasible"] is False
    bad = [check["name"] for check in result["checks"] if not check["ok"]]
    assert len(bad) == len(lines) == 2
    assert all(line.startswith("swgjoint design: reference-2d: ") for line in lines)
    assert all("accepted" in line for line in lines)
    roller = ("wave_generator.roller_radius_mm", "10 mm", "8.759 mm", "aperture_deg")
    assert any(names(line, *roller) for line in lines)
    tip = ("flexspline.addendum_coefficient", "0.6", "0.55", "dedendum_coefficient")
    assert any(names(line, *tip) for line in lines)


def test_good_and_bad_designs_together(tmp_path, capsys):
    """One bad design makes the call fail; the others are reported all the same."""
    path = infeasible(tmp_path, {"wave_generator": ROLLERS})
    status, result, lines = outcome(
        capsys, "check", "reference-2d", path, "no-such-design"
    )
    assert status == 2
    assert result["feasible"] is False
    assert [one["feasible"] for one in result["designs"]] == [True, False, False]
    assert len(lines) == 2


@pytest.mark.parametrize("action", ["show", "export"])
def test_infeasible_designs_write_nothing(action, tmp_path, capsys):
    """No picture and no outline of what cannot be built; the folder is not made."""
    path, folder = infeasible(tmp_path, {"wave_generator": ROLLERS}), tmp_path / "out"
    status, result, lines = outcome(capsys, action, path, "--out", str(folder))
    assert status == 2
    assert result is None
    assert len(lines) == 1
    assert names(lines[0], "wave_generator.roller_radius_mm", "10 mm", "8.759 mm")
    assert not folder.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("show", "reference-2d"), ("design show", "--out DIR")),
        (("export", "reference-2d"), ("design export", "--out DIR")),
        (
            ("show", "reference-2d", "reference-3d", "--out", "x"),
            ("design show", "one DESIGN", "2"),
        ),
        (("check", "reference-2d", "--out", "x"), ("design check", "--out")),
        (
            ("check", "reference-2d", "--module", "1"),
            ("design check", "--module", "new"),
        ),
        (("new", "reference-2d"), ("design new", "-o FILE.toml")),
        (("new", "reference-2d", "-o", "x.csv"), ("'x.csv'", ".toml")),
        (
            ("new", "reference-2d", "-o", "x.toml", "--teeth", "160"),
            ("--teeth", "'160'", "160/162"),
        ),
        (
            ("new", "reference-2d", "-o", "x.toml", "--module", "-1"),
            ("module_mm", "-1 mm", "> 0 mm"),
        ),
        (
            ("check", "no-such-design"),
            ("'no-such-design'", "models/drives", "reference-2d"),
        ),
    ],
)
def test_bad_calls(arguments, message, tmp_path, capsys, monkeypatch):
    """One line, status 2, nothing written."""
    monkeypatch.chdir(tmp_path)
    status, _, lines = outcome(capsys, *arguments)
    assert status == 2
    assert len(lines) == 1
    assert names(lines[0], *message)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "name", ["reference-2d", "reference-2d-four-roller", "reference-2d-dca"]
)
def test_show_writes_a_picture(name, tmp_path, capsys):
    """A PNG of the size of a page with more than one colour in it."""
    from matplotlib.image import imread

    status, result, _ = outcome(capsys, "show", name, "--out", str(tmp_path / "new"))
    assert status == 0
    names = ["design.png"] + ["tooth-path.png"] * (name != "reference-2d-four-roller")
    assert result["files"] == [str(tmp_path / "new" / each) for each in names]
    image = imread(result["files"][0])
    assert min(image.shape[:2]) > 600
    # steel of both members and of the wave generator: red, blue, green areas
    red, green, blue = (image[..., k] for k in range(3))
    assert np.count_nonzero((red > green + 0.1) & (red > blue + 0.1)) > 5000
    assert np.count_nonzero(blue > red + 0.1) > 5000
    assert np.count_nonzero((green > red + 0.05) & (green > blue + 0.05)) > 5000


def test_show_tells_the_passage_of_a_rigid_tooth(tmp_path, capsys):
    """Numbers of the tooth path as the function gives them, or why there are none."""
    from swgjoint.gear.design.design import Design
    from swgjoint.gear.teeth.tooth_path import tooth_path

    _, result, _ = outcome(capsys, "show", "reference-2d", "--out", str(tmp_path))
    path = tooth_path(Design.load("reference-2d"))
    found = result["tooth_path"]
    assert found["smallest_clearance_um"] == pytest.approx(
        path.smallest_clearance * 1e6
    )
    assert found["interference_um"] == pytest.approx(path.interference * 1e6)
    assert found["where"] == path.where[path.worst]
    _, result, _ = outcome(
        capsys, "show", "reference-2d-four-roller", "--out", str(tmp_path)
    )
    assert "four_roller" in result["tooth_path"]["missing"]


# -- export: read back with a reader of our own ----------------------------------------


def read_dxf(text):
    """Polylines by layer: list of (points in mm, closed)."""
    lines = text.splitlines()
    pairs = list(zip(lines[::2], lines[1::2], strict=True))
    assert pairs[0] == ("0", "SECTION")
    assert pairs[-1] == ("0", "EOF")
    assert ("1", "AC1009") in pairs
    found, current, vertex = {}, None, None
    for code, value in pairs:
        if code == "0":
            vertex = None
            if value == "POLYLINE":
                current = {"points": [], "closed": False, "layer": None}
            elif value == "VERTEX":
                vertex = [None, None]
                current["points"].append(vertex)
            elif value == "SEQEND":
                layer = found.setdefault(current["layer"].lower(), [])
                layer.append((np.array(current["points"], float), current["closed"]))
                current = None
        elif current is not None:
            if code == "8":
                current["layer"] = value
            elif code in ("10", "20") and vertex is not None:
                vertex[int(code) // 10 - 1] = float(value)
            elif code == "70" and vertex is None:
                current["closed"] = value == "1"
    return found


def read_csv(text):
    """Points in mm by curve."""
    head, *rows = text.splitlines()
    assert head == "curve,x_mm,y_mm"
    data = np.array([[float(x) for x in row.split(",")] for row in rows])
    return [data[data[:, 0] == k, 1:] for k in np.unique(data[:, 0])]


@pytest.fixture(params=["reference-2d-parabolic", "reference-2d-four-roller"])
def exported(request, tmp_path, capsys):
    folder = tmp_path / "out"
    status, result, _ = outcome(capsys, "export", request.param, "--out", str(folder))
    assert status == 0
    assert sorted(result["files"]) == sorted(str(p) for p in folder.iterdir())
    texts = {path.name: path.read_text() for path in folder.iterdir()}
    return Design.load(request.param), result, texts


def test_outlines_read_back(exported):
    """DXF and CSV hold the same curves, on the geometry to 1e-9 m."""
    design, result, texts = exported
    drawing = read_dxf(texts["outlines.dxf"])
    assert set(drawing) == set(LAYERS)
    for layer in LAYERS:
        curves = read_csv(texts[f"{layer}.csv"])
        assert len(curves) == len(drawing[layer])
        assert result["points"][layer] == sum(map(len, curves))
        for points, (drawn, closed) in zip(curves, drawing[layer], strict=True):
            assert points == pytest.approx(drawn, abs=0)
            assert closed == (layer == "wave_generator")
    outline = wave_generator(design)
    for points, _ in drawing["wave_generator"]:
        gap, _, _ = outline.signed_distance(points * 1e-3)
        assert np.abs(gap).max() < 1e-9
    for member in LAYERS[:2]:
        ((points, _),) = drawing[member]
        profile = tooth_profile(design, member)
        right = points[: len(points) // 2 + 1] * 1e-3
        # symmetric about the middle of the tooth, from gap to gap
        assert points[::-1] * [-1, 1] == pytest.approx(points, abs=1e-12)
        ends = np.arctan2(right[[0, -1], 0], right[[0, -1], 1])
        assert ends == pytest.approx([profile.half_pitch, 0.0], abs=1e-12)
        # the lands' ends project beyond their arcs by rounding: inside the range only
        gap, _, _ = profile.signed_distance(right[1:-1])
        assert np.abs(gap).max() < 1e-9
        # and every junction is among the points
        junctions, _, _ = profile.evaluate(profile.stations)
        nearest = [np.hypot(*(right - p).T).min() for p in junctions]
        assert max(nearest) < 1e-12


def test_chords_stay_close(exported):
    """Between the points the polygon leaves the geometry by less than 1 um."""
    design, _, texts = exported
    for points in read_csv(texts["wave_generator.csv"]):
        middle = 0.5e-3 * (points + np.roll(points, -1, axis=0))
        gap, _, _ = wave_generator(design).signed_distance(middle)
        assert np.abs(gap).max() < 1e-6
    for member in LAYERS[:2]:
        (points,) = read_csv(texts[f"{member}.csv"])
        right = points[: len(points) // 2 + 1] * 1e-3
        middle = 0.5 * (right[1:] + right[:-1])
        gap, _, _ = tooth_profile(design, member).signed_distance(middle)
        assert np.abs(gap).max() < 1e-6
