"""How time grows with size."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from swgjoint.bench.scaling import fe as scaling_fe
from swgjoint.bench.scaling import joint as scaling_joint
from swgjoint.bench.scaling.scaling import SizeSweep, fit_exponent, run_scaling


def sweep(**changes):
    """A cubic that costs 2 at size 1, plus what does not grow."""
    given = {
        "name": "cube",
        "label": "size",
        "per": "step",
        "sizes": (1, 10, 100, 1000),
        "measure": lambda n: {"seconds": 500.0 + 2.0 * n**3},
    }
    return SizeSweep(**(given | changes))


def test_a_power_is_found_where_it_rules():
    """Exponent 3 beyond the constant part; less over all sizes."""
    rows = run_scaling(sweeps=[sweep()])["rows"]
    assert fit_exponent(sweep(from_size=100), rows)["exponent"] == pytest.approx(
        3.0, abs=1e-3
    )
    whole = fit_exponent(sweep(), rows)
    assert whole["exponent"] < 2.5 and whole["spread"] > 1.5


def test_a_size_that_fails_is_kept_and_not_fitted(tmp_path):
    """Its outcome stands in the row; the fit goes by the others."""

    def measure(n):
        if n == 10:
            return {"seconds": None, "outcome": "no equilibrium"}
        return {"seconds": 3.0 * n}

    result = run_scaling(sweeps=[sweep(measure=measure)], folder=tmp_path / "out")
    assert [row["outcome"] for row in result["rows"]][1] == "no equilibrium"
    assert result["fits"][0]["exponent"] == pytest.approx(1.0)
    assert len(result["files"]) == 3


def test_a_chain_that_diverges_is_a_row(monkeypatch):
    """One line as its outcome; the other sizes are measured."""
    chain_model = scaling_joint.chain_model

    def torn(joints, **keys):
        model, data = chain_model(joints, **keys)
        if joints == 2:
            data.qvel[:] = np.nan
        return model, data

    monkeypatch.setattr(scaling_joint, "chain_model", torn)
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        rows = run_scaling(sweeps=[sweep(sizes=(1, 2), measure=scaling_joint.chain)])
    finally:
        mujoco.set_mju_user_warning(None)
    well, diverged = rows["rows"]
    assert well["outcome"] == "ok" and well["seconds"] > 0.0
    assert diverged["seconds"] is None
    assert diverged["outcome"].startswith("the chain of 2 degrees of freedom diverged")


def test_the_chain_has_all_drives_and_keeps_its_motion():
    """Every joint has its rotor and plugin; a slow free chain goes on turning."""
    model, data = scaling_joint.chain_model(5)
    assert (model.nv, model.nplugin) == (10, 5)
    mujoco.mj_step(model, data, 200)
    assert np.isfinite(data.qpos).all() and not any(w.number for w in data.warning)
    # within the kinematic error of the maps
    assert np.abs(data.qvel[model.jnt_dofadr[0]]) < 0.2
    rigid, _ = scaling_joint.chain_model(5, level="rigid")
    assert (rigid.nv, rigid.nplugin) == (5, 0)


def test_harmonics_are_there():
    """The map has as many as asked for, and a torque from each."""
    drive = scaling_joint.map_with(7)
    assert drive.orders.shape == (8, 2)
    row = scaling_joint.evaluation(4)
    assert row["seconds"] > 0.0


def test_a_position_is_timed_without_its_set_up():
    """Set-up and positions apart; iterations and nodes beside."""
    row = scaling_fe.mesh(0.5)
    assert row["outcome"] == "converged"
    assert row["size"] == row["nodes"] > 100
    # which of them is longer depends on who else uses the cores
    assert row["seconds"] > 0.0 and row["setup_s"] > 0.0
    assert row["iterations"] > 2


def test_teeth_are_timed_on_a_rigid_wave_generator():
    """The family has an odd number of balls, which half a drive does not take."""
    row = scaling_fe.teeth(60)
    assert row["outcome"] == "converged"
    assert row["seconds"] > 0.0


def test_a_lot_is_timed_without_its_perfect_drive(monkeypatch):
    """The superposition of two drives, for a few angles."""
    perfect = scaling_fe.perfect_positions
    monkeypatch.setattr(scaling_fe, "perfect_positions", lambda d: perfect(d, phases=1))
    scaling_fe._perfect_positions.cache_clear()
    try:
        row = scaling_fe.lot(2)
    finally:
        scaling_fe._perfect_positions.cache_clear()
    assert row["model"] == "2d"
    assert row["seconds"] > 0.0
