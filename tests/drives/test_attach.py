"""``swgjoint.attach``: names, patterns, files and designs on any model."""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
import pytest
from messages import naming

import swgjoint
from swgjoint.errors import InputError
from swgjoint.joint.plugin import friction_numbers
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.arm.scene import scene_of_arm


@pytest.fixture
def spec():
    return RigidArm("ur5e").spec()


def test_patterns_give_each_joint_its_drive(spec):
    """Catalogue names by pattern; the result is in the order of the model."""
    joints = [joint.name for joint in spec.joints]
    got = swgjoint.attach(spec, {"wrist_*": "CSG-14-100", "*": "CSG-25-100"})
    assert list(got) == joints
    sizes = {name: one.drive.name for name, one in got.items()}
    assert sizes == {
        name: "CSG-14-100" if name.startswith("wrist_") else "CSG-25-100"
        for name in joints
    }
    model = spec.compile()
    assert model.nplugin == len(joints)
    assert got["elbow_joint"].friction is not None


def test_the_rotor_of_a_catalogue_drive_is_that_of_a_scene(spec):
    """Twice the wave generator's inertia, for a name and for its map."""
    scene = scene_of_arm("ur5e", drive="CSG-17-100")
    wanted = scene.joint_settings("elbow_joint").rotor_inertia_kgm2
    named = swgjoint.attach(spec, joint="elbow_joint", drive="CSG-17-100")
    drive = DriveMap.from_catalogue("CSG-17-100")
    given = swgjoint.attach(spec, joint="wrist_1_joint", drive=drive)
    assert named.rotor_inertia == given.rotor_inertia == wanted
    own = swgjoint.attach(spec, joint="wrist_2_joint", drive=drive, rotor_inertia=3e-5)
    assert own.rotor_inertia == 3e-5


def test_files_and_designs_are_drives(spec, tmp_path, monkeypatch, synthetic_map):
    """Path of a map, path and name of a design, a Design, a map: the same drive.

    A design is built once, at the fidelity that was asked for.
    """
    design, asked = swgjoint.Design.load("reference-2d"), []

    def build(design, *, model, **options):
        asked.append((design.drive.name, model))
        return synthetic_map

    monkeypatch.setattr("swgjoint.drives.build_map.build_map", build)
    synthetic_map.save(tmp_path / "drive.swg")
    (tmp_path / "drive.toml").write_text(design.to_toml())
    spec.option.timestep = 5e-4
    joints = [joint.name for joint in spec.joints]
    keys = {"rotor_inertia": 1e-4}
    files = [synthetic_map, tmp_path / "drive.swg"]
    got = swgjoint.attach(spec, dict(zip(joints, files, strict=False)), **keys)
    designs = [tmp_path / "drive.toml", "reference-2d", design, "reference-2d"]
    table = dict(zip(joints[2:], designs, strict=True))
    got |= swgjoint.attach(spec, table, model="ring", **keys)
    assert asked == [("reference-2d", "ring")] * 3
    assert list(got) == joints
    for one in got.values():
        np.testing.assert_array_equal(one.drive.potential, synthetic_map.potential)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"drive": "CSG-25-101"}, ("CSG-25-101", "CSG-25-100")),
        ({"drive": 3}, ("int", "3", "DriveMap")),
        ({"drive": DriveMap.linear(1e4)}, ("'elbow_joint'", "rotor_inertia", "kg·m²")),
        ({"joint": "elbo_joint"}, ("'elbo_joint'", "elbow_joint")),
        ({"rotor_inertia": "4e-5"}, ("rotor_inertia", "4e-5 kg·m²")),
        ({"joint": None}, ("joint", "drive", "mapping")),
        ({"drives": {"elbow_joint": "CSG-25-100"}}, ("joint", "mapping")),
        (
            {"drives": ["elbow_joint"], "joint": None, "drive": None},
            ("list", "mapping"),
        ),
        ({"model": "2d"}, ("'2d'", "CSG-25-100", "design")),
        ({"integrator": "euler"}, ("'euler'", "discrete", "keep")),
    ],
)
def test_bad_input_is_one_line(spec, change, says):
    """What was given and what is accepted; the spec is unchanged."""
    before = spec.to_xml()
    with pytest.raises(InputError, match=naming(*says)) as caught:
        swgjoint.attach(
            spec, **{"joint": "elbow_joint", "drive": "CSG-25-100"} | change
        )
    assert "\n" not in str(caught.value)
    assert spec.to_xml() == before


def test_what_is_no_spec_is_named(spec):
    """A compiled model, a path."""
    model = spec.compile()
    for wrong, says in ((model, "MjModel"), ("arm.xml", "arm.xml"), (None, "NoneType")):
        with pytest.raises(InputError, match=naming(says, "mujoco.MjSpec")):
            swgjoint.attach(wrong, joint="elbow_joint", drive="CSG-25-100")


def test_a_user_is_told_of_a_step_outside(spec):
    """Where the low level leaves the region to its caller, the top level says it."""
    spec.option.timestep = 0.02
    with pytest.warns(UserWarning, match=naming("20 ms", "would do")) as caught:
        swgjoint.attach(spec, {"*": "CSG-25-100"})
    [line] = caught
    assert line.filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fine = RigidArm("ur5e").spec()
        fine.option.timestep = 1e-3
        swgjoint.attach(fine, {"*": "CSG-25-100"})
    assert fine.compile().nnumeric == 1
    assert isinstance(mujoco.MjData(fine.compile()), mujoco.MjData)


def test_joints_of_one_catalogue_drive_err_at_phases_of_their_own(spec):
    """The stated accuracy by default; another size, seed or none on request."""
    stated = DriveMap.from_catalogue("CSG-25-100").info["stated"]
    wanted = stated["transmission_accuracy_arcmin"]
    got = swgjoint.attach(spec, {"shoulder_*": "CSG-25-100"})
    pan, lift = (one.drive for one in got.values())
    for drive in (pan, lift):
        accuracy = drive.spec_sheet(["transmission_accuracy_arcmin"])
        found = accuracy["transmission_accuracy_arcmin"]
        assert found == pytest.approx(wanted, rel=1e-3)
    assert not np.allclose(pan.kinematic_error, lift.kinematic_error)
    more = swgjoint.attach(
        spec, joint="elbow_joint", drive="CSG-25-100", kinematic_error_arcmin=2 * wanted
    )
    other = RigidArm("ur5e").spec()
    again = swgjoint.attach(
        other, joint="shoulder_pan_joint", drive="CSG-25-100", seed=1
    )
    none = swgjoint.attach(
        other, joint="elbow_joint", drive="CSG-25-100", kinematic_error_arcmin=0.0
    )
    size = np.abs(more.drive.kinematic_error).max() / np.abs(pan.kinematic_error).max()
    assert size > 1.3
    assert not np.allclose(again.drive.kinematic_error, pan.kinematic_error)
    assert not none.drive.kinematic_error.any()


def test_friction_at_a_temperature(spec):
    """The engine's numbers follow the temperature; what has no friction is refused."""
    cold = swgjoint.attach(
        spec, joint="elbow_joint", drive="CSG-25-100", temperature_C=0.0
    )
    room = swgjoint.attach(spec, joint="wrist_1_joint", drive="CSG-25-100")
    assert cold.friction.viscous > 2.0 * room.friction.viscous
    assert cold.friction.coulomb == pytest.approx(room.friction.coulomb)
    written = [
        [float(x) for x in plugin.config["friction"].split()] for plugin in spec.plugins
    ]
    wanted = [friction_numbers(one.drive).tolist() for one in (cold, room)]
    assert sorted(written) == sorted(wanted)
    for drive, value, says in (
        ("CSG-25-50", 20.0, ("wrist_2_joint", "no friction")),
        ("CSG-25-100", 200.0, ("200 °C", "-10 to 80 °C")),
        ("CSG-25-100", float("nan"), ("temperature_C", "number")),
    ):
        with pytest.raises(InputError, match=naming(*says)):
            swgjoint.attach(
                spec, joint="wrist_2_joint", drive=drive, temperature_C=value
            )
