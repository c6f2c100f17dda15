"""``swgjoint profile``: numbers that agree with the geometry, a picture."""

from __future__ import annotations

import json
from itertools import pairwise
from math import hypot

import pytest

from swgjoint.cli.main import main


@pytest.fixture
def result(capsys):
    assert main(["profile", "reference-2d", "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_key_figures(result):
    """Straight length, radii and the thickness without backlash: a quarter of pi m."""
    for member, pitch in (("flexspline", 60.0), ("circular_spline", 61.0)):
        assert result[member]["straight_length_mm"] == pytest.approx(0.2, rel=1e-14)
        assert result[member]["pitch_radius_mm"] == pytest.approx(pitch, rel=1e-14)
        # c_P = 1: tooth and gap share the circular pitch pi m, m = 1 mm
        thickness = result[member]["thickness_at_pitch_mm"]
        assert thickness == pytest.approx(3.141592653589793 / 2, rel=1e-12)


def test_all_checks_pass(result):
    """Closed and tangent to round-off, for both members."""
    assert len(result["checks"]) == 8
    assert all(check["ok"] for check in result["checks"])


def test_points_lie_between_tip_and_root(result):
    """The flanks run from the tip circle to the root circle."""
    for member in ("flexspline", "circular_spline"):
        first, *_, last = result["points"][member]
        assert hypot(*first) == pytest.approx(result[member]["tip_radius_mm"])
        assert hypot(*last) == pytest.approx(result[member]["root_radius_mm"])


def test_polyline_length_is_the_length_of_the_segments(result):
    """The polyline of the points is as long as the segments together."""
    for member in ("flexspline", "circular_spline"):
        points = result["points"][member]
        length = sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(points))
        segments = sum(part["length_mm"] for part in result[member]["segments"])
        # 24 chords an arc of at most 1 rad shorten it by (1/24)^2/24
        assert length == pytest.approx(segments, rel=1e-4)
        assert length < segments


def test_files(tmp_path, capsys):
    """--out writes the JSON object and a picture, and names them."""
    out = tmp_path / "new" / "folder"
    assert main(["profile", "reference-2d", "--out", str(out)]) == 0
    assert sorted(p.name for p in out.iterdir()) == ["profile.json", "profile.png"]
    assert (out / "profile.png").read_bytes().startswith(b"\x89PNG")
    written = json.loads((out / "profile.json").read_text())
    assert written["files"] == [str(out / "profile.json"), str(out / "profile.png")]
    assert f"wrote {out / 'profile.png'}" in capsys.readouterr().out
