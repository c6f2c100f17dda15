"""Names and patterns of joints."""

from __future__ import annotations

import mujoco
import pytest
from messages import names, naming

from swgjoint.errors import InputError
from swgjoint.joint.attach import attach
from swgjoint.joint.patterns import chosen_hinges
from swgjoint.maps.drive_map import DriveMap

ARM = """
<mujoco>
  <worldbody>
    <body name="base"><freejoint name="floating"/><geom size=".1"/>
      <body><joint name="shoulder_pan"/><geom size=".1"/>
        <body><joint name="shoulder_lift"/><geom size=".1"/>
          <body><joint name="elbow"/><geom size=".1"/>
            <body name="tip"><joint/><geom size=".1"/></body>
            <body><joint name="finger_left"/><geom size=".1"/></body>
            <body><joint name="finger_right"/><geom size=".1"/></body>
            <body><joint name="rail" type="slide"/><geom size=".1"/></body>
            <body><joint name="odd[1]"/><geom size=".1"/></body>
          </body></body></body></body>
  </worldbody>
  <equality><joint name="mimic" joint1="finger_right" joint2="finger_left"/></equality>
</mujoco>
"""


@pytest.fixture
def spec():
    return mujoco.MjSpec.from_string(ARM)


def test_the_first_key_counts_and_the_order_is_the_models(spec):
    """A name, a pattern, a name that looks like a pattern; others are left alone."""
    got = chosen_hinges(spec, ["elbow", "odd[1]", "shoulder_*"])
    assert list(got.items()) == [
        ("shoulder_pan", "shoulder_*"),
        ("shoulder_lift", "shoulder_*"),
        ("elbow", "elbow"),
        ("odd[1]", "odd[1]"),
    ]


def test_hinges_that_cannot_take_a_drive_are_left_out_with_one_line(spec):
    """A follower and a hinge without name under a pattern; slides are not meant."""
    attach(
        spec,
        joint="elbow",
        drive=DriveMap.linear(1e4),
        rotor_inertia=1e-4,
        level="linear",
    )
    with pytest.warns(
        UserWarning, match=naming("'finger_right'", "mimic", "'tip'", "'elbow'")
    ) as caught:
        got = chosen_hinges(spec, ["*"])
    [line] = caught
    assert not names(str(line.message), "rail") and line.filename == __file__
    assert list(got) == ["shoulder_pan", "shoulder_lift", "finger_left", "odd[1]"]


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        (["sholder_*"], (["'sholder_*'", "shoulder_pan", "elbow"],)),
        (["Elbow"], (["'Elbow'", "elbow"],)),
        (["finger_right"], (["'finger_right'", "mimic"],)),
        (["finger_right", "rail"], (["mimic"], ["rail", "slide", "hinge"])),
        (["finger_r*"], (["'finger_r*'", "'finger_right'", "mimic"],)),
        (["rail*"], (["'rail*'", "elbow"],)),
        (["shoulder_*", "shoulder_pan"], (["'shoulder_pan'", "'shoulder_*'"],)),
        ([3], (["3", "pattern"],)),
    ],
)
def test_a_key_that_means_nothing_is_refused(spec, keys, says):
    """A line for each, with what there is."""
    with pytest.raises(InputError) as caught:
        chosen_hinges(spec, keys)
    lines = str(caught.value).splitlines()
    assert len(lines) == len(says)
    for line, parts in zip(lines, says, strict=True):
        assert names(line, *parts)
