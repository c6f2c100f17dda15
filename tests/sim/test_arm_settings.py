"""What a file of an arm sets for its own motors and solver, and a scene does not take.

Both once gave figures without a word: references cut at 1 rad, drives whose step was
not solved to its end.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from messages import naming

from swgjoint.errors import InputError
from swgjoint.sim.arm.gentle_sweep import place_arm
from swgjoint.sim.arm.reading import ArmReading
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


def test_masses_that_come_from_shapes_are_reported(tmp_path):
    """Moving links of a URDF file that states no mass are filled with water."""
    box = '<collision><geometry><box size=".1 .1 .1"/></geometry></collision>'
    tensor = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    one = f'<inertial><mass value="3"/>{tensor}</inertial>'
    joint = '<joint name="j{}" type="continuous"><parent link="{}"/><child link="{}"/>'
    path = tmp_path / "arm.urdf"
    path.write_text(
        f'<robot name="a"><link name="base">{box}</link><link name="full">{one}{box}'
        f'</link><link name="bare">{box}</link>{joint.format(1, "base", "full")}'
        f"</joint>{joint.format(2, 'full', 'bare')}</joint></robot>"
    )
    with pytest.warns(UserWarning, match=naming("arm.urdf", "for bare;", "1000")):
        arm = RigidArm(str(path))
    masses = [arm.model.body(name).mass[0] for name in ("full", "bare")]
    np.testing.assert_allclose(masses, [3.0, 1.0])


def test_a_link_without_mass_may_be_held(tmp_path):
    """Only links that move need a mass: the helper of a gripper is held here."""
    tip = '<body name="tip"><joint name="aux" axis="0 1 0"/></body>'
    path = tmp_path / "arm.xml"
    path.write_text(FILE.format(settings="").replace("</body>", f"{tip}</body>", 1))
    with pytest.raises(InputError, match=naming("arm.xml", "mjMINVAL", "'tip'")):
        place_arm(str(path), reading=ArmReading())
    driven = ("lift", "elbow")
    arm, start = place_arm(str(path), reading=ArmReading(driven=driven))
    assert arm.joints == driven and len(start) == 2
    assert set(arm.held) == {"aux"} and arm.model.body("tip").mass[0] == 0.0
