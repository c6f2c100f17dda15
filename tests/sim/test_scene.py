"""Scene files: every fault in one go, overrides, inheritance."""

import pytest
from messages import names, naming

from swgjoint.drives.sections import JointSection
from swgjoint.errors import InputError
from swgjoint.sim.scene.overrides import parse_override
from swgjoint.sim.scene.scene import Scene

GOOD = """
name = "good"
arm = "bench"
[defaults]
drive = "reference-2d"
level = "full"
rotor_inertia_kgm2 = 1e-4
[joints.joint]
rotor_inertia_kgm2 = 5e-5
[trajectory]
kind = "constant_speed"
[trajectory.speed_deg_s]
joint = 3
[simulation]
duration_s = 1.0
"""


def refusal(text: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        Scene.from_toml(text, where="file.toml")
    return str(caught.value).splitlines()


def test_all_faults_are_listed_at_once():
    """Wrong key, type, sign and choice each give one line with path and value."""
    lines = refusal(
        GOOD.replace('level = "full"', 'level = "ful"')
        .replace("rotor_inertia_kgm2 = 5e-5", "rotor_inertia_kgm2 = -5e-5")
        .replace("joint = 3", 'joint = "3"')
        .replace("duration_s = 1.0", "duration_s = 1.0\nsteps_s = 0.001")
    )
    assert len(lines) == 4
    assert all(line.startswith("file.toml: ") for line in lines)
    text = "\n".join(lines)
    levels = ("'rigid'", "'kinematic'", "'linear'", "'native'", "'full'")
    for parts in (
        ("defaults.level", "'ful'", *levels),
        ("joints.joint.rotor_inertia_kgm2", "-5e-05 kg·m²", "> 0 kg·m²", "<= 1 kg·m²"),
        ("trajectory.speed_deg_s.joint", "'3'", "number"),
        ("simulation.steps_s", "step_s", "duration_s", "integrator"),
    ):
        assert any(names(line, *parts) for line in lines), text


def test_a_run_must_be_longer_than_its_ramps():
    """A sweep without any constant-speed part is refused with the time it needs."""
    lines = refusal(
        GOOD.replace('kind = "constant_speed"', 'kind = "sweep"').replace(
            "[trajectory.speed_deg_s]", "[trajectory.end_deg]"
        )
    )
    (line,) = lines
    assert names(line, "file.toml", "simulation.duration_s", "1 s", "2.4 s")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"simulation.duration_s": 0.0004},
         ("simulation.duration_s", "0.0004 s", "0 s")),
        ({"simulation.duration_s": 0.20045, "trajectory": {
            "kind": "step", "at_s": 0.2004, "step_deg": {"joint": 1.0}}},
         ("simulation.duration_s", "0.20045 s", "0.2 s", "0.2004 s")),
        ({"simulation.duration_s": 2.2004, "trajectory": {
            "kind": "iso9283", "cycles": 1}},
         ("simulation.duration_s", "2.2004 s", "2.2 s")),
        ({"controller.control_period_s": 1e-9},
         ("controller.control_period_s", "1e-09 s", "multiple", "step_s", "0.001 s")),
        ({"sensors.motor.delay_s": 1e-9},
         ("sensors.motor.delay_s", "1e-09 s", "multiple", "step_s", "0.001 s")),
    ],
)  # fmt: skip
def test_times_that_no_step_reaches_are_refused(changes, message):
    """A run, a period or a delay is a whole number of steps, and not zero of them."""
    with pytest.raises(InputError) as caught:
        Scene.from_toml(GOOD).with_changes(changes)
    assert names(str(caught.value), *message)
    assert len(str(caught.value).splitlines()) == 1


def test_two_drives_at_once_are_refused():
    """A named drive beside a linear one is ambiguous."""
    text = GOOD.replace("[joints.joint]", "[joints.joint]\ndrive = 'a'\nlinear = {}")
    assert any("joints.joint" in line for line in refusal(text))


def test_overrides_change_keys_and_are_checked():
    """A dotted key takes a TOML value; a wrong key is refused like one in the file."""
    scene = Scene.from_toml(GOOD)
    changed = scene.with_changes(
        ["simulation.step_s=0.0005", "defaults.drive=other.swg", "defaults.level=rigid"]
    )
    assert changed.simulation.step_s == 0.0005
    assert (changed.defaults.drive, changed.defaults.level) == ("other.swg", "rigid")
    assert scene.simulation.step_s == 0.001
    with pytest.raises(
        InputError,
        match=naming("simulation.speed", "duration_s", "integrator", "step_s"),
    ):
        scene.with_changes(["simulation.speed=1"])
    with pytest.raises(InputError, match=naming("'simulation.step_s'", "key=value")):
        parse_override("simulation.step_s")


def test_an_override_may_replace_a_named_drive_by_a_linear_one():
    """The new kind of drive takes the place of the old one, in both directions."""
    scene = Scene.from_toml(GOOD).with_changes(["defaults.linear.stiffness_Nm_rad=1e4"])
    assert scene.defaults.drive is None
    assert scene.defaults.linear.stiffness_Nm_rad == 1e4
    assert scene.with_changes({"defaults.drive": "a"}).defaults.linear is None


def test_an_override_may_replace_a_load_by_another_kind_of_load():
    """A torque for a fraction of the rated torque, and back; not both at once."""
    scene = Scene.from_toml(GOOD).with_changes(["load.joint.rated_fraction=0.5"])
    load = scene.with_changes(["load.joint.torque_Nm=20"]).load["joint"]
    assert (load.torque_Nm, load.rated_fraction) == (20.0, None)
    both = ["load.joint.torque_Nm=20", "load.joint.rated_fraction=1"]
    for changes in (both, both[::-1]):
        with pytest.raises(InputError, match=naming("torque_Nm", "rated_fraction")):
            scene.with_changes(changes)


def test_a_joint_inherits_what_it_does_not_say():
    """Own keys win over the defaults, key by key; a drive counts as one key."""
    scene = Scene.from_toml(GOOD)
    own = scene.joint_settings("joint")
    assert (own.drive, own.level, own.rotor_inertia_kgm2) == (
        "reference-2d",
        "full",
        5e-5,
    )
    linear = JointSection.model_validate({"linear": {"stiffness_Nm_rad": 1e4}})
    mixed = linear.fill_from(scene.defaults)
    assert mixed.drive is None
    assert mixed.linear.stiffness_Nm_rad == 1e4


def test_a_model_of_the_defaults_is_that_of_designs():
    """Other drives of single joints have none; without a design it is refused."""
    scene = Scene.from_toml(GOOD).with_model("ring")
    assert scene.joint_settings("joint").model == "ring"
    for drive in ("CSG-25-100", "a.swg"):
        other = scene.with_changes({"joints.joint.drive": drive})
        assert other.joint_settings("joint").model is None
    own = {"joints.joint.drive": "size-25-50", "joints.joint.model": "2d"}
    assert scene.with_changes(own).joint_settings("joint").model == "2d"
    catalogue = Scene.from_toml(GOOD).with_drive("CSG-25-100")
    with pytest.raises(InputError, match="'CSG-25-100'"):
        catalogue.with_model("ring")


def test_one_drive_or_level_for_all_joints():
    """Comparisons replace the drive and the level of every joint and nothing else."""
    scene = Scene.from_toml(
        GOOD.replace("5e-5", "5e-5\ndrive = 'own'\nlevel = 'linear'")
    )
    other = scene.with_drive("b.swg").with_level("rigid").joint_settings("joint")
    assert (other.drive, other.level) == ("b.swg", "rigid")
    assert other.rotor_inertia_kgm2 == 5e-5
    assert scene.joint_settings("joint").drive == "own"


def test_paths_in_a_file_are_relative_to_it(tmp_path):
    """A drive or arm beside the scene file is found from any folder."""
    (tmp_path / "mine.swg").write_bytes(b"")
    path = tmp_path / "scene.toml"
    path.write_text(GOOD.replace('"reference-2d"', '"mine.swg"'))
    assert Scene.load_file(path).defaults.drive == str(tmp_path / "mine.swg")


def test_bundled_scenes_load():
    """Each shipped scene is valid and says what it is."""
    for name in ("bench", "ur5e-sweep"):
        scene = Scene.load_file(name)
        assert scene.name == name
        assert scene.description


def test_a_missing_scene_names_the_bundled_ones():
    """A wrong name is one line that lists what exists."""
    with pytest.raises(
        InputError, match=naming("'ur5e-swep'", "models/scenes", "bench", "ur5e-sweep")
    ):
        Scene.load_file("ur5e-swep")
