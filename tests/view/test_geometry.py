"""Shapes of geoms in the viewer."""

import mujoco
import numpy as np
import pytest

from swgjoint.view.recording.geometry import color_of, quaternion_xyzw, shape_of

MODEL = mujoco.MjModel.from_xml_string("""
<mujoco>
  <asset><mesh name="tetra" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>
  <worldbody>
    <geom name="plane" type="plane" size="1 1 1"/>
    <geom name="capsule" type="capsule" size="0.1 0.4" rgba="1 0 0.5 1"/>
    <geom name="cylinder" type="cylinder" size="0.1 0.4"/>
    <geom name="box" type="box" size="0.1 0.2 0.3"/>
    <geom name="ball" type="sphere" size="0.1"/>
    <geom name="egg" type="ellipsoid" size="0.1 0.2 0.3"/>
    <geom name="mesh" type="mesh" mesh="tetra"/>
  </worldbody>
</mujoco>
""")


def test_a_capsule_is_centred_like_that_of_the_engine():
    """The viewer's capsule starts at one end: it is moved back by half its length."""
    shape = shape_of(MODEL, MODEL.geom("capsule").id)
    assert shape.lengths.as_arrow_array().to_pylist() == pytest.approx([0.8])
    moved = shape.translations.as_arrow_array().to_pylist()
    assert moved[0] == pytest.approx([0.0, 0.0, -0.4])


def test_every_solid_kind_is_drawn_and_scenery_is_not():
    """Six kinds give a shape, a plane none."""
    drawn = [shape_of(MODEL, k) is not None for k in range(MODEL.ngeom)]
    assert drawn == [False, True, True, True, True, True, True]


def test_colours_and_quaternions_are_in_the_viewers_order():
    """Colours run to 255; the scalar part of a quaternion comes last."""
    assert color_of(MODEL, MODEL.geom("capsule").id) == 0xFF0080FF
    turned = quaternion_xyzw(np.array([0.5, 0.1, 0.2, 0.3]))
    np.testing.assert_array_equal(turned, [0.1, 0.2, 0.3, 0.5])
