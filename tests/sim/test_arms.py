"""The bundled arms against their sources."""

import numpy as np
import pytest
from messages import naming

from swgjoint.errors import InputError
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

UR5E = RigidArm("ur5e")


def test_the_ur5e_has_the_inertia_of_its_source():
    """Masses of the six links as in the source; shapes carry none."""
    masses = [3.7, 8.393, 2.275, 1.219, 1.219, 0.1889]
    np.testing.assert_allclose(UR5E.model.body_mass[2:], masses)
    assert UR5E.model.body_mass[:2].sum() == 0.0
    # principal inertias of a rigid body obey the triangle inequality
    inertia = np.sort(UR5E.model.body_inertia[2:], axis=1)
    assert (inertia[:, 0] + inertia[:, 1] >= inertia[:, 2]).all()


def test_the_ur5e_reaches_as_far_as_its_links():
    """Stretched out, the tool lies at the sum of the link lengths of the source."""
    tool = UR5E.tool_positions(np.zeros((1, 6)))[0]
    # x: upper arm, forearm; y: the offsets; z: base height less wrist 2
    expected = [0.425 + 0.392, 0.138 - 0.131 + 0.127 + 0.098, 0.163 - 0.1]
    np.testing.assert_allclose(tool, expected, atol=1e-6)  # rounded quaternions


def test_weight_of_the_stretched_arm_by_hand():
    """Shoulder and elbow carry the link masses times their horizontal distances."""
    torque = UR5E.gravity(np.zeros((1, 6)))[0]
    g, wrist = 9.81, 2 * 1.219 + 0.1889
    elbow = 2.275 * 0.196 + wrist * 0.392
    shoulder = 8.393 * 0.2125 + 2.275 * 0.425 + wrist * 0.425 + elbow
    np.testing.assert_allclose(torque[1:3], [-g * shoulder, -g * elbow], rtol=1e-5)
    assert abs(torque[0]) < 1e-9


def test_inverse_dynamics_is_linear_in_the_acceleration():
    """The torque of an acceleration is the inertia times it, joint by joint."""
    q = np.array([[0.1, -1.7, 1.6, -1.3, -1.5, 0.2]])
    zero = np.zeros_like(q)
    for j in range(6):
        push = zero.copy()
        push[0, j] = 1.0
        gained = UR5E.torques(q, zero, push) - UR5E.gravity(q)
        assert gained[0, j] == pytest.approx(UR5E.inertia(q[0])[j], rel=1e-9)


def test_an_arm_with_another_kind_of_joint_is_refused(tmp_path):
    """A slide alone is named with its type; broken XML is one line."""
    arm = tmp_path / "arm.xml"
    arm.write_text(
        "<mujoco><worldbody><body><joint name='lift' type='slide'/>"
        "<geom size='1'/></body></worldbody></mujoco>"
    )
    with pytest.raises(InputError, match=naming("arm.xml", "hinge", "lift", "slide")):
        RigidArm(str(arm))
    arm.write_text("<mujoco><worldbody>")
    with pytest.raises(
        InputError, match=naming("arm.xml", "MJCF", "URDF", "XML")
    ) as caught:
        RigidArm(str(arm))
    assert "\n" not in str(caught.value)


def test_the_iiwa_has_the_mass_and_height_of_its_source():
    """Seven links of the source's masses; upright, the flange is 1.265 m high."""
    arm = RigidArm("iiwa7")
    masses = [3.4525, 3.4821, 4.05623, 3.4822, 2.1633, 2.3466, 3.129]
    np.testing.assert_allclose(arm.model.body_mass[2:], masses)
    assert arm.model.body_mass[:2].sum() == 0.0
    assert len(arm.joints) == 7
    tool = arm.tool_positions(np.zeros((1, 7)))[0]
    # 0.34 m shoulder, 0.4 m upper arm, 0.4 m forearm, 0.125 m wrist to flange
    height = (0.15 + 0.19) + 2 * (0.21 + 0.19) + 0.081 + 0.044
    np.testing.assert_allclose(tool, [0.0, 0.0, height], atol=1e-5)
    # upright it carries no weight but what lies beside the axes
    assert np.abs(arm.gravity(np.zeros((1, 7)))).max() < 9.81 * 22 * 0.06


PI = np.pi
MAKERS = {
    # name: mass of the fixed base and of the arm in the maker's data sheet [kg], and
    # Denavit-Hartenberg rows (a, alpha, d, offset), turning before or after the shift
    "iiwa14": (
        5.0,
        29.9,
        "after",
        [
            (0, -PI / 2, 0.36, 0),
            (0, PI / 2, 0, 0),
            (0, PI / 2, 0.42, 0),
            (0, -PI / 2, 0, 0),
            (0, -PI / 2, 0.4, 0),
            (0, PI / 2, 0, 0),
            (0, 0, 0.126, 0),
        ],
    ),
    "kinova": (
        1.697,
        8.2,
        "after",
        [
            (0, PI / 2, -(0.1564 + 0.1284), 0),
            (0, PI / 2, -(0.0054 + 0.0064), PI),
            (0, PI / 2, -(0.2104 + 0.2104), PI),
            (0, PI / 2, -(0.0064 + 0.0064), PI),
            (0, PI / 2, -(0.2084 + 0.1059), PI),
            (0, PI / 2, 0, PI),
            (0, PI, -(0.1059 + 0.0615), PI),
        ],
    ),
    "panda": (
        0.63,
        18.0,
        "before",
        [
            (0, 0, 0.333, 0),
            (0, -PI / 2, 0, 0),
            (0, PI / 2, 0.316, 0),
            (0.0825, PI / 2, 0, 0),
            (-0.0825, -PI / 2, 0.384, 0),
            (0, PI / 2, 0, 0),
            (0.088, PI / 2, 0.107, 0),
        ],
    ),
}


def denavit_hartenberg(rows, order, q):
    """Place of the flange [m]."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0]) if rows[0][2] < 0 else np.eye(4)
    for (a, alpha, d, offset), angle in zip(rows, q, strict=True):
        ca, sa = np.cos(alpha), np.sin(alpha)
        c, s = np.cos(angle + offset), np.sin(angle + offset)
        x = np.array([[1, 0, 0, a], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]])
        z = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, d], [0, 0, 0, 1]])
        pose = pose @ (x @ z if order == "before" else z @ x)
    return pose[:3, 3]


@pytest.mark.parametrize("name", MAKERS)
def test_an_arm_moves_as_its_makers_table_says(name):
    """In random poses the tool lies where the Denavit-Hartenberg table puts it."""
    _, _, order, rows = MAKERS[name]
    poses = np.random.default_rng(3).uniform(-2.0, 2.0, (5, 7))
    tool = RigidArm(name).tool_positions(poses)
    expected = [denavit_hartenberg(rows, order, q) for q in poses]
    # the table of the Gen3 is rounded to 0.1 mm
    np.testing.assert_allclose(tool, expected, atol=3e-4 if name == "kinova" else 1e-6)


@pytest.mark.parametrize("name", MAKERS)
def test_an_arm_weighs_what_its_maker_says(name):
    """Base and links within 8 % of the data sheet; every inertia is that of a body."""
    base, stated, _, _ = MAKERS[name]
    model = RigidArm(name).model
    assert len(model.jnt_type) == 7
    assert base + model.body_mass.sum() == pytest.approx(stated, rel=0.08)
    inertia = np.sort(model.body_inertia[2:], axis=1)
    assert (inertia[:, 0] > 0.0).all()
    assert (inertia[:, 0] + inertia[:, 1] >= inertia[:, 2]).all()


@pytest.mark.parametrize(
    "name", ["ur5e-catalogue", "iiwa14-sweep", "kinova-sweep", "panda-sweep"]
)
def test_an_arm_with_catalogue_drives_carries_its_weight(name):
    """Every drive transmits what the rigid arm needs, within its ratings, uncut."""
    scene = Scene.load_file(name, {"simulation.duration_s": 2.0})
    # an error of the drives swings the arm, by more than this tolerance
    run = run_scene(scene.with_friction(False).with_kinematic_error(0.0))
    assert run.assembly.sub_steps == 1
    needed = run.assembly.link_torque[run.steady]
    rated = [t.drive.ratings.rated_torque for t in run.assembly.transmissions]
    # vibration after the ramp is what differs
    assert (
        np.abs(run.output_torque[run.steady] - needed) < 0.02 * np.array(rated)
    ).all()
    for joint in run.metrics()["joints"].values():
        assert joint["ratings"]["within"]


def tube(length, outer, inner):
    """Mass [kg], inertia about its centre along x, y, z [kg·m²], centre on x [m]."""
    mass = 2700.0 * PI * (outer**2 - inner**2) * length
    across = mass * (3 * (outer**2 + inner**2) + length**2) / 12
    return mass, np.array([mass * (outer**2 + inner**2) / 2, across, across])


def disc(mass, radius, width, axis):
    """The same of a disc whose axis is x or y."""
    inertia = np.full(3, mass * (3 * radius**2 + width**2) / 12)
    inertia[axis] = mass * radius**2 / 2
    return mass, inertia


def together(length, first, second):
    """Mass, centre and inertia of a tube and a disc at its end."""
    mass = first[0] + second[0]
    centre = (first[0] * length / 2 + second[0] * length) / mass
    inertia = first[1] + second[1]
    for part, place in ((first, length / 2), (second, length)):
        inertia = inertia + part[0] * (place - centre) ** 2 * np.array([0, 1, 1])
    return mass, centre, inertia


LINKS = (
    together(0.4, tube(0.4, 0.03, 0.027), disc(1.5, 0.04, 0.08, axis=1)),
    together(0.35, tube(0.35, 0.025, 0.022), disc(0.2, 0.03, 0.02, axis=0)),
)


def test_the_two_link_arm_has_the_inertia_of_its_tubes_and_discs():
    """The numbers of the file follow from the sizes that it states."""
    model = RigidArm("two-link").model
    for name, (mass, centre, inertia) in zip(
        ("upper_arm", "forearm"), LINKS, strict=True
    ):
        body = model.body(name)
        assert body.mass[0] == pytest.approx(mass, rel=1e-9)
        np.testing.assert_allclose(body.ipos, [centre, 0, 0], rtol=1e-9)
        # the engine sorts principal axes
        np.testing.assert_allclose(np.sort(body.inertia), np.sort(inertia), rtol=1e-7)


def test_the_two_link_arm_obeys_the_textbook_equations():
    """Inertia, Coriolis and weight of two links in a vertical plane, in closed form."""
    (m1, c1, i1), (m2, c2, i2) = LINKS
    a, g = 0.4, 9.81
    q, v, acc = np.random.default_rng(9).uniform(-2.0, 2.0, (3, 20, 2))
    cosine, sine = np.cos(q[:, 1]), np.sin(q[:, 1])
    k = m2 * a * c2
    own = i2[1] + m2 * c2**2
    both = own + k * cosine
    whole = i1[1] + m1 * c1**2 + m2 * a**2 + own + 2 * k * cosine
    # positive angles lower the arm: weight pushes that way
    reach = np.cos(q[:, 0] + q[:, 1])
    weight2 = -m2 * g * c2 * reach
    weight1 = weight2 - (m1 * c1 + m2 * a) * g * np.cos(q[:, 0])
    expected = [
        whole * acc[:, 0]
        + both * acc[:, 1]
        - k * sine * (2 * v[:, 0] * v[:, 1] + v[:, 1] ** 2)
        + weight1,
        both * acc[:, 0] + own * acc[:, 1] + k * sine * v[:, 0] ** 2 + weight2,
    ]
    got = RigidArm("two-link").torques(q, v, acc)
    np.testing.assert_allclose(got, np.transpose(expected), atol=1e-6)
