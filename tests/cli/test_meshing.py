"""``swgjoint meshing``: the keys of the contract, filled with consistent numbers."""

from __future__ import annotations

import json

import pytest
from messages import names

from swgjoint.cli.main import main

TORQUE, STEPS, TURN = 12.0, 4, 0.006
STRESSES = {"tensile", "compressive", "von_mises"}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A short run of the reference with its files; (result, folder, stderr)."""
    folder = tmp_path_factory.mktemp("meshing") / "out"
    with pytest.MonkeyPatch.context() as patch:
        lines: list[str] = []
        patch.setattr("builtins.print", lambda *a, **k: lines.append(str(a[0])))
        options = ["--torque", str(TORQUE), "--steps", str(STEPS), "--turn", str(TURN)]
        arguments = ["reference-2d", *options, "--half", "--out", str(folder)]
        assert main(["meshing", *arguments, "--json"]) == 0
    return json.loads(lines[-1]), folder, lines[:-1]


def test_keys_of_the_contract(run):
    """Every key that the contract names is there, lists are as long as the steps."""
    result, _, _ = run
    assert {"nodes", "elements", "wall_s", "outcome", "label"} <= set(result)
    assert result["steps"] == STEPS
    assert result["outcome"] == "converged"
    assert set(result["flexspline"]["average_max_MPa"]) == STRESSES
    assert set(result["circular_spline"]["average_max_MPa"]) == STRESSES
    per_step = result["per_step"]
    assert {f"{kind}_MPa" for kind in STRESSES} <= set(per_step)
    assert {
        "pairs_in_contact",
        "output_error_arcsec",
        "wave_generator_torque_Nm",
    } <= set(per_step)
    assert {len(values) for values in per_step.values()} == {STEPS}
    states = [state["state"] for state in result["setup_MPa"]]
    assert states == ["wave_generator", "meshed", "torque"]
    assert all(set(state["flexspline"]) == STRESSES for state in result["setup_MPa"])


def test_positions(run):
    """The wave generator stands at k turns/N, k = 0 to N - 1."""
    angles = run[0]["per_step"]["angle_deg"]
    wanted = [360.0 * TURN * k / STEPS for k in range(STEPS)]
    assert angles == pytest.approx(wanted, abs=1e-12)


def test_averages_are_means_of_the_steps(run):
    """The average over the turn is the mean of the per-step maxima."""
    result, _, _ = run
    for kind, value in result["flexspline"]["average_max_MPa"].items():
        values = result["per_step"][f"{kind}_MPa"]
        assert value == pytest.approx(sum(values) / STEPS, rel=1e-12)


def test_balance_reaches_the_output(run):
    """Moment of the tooth forces plus wave-generator torque is T at every step."""
    per_step = run[0]["per_step"]
    for moment, input_torque in zip(
        per_step["tooth_moment_Nm"], per_step["wave_generator_torque_Nm"], strict=True
    ):
        assert moment + input_torque == pytest.approx(TORQUE, rel=1e-6)


def test_files(run):
    """--out holds the same object and pictures; progress stayed off stdout."""
    result, folder, others = run
    pictures = {"meshing", "contours", "tooth_forces", "root_stress", "contact_arcs"}
    names = {"meshing.json", *(f"{name}.png" for name in pictures)}
    assert {p.name for p in folder.iterdir()} == names
    assert json.loads((folder / "meshing.json").read_text()) == result
    for path in folder.glob("*.png"):
        assert path.read_bytes().startswith(b"\x89PNG")
    assert any("meshing: 4/4" in line for line in others)


def test_report(run):
    """The terminal shows the validity label, the stresses and the outcome."""
    from swgjoint.cli.meshing import report

    text = report(run[0])
    assert "validity: model 2d" in text and "level nonlinear" in text
    assert "outcome: converged" in text
    mean = run[0]["flexspline"]["average_max_MPa"]["von_mises"]
    assert f"{mean:.4g}" in text


def test_positions_on_one_tooth_phase_are_labelled(run):
    """Warning and label of the result stand beside the means and the error."""
    from swgjoint.cli.meshing import report

    assert run[0]["warnings"] == [] and run[0]["label"]["positions"] is None
    label = run[0]["label"] | {"positions": "on 1 tooth phase"}
    text = report(run[0] | {"label": label, "warnings": ["4 positions"]})
    means = [line for line in text.splitlines() if "mean of the maxima" in line]
    assert means and all("on 1 tooth phase" in line for line in means)
    assert "warning: 4 positions" in text.splitlines()


def test_rated_torque_is_the_default(monkeypatch):
    """Without --torque the run is at the rated torque of the design."""
    from swgjoint.fe import meshing

    seen = {}

    class Stop(BaseException):
        pass

    def simulate(design, **options):
        seen.update(options)
        raise Stop

    monkeypatch.setattr(meshing, "simulate_meshing", simulate)
    with pytest.raises(Stop):
        main(["meshing", "reference-2d", "--linear"])
    del seen["progress"]
    assert seen == {
        "model": "2d",
        "torque": 20.0,
        "steps": None,
        "turn": 0.5,
        "nonlinear": False,
        "half": False,
        "throw": False,
        "keep": None,
        "resume": False,
    }


def test_three_dimensional_model_needs_a_cup(capsys):
    """A ring without a cup is bad input in one line that names the other fidelity."""
    assert main(["meshing", "reference-2d", "--model", "3d"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert names(err, "reference-2d", "3d", "[cup]", "--model 2d")


def test_resume_needs_a_run(tmp_path, capsys):
    """Going on needs a 3D run and the folder of its states."""
    assert main(["meshing", "reference-2d", "--resume"]) == 2
    assert names(capsys.readouterr().err, "--resume", "3d", "--out DIR")
    folder = str(tmp_path / "none")
    command = ["meshing", "reference-3d", "--half", "--out", folder, "--resume"]
    assert main(command) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and names(err, "--resume", f"{folder}/states")
    assert not (tmp_path / "none").exists()
