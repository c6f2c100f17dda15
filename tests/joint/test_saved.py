"""Saved models with drives: XML, MJB and pickles in a process that imports swgjoint."""

from __future__ import annotations

import itertools
import json
import pickle
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
# what would change the elements of a drive, were it inherited
DEFAULTS = """
<mujoco><size nuser_tendon="6" nuser_jnt="2"/><default>
  <tendon user="1 .5 .1 .2 3 4" stiffness="7" damping="3" frictionloss="1" range="-1 1"
    limited="true" springlength=".1 .2" armature="1" actuatorfrclimited="true"
    actuatorfrcrange="-1 1" margin=".1" solreffriction=".5 2"/>
  <joint stiffness="5" damping="3" armature="2" frictionloss="1" limited="true"
    range="-1 1" springref="20" user="1 2" actuatorgravcomp="true" margin=".2"
    actuatorfrclimited="true" actuatorfrcrange="-1 1" pos="1 1 1" axis="0 1 0"
    ref="5" solreffriction=".5 2" solimpfriction=".1 .2"/>
  <geom mass="3" size=".3" margin=".1"/><site size=".2"/><general gear="5"/>
  <equality solref=".4 1"/>
</default>"""
OWN = """pos="0 0 0" stiffness="0" damping="0" armature="0" frictionloss="0"
  limited="false" springref="0" actuatorgravcomp="false" margin="0"
  actuatorfrclimited="false" """
# every level with every option that it has
PARTS = ("friction", "hysteresis")
OPTIONS = ("lumped", "variable", "prefix", "defaults")
LAYOUTS = ("circular_spline_fixed", "flexspline_fixed", "wave_generator_fixed")
CASES = [
    ("rigid", ()),
    ("rigid", ("prefix",)),
    ("kinematic", ()),
    *((level, (part, "prefix")) for level in ("rigid", "kinematic") for part in PARTS),
    *(
        (level, (*parts, *options))
        for level in ("linear", "native", "full")
        for n in range(3)
        for parts in itertools.combinations(PARTS, n)
        for options in ((), *((one,) for one in OPTIONS), ("variable", "prefix"))
    ),
    *(
        (level, (*PARTS, layout))
        for level in ("rigid", "kinematic", "linear", "native", "full")
        for layout in LAYOUTS[1:]
    ),
]
# what a program of somebody else does, with nothing but these imports
PROGRAM = """
import json, pickle, sys
{imports}
ends = {{}}
for name, path in json.loads(sys.argv[1]).items():
    model = {read}
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, 200)
    ends[name] = data.qpos.tolist()
print(json.dumps(ends))
"""
READ = {
    "xml": "mujoco.MjModel.from_xml_path(path)",
    "mjb": "mujoco.MjModel.from_binary_path(path)",
    "pkl": "pickle.load(open(path, 'rb'))",
}


@pytest.fixture
def models(synthetic_map, friction_law):
    """Model by case, and its spec: maps with and without hysteresis and friction."""
    elements = (Jenkin(stiffness=1e4, yield_torque=3.0),)
    lossy = replace(synthetic_map, friction=friction_law, hysteresis=elements)
    found = {}
    for level, options in CASES:
        found[" ".join((level, *options))] = make_spec(lossy, level, options)
    return {name: (spec, spec.compile()) for name, spec in found.items()}


def make_spec(lossy, level, options):
    text = TEXT
    if "defaults" in options:
        text = text.replace("<joint ", f"<joint {OWN}").replace("<mujoco>", DEFAULTS)
    spec = mujoco.MjSpec.from_string(text)
    drive = replace(
        lossy,
        friction=lossy.friction if "friction" in options else None,
        hysteresis=lossy.hysteresis if "hysteresis" in options else (),
        layout=next((x for x in LAYOUTS if x in options), lossy.layout),
    )
    got = attach(
        spec,
        joint="j",
        drive=drive,
        rotor_inertia=4e-5,
        level=level,
        rotor="lumped" if "lumped" in options else "gyroscopic",
        variable="variable" in options,
    )
    if got.variable:
        tendon = spec.tendon(got.tendon)
        tendon.userdata = Variation(stiffness=0.3, theta=0.2, losses=0.5).numbers
    if "prefix" in options:
        outer = mujoco.MjSpec.from_string(
            '<mujoco><option timestep="0.001" integrator="discrete" '
            'gravity="1 0 0"/><worldbody/></mujoco>'
        )
        outer.attach(spec, prefix="left_", frame=outer.worldbody.add_frame())
        return outer
    return spec


def ends_here(model):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, 200)
    return data.qpos.copy()


def ends_elsewhere(folder, models, kind, imports):
    paths = {}
    for k, (name, (spec, model)) in enumerate(models.items()):
        path = folder / f"{k}.{kind}"
        paths[name] = str(path)
        if kind == "xml":
            path.write_text(spec.to_xml())
        elif kind == "mjb":
            mujoco.mj_saveModel(model, paths[name])
        else:
            path.write_bytes(pickle.dumps(model))
    program = PROGRAM.format(imports=imports, read=READ[kind])
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
    for name, (_, model) in models.items():
        here = ends_here(model)
        assert np.abs(here).max() > 0.05
        np.testing.assert_allclose(found[name], here, rtol=2e-5, err_msg=name)


@pytest.mark.parametrize("kind", ["mjb", "pkl"])
def test_every_level_and_option_survives_in_binary(models, tmp_path, kind):
    """A fresh process moves with the same bits, from MJB and from a pickle."""
    found = ends_elsewhere(tmp_path, models, kind, "import mujoco, swgjoint")
    for name, (_, model) in models.items():
        np.testing.assert_array_equal(found[name], ends_here(model), err_msg=name)


@pytest.mark.parametrize("level", ["linear", "native", "full"])
def test_defaults_of_the_file_do_not_reach_a_drive(models, level):
    """With any defaults a joint moves as without them, bit by bit."""
    for parts in ("", " friction", " hysteresis", " friction hysteresis"):
        ends = [
            ends_here(models[f"{level}{parts}{tail}"][1]) for tail in ("", " defaults")
        ]
        np.testing.assert_array_equal(*ends)


def test_a_model_of_an_older_mark_still_runs(models):
    """Binary models of before have a friction tendon with a cubic of 1e-30."""
    spec = models["full friction"][0].copy()
    assert spec.tendon("j_friction").stiffness.tolist() == list(FRICTION_STIFFNESS)
    new = ends_here(spec.compile())
    spec.tendon("j_friction").stiffness = np.array([1e-9, 0.0, 1e-30])
    np.testing.assert_allclose(ends_here(spec.compile()), new, rtol=1e-12)


def test_the_plugin_is_loaded_by_name_with_its_path():
    """``load_plugin`` is public, may be called again and names the library."""
    assert swgjoint.load_plugin() == swgjoint.load_plugin() == library()
    assert Path(library()).is_file()
