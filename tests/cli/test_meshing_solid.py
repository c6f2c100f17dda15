"""``swgjoint meshing`` in space: coning, the picture of the deflected cup."""

from __future__ import annotations

import json

import numpy as np
import pytest

from swgjoint.cli.main import main
from swgjoint.gear.design.design import Design
from swgjoint.view.plots.solid import magnification, outline

pytestmark = pytest.mark.fe


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A small gear with a cup at one position, with its files; (result, folder)."""
    folder = tmp_path_factory.mktemp("meshing") / "out"
    small = Design.load("reference-3d").with_changes(
        {
            "drive.teeth_flexspline": 40,
            "drive.teeth_circular_spline": 42,
            "cup.length_mm": 14.0,
            "cup.bore_radius_mm": 7.0,
            "mesh.refinement": 0.5,
        }
    )
    path = folder.parent / "small.toml"
    path.write_text(small.to_toml(), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        lines: list[str] = []
        patch.setattr("builtins.print", lambda *a, **k: lines.append(str(a[0])))
        options = ["--torque", "1", "--steps", "1", "--half", "--out", str(folder)]
        assert main(["meshing", str(path), *options, "--json"]) == 0
    return json.loads(lines[-1]), folder


def test_coning_of_every_state_of_the_set_up(run):
    """Outward at the major axis, inward at the minor one, most at the open edge."""
    states = run[0]["coning_mm"]
    assert [s["state"] for s in states] == ["wave_generator", "meshed", "torque"]
    for state in states:
        major, minor = state["major"], state["minor"]
        assert major["open_edge"] > major["closed_edge"] > 0.0
        assert minor["open_edge"] < minor["closed_edge"] < 0.0
        # the lobe is 1 mm high; the bore comes off it towards the closed edge
        assert major["open_edge"] == pytest.approx(1.0, rel=0.25)


def test_pictures(run):
    """The cup, its coning and the contact pattern; the report names both edges."""
    from swgjoint.cli.meshing import report

    result, folder = run
    for name in ("cup_section", "coning", "contact_pattern", "meshing"):
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert str(folder / f"{name}.png") in result["files"]
    edge = result["coning_mm"][2]["major"]["open_edge"]
    line = f"[mm], torque: major axis {edge:.4f} at the open edge"
    assert line in report(result)


def test_magnification_is_a_round_number():
    """The largest deflection takes 8 to 20 % of the picture."""
    for most in np.geomspace(1e-6, 1e-2, 17):
        factor = magnification(most, 40e-3)
        assert 0.2 * 0.4 <= factor * most / 40e-3 <= 0.2 * (1.0 + 1e-9)
        assert f"{factor:.0e}"[0] in "125"


def test_outline_goes_around():
    """Of two squares that share an edge, six edges; the shared one is inside."""
    edges = outline(np.array([[0, 1, 2, 3], [1, 4, 5, 2]]))
    wanted = {(0, 1), (2, 3), (0, 3), (1, 4), (4, 5), (2, 5)}
    assert {tuple(edge) for edge in edges.tolist()} == wanted
