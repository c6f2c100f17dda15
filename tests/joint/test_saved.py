"""Saved models with drives: XML and MJB in a process that only imports swgjoint."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import swgjoint
from swgjoint.joint.attach import attach
from swgjoint.joint.plugin import FRICTION_STIFFNESS, library
from swgjoint.joint.variation import Variation
from swgjoint.maps.hysteresis import Jenkin

TEXT = """
<mujoco>
  <option timestep="0.001" gravity="1 0 0"/>
  <worldbody>
    <body name="link"><joint name="j" axis="0 0 1" ref="10"/>
      <inertial pos=".2 .1 0" mass="3" diaginertia=".3 .3 .3"/></body>
  </worldbody>
  <keyframe><key name="home" qpos=".3" qvel=".5"/></keyframe>
</mujoco>
"""
CASES = {
    "rigid": {"level": "rigid"},
    "kinematic": {"level": "kinematic"},
    "linear": {"level": "linear"},
    "native": {"level": "native"},
    "full": {},
    "frictionless": {"friction": False},
    "lumped": {"rotor": "lumped"},
    "variable": {"variable": True},
    "prefix": {},
    "flexspline_fixed": {},
}
# what a program of somebody else does, with nothing but these imports
PROGRAM = """
import json, sys
{imports}
ends = {{}}
for name, path in json.loads(sys.argv[1]).items():
    read = mujoco.MjModel.from_{kind}_path
    model = read(path)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, 200)
    ends[name] = data.qpos.tolist()
print(json.dumps(ends))
"""


@pytest.fixture
def models(synthetic_map, friction_law):
    """Spec by case; the map has hysteresis and friction."""
    elements = (Jenkin(stiffness=1e4, yield_torque=3.0),)
    lossy = replace(synthetic_map, friction=friction_law, hysteresis=elements)
    found = {}
    for name, keys in CASES.items():
        spec = mujoco.MjSpec.from_string(TEXT)
        layout = name if name.endswith("fixed") else lossy.layout
        drive = replace(lossy, layout=layout)
        got = attach(spec, joint="j", drive=drive, rotor_inertia=4e-5, **keys)
        if name == "variable":
            tendon = spec.tendon(got.tendon)
            tendon.userdata = Variation(stiffness=0.3, theta=0.2, losses=0.5).numbers
        if name == "prefix":
            outer = mujoco.MjSpec.from_string(
                '<mujoco><option timestep="0.001" integrator="discrete" '
                'gravity="1 0 0"/><worldbody/></mujoco>'
            )
            frame = outer.worldbody.add_frame()
            outer.attach(spec, prefix="left_", frame=frame)
            spec = outer
        found[name] = spec
    return found


def ends_here(spec):
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, 200)
    return data.qpos.copy()


def ends_elsewhere(folder, specs, kind, imports):
    paths = {}
    for name, spec in specs.items():
        model = spec.compile()
        paths[name] = str(folder / f"{name}.{kind}")
        if kind == "xml":
            (folder / f"{name}.xml").write_text(spec.to_xml())
        else:
            mujoco.mj_saveModel(model, paths[name])
    program = PROGRAM.format(imports=imports, kind=kind.replace("mjb", "binary"))
    done = subprocess.run(
        [sys.executable, "-c", program, json.dumps(paths)],
        capture_output=True,
        text=True,
        cwd=folder,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    "imports",
    ["import mujoco", "import swgjoint, mujoco", "import mujoco, swgjoint"],
)
def test_every_level_and_option_survives_xml(models, tmp_path, imports):
    """A fresh process moves alike; MuJoCo writes six digits of the tendon's lengths."""
    found = ends_elsewhere(tmp_path, models, "xml", imports)
    for name, spec in models.items():
        here = ends_here(spec)
        assert np.abs(here).max() > 0.05
        np.testing.assert_allclose(found[name], here, rtol=2e-5, err_msg=name)


def test_every_level_and_option_survives_mjb(models, tmp_path):
    """A fresh process moves with the same bits."""
    found = ends_elsewhere(tmp_path, models, "mjb", "import mujoco, swgjoint")
    for name, spec in models.items():
        np.testing.assert_array_equal(found[name], ends_here(spec), err_msg=name)


def test_a_model_of_an_older_mark_still_runs(models):
    """Binary models of before have a friction tendon with a cubic of 1e-30."""
    spec = models["full"].copy()
    assert spec.tendon("j_friction").stiffness.tolist() == list(FRICTION_STIFFNESS)
    new = ends_here(spec)
    spec.tendon("j_friction").stiffness = np.array([1e-9, 0.0, 1e-30])
    np.testing.assert_allclose(ends_here(spec), new, rtol=1e-12)


def test_the_plugin_is_loaded_by_name_with_its_path():
    """``load_plugin`` is public, may be called again and names the library."""
    assert swgjoint.load_plugin() == swgjoint.load_plugin() == library()
    assert Path(library()).is_file()
