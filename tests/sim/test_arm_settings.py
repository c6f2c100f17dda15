"""What a file of an arm sets for its own motors and solver, and a scene does not take.

Both once gave figures without a word: references cut at 1 rad, drives whose step was
not solved to its end.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.arm.scene import scene_of_arm
from swgjoint.view.run import run_scene

FILE = """
<mujoco>
  {settings}
  <worldbody><body name="upper" pos="0 0 1"><joint name="lift" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="3"/>
    <body pos=".4 0 0"><joint name="elbow" axis="0 1 0"/>
      <geom type="capsule" fromto=".1 0 0 .4 0 0" size=".03" mass="1"/></body>
  </body></worldbody>
</mujoco>
"""


@pytest.mark.parametrize(
    "settings",
    [
        '<default><motor ctrlrange="-1 1" ctrllimited="true" gear="5"/></default>',
        '<default><general forcerange="-1 1" forcelimited="true" dyntype="filter"'
        ' dynprm="0.1"/></default>',
        '<option iterations="1" ls_iterations="1" tolerance="1e-2"/>',
        '<option solver="PGS" noslip_iterations="3"/>',
    ],
)
def test_the_motion_is_that_of_the_plain_file(settings, tmp_path):
    """Defaults of actuators and limits of the solver change nothing."""
    runs = []
    for k, text in enumerate(("", settings)):
        path = tmp_path / f"arm{k}.xml"
        path.write_text(FILE.format(settings=text))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            scene = scene_of_arm(str(path), overrides=["simulation.duration_s=2.0"])
            runs.append(run_scene(scene))
    np.testing.assert_array_equal(runs[0].position, runs[1].position)
    assert np.abs(runs[0].position - runs[0].reference).max() < 0.01


def test_more_iterations_than_usual_stay(tmp_path):
    """A file may ask for more than the engine's default."""
    path = tmp_path / "arm.xml"
    path.write_text(
        FILE.format(settings='<option iterations="500" tolerance="1e-14"/>')
    )
    option = RigidArm(str(path)).model.opt
    assert (option.iterations, option.tolerance) == (500, 1e-14)
