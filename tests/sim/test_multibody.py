"""Arms with rotors against Pinocchio, and their motion against another integrator."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import pinocchio
import pytest
from scipy.integrate import solve_ivp

from swgjoint.joint.attach import attach
from swgjoint.joint.drive import JointDrive
from swgjoint.maps.drive_map import DriveMap
from swgjoint.models_path import bundled_names
from swgjoint.sim.arm.rigid_arm import RigidArm

ARMS = bundled_names("arms", ".xml")
QUICK = ("bench", "two-link")
"""Arms whose motion is compared in the first tier; matrices are, of all of them."""
INERTIA = 1e-4
STEP = 1e-5
DURATION = 0.3
"""Of the compared motion: the motors come to their targets in it [s]."""


def pinocchio_model(model: mujoco.MjModel) -> pinocchio.Model:
    """The tree of a compiled model with one hinge a body, number by number.

    Both loaders read MJCF, but MuJoCo writes it with six digits.
    """
    other = pinocchio.Model()
    other.gravity.linear = model.opt.gravity
    holder = {0: (0, pinocchio.SE3.Identity())}  # joint of a body, body in its frame
    for b in range(1, model.nbody):
        joint, place = holder[int(model.body_parentid[b])]
        place = place * pose(model.body_pos[b], model.body_quat[b])
        if model.body_jntnum[b]:
            j = int(model.body_jntadr[b])
            anchor = pinocchio.SE3(np.eye(3), model.jnt_pos[j])
            name = model.joint(j).name
            hinge = pinocchio.JointModelRevoluteUnaligned(model.jnt_axis[j])
            joint = other.addJoint(joint, hinge, place * anchor, name)
            other.armature[other.joints[joint].idx_v] = model.dof_armature[j]
            place = anchor.inverse()
        holder[b] = joint, place
        inertia = pinocchio.Inertia(
            float(model.body_mass[b]), np.zeros(3), np.diag(model.body_inertia[b])
        )
        centre = place * pose(model.body_ipos[b], model.body_iquat[b])
        other.appendBodyToJoint(joint, inertia, centre)
    return other


def pose(position: np.ndarray, quaternion: np.ndarray) -> pinocchio.SE3:
    w, x, y, z = quaternion
    return pinocchio.SE3(pinocchio.Quaternion(w, x, y, z).matrix(), position)


def velocity_index(model: pinocchio.Model, names: list[str]) -> list[int]:
    return [model.joints[model.getJointId(name)].idx_v for name in names]


def with_drives(
    arm: RigidArm, drive: DriveMap, rotor: str = "gyroscopic"
) -> tuple[mujoco.MjSpec, list[JointDrive]]:
    spec = arm.spec()
    keys = {"drive": drive, "rotor_inertia": INERTIA, "rotor": rotor}
    return spec, [attach(spec, joint=name, **keys) for name in arm.joints]


@pytest.mark.parametrize("rotor", ["none", "gyroscopic", "lumped"])
@pytest.mark.parametrize("name", ARMS)
def test_inertia_and_bias_agree_with_pinocchio(name, rotor, synthetic_map):
    """Mass matrix to 1e-10, Coriolis, gyroscopic and weight torques to 1e-9.

    Without rotors Pinocchio reads the file of the arm itself.
    """
    arm = RigidArm(name)
    if rotor == "none":
        model, drives = arm.model, []
        other = pinocchio.buildModelFromMJCF(str(arm.path))
    else:
        spec, drives = with_drives(arm, synthetic_map, rotor)
        model = spec.compile()
        other = pinocchio_model(model)
    order = velocity_index(other, [model.joint(j).name for j in range(model.njnt)])
    data, own = mujoco.MjData(model), other.createData()
    rng = np.random.default_rng(11)
    for _ in range(10):
        data.qpos, data.qvel = rng.uniform(-2.0, 2.0, (2, model.nv))
        for drive in drives:  # rotors at up to 2000 rpm
            data.joint(drive.rotor).qvel *= 100.0
        mujoco.mj_forward(model, data)
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        q, v = np.empty(model.nq), np.empty(model.nv)
        q[order], v[order] = data.qpos, data.qvel
        upper = np.triu(pinocchio.crba(other, own, q))
        both = (upper + np.triu(upper, 1).T)[np.ix_(order, order)]
        np.testing.assert_allclose(inertia, both, rtol=0.0, atol=1e-10)
        bias = pinocchio.nonLinearEffects(other, own, q, v)[order]
        np.testing.assert_allclose(data.qfrc_bias, bias, rtol=0.0, atol=1e-9)


class Law:
    """The synthetic map in closed form, all joints at once: V(x) s + c, see conftest.

    V(x) = K x²/2 + K h x⁴/(4 x0²); the sums s = 1 + ... and c = ... run over harmonics.
    """

    def __init__(self, drive: DriveMap, damping: np.ndarray) -> None:
        self.ratio, self.damping = drive.ratio, damping
        self.stiffness, self.hardening, self.x0 = 2e4, 2.0, 100.0 / 2e4
        self.n_theta, self.n_psi = drive.angle_orders[1:].T.astype(float)
        stiff = drive.potential[:, :, 0, 2] / drive.potential[0, 0, 0, 2]
        share = drive.potential[:, :, 0, 0] - stiff * drive.potential[0, 0, 0, 0]
        # rows: error, scale of the energy, energy without torsion; (harmonic, 1, 3)
        parts = np.stack([drive.kinematic_error, stiff, share])[:, 1:]
        self.cos, self.sin = parts[:, :, 0].T, parts[:, :, 1].T

    def torques(
        self, theta: np.ndarray, psi: np.ndarray, rates: tuple[np.ndarray, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """On rotors and links [N·m]."""
        phase = np.multiply.outer(theta, self.n_theta)
        phase += np.multiply.outer(psi, self.n_psi)
        cos, sin = np.cos(phase), np.sin(phase)
        e0, scale, _ = (cos @ self.cos + sin @ self.sin).T
        slope = cos[:, :, None] * self.sin - sin[:, :, None] * self.cos
        by_theta = np.einsum("jkp,k->pj", slope, self.n_theta)
        by_psi = np.einsum("jkp,k->pj", slope, self.n_psi)
        x = theta / self.ratio + e0 - psi
        assert np.abs(x).max() < self.x0  # the map continues linearly beyond
        bent = self.hardening * (x / self.x0) ** 2
        torque = self.stiffness * x * (1.0 + bent) * (1.0 + scale)
        energy = 0.5 * self.stiffness * x**2 * (1.0 + 0.5 * bent)
        g_theta, g_psi = 1.0 / self.ratio + by_theta[0], -1.0 + by_psi[0]
        torque = torque + self.damping * (g_theta * rates[0] + g_psi * rates[1])
        return (
            -torque * g_theta - energy * by_theta[1] - by_theta[2],
            -torque * g_psi - energy * by_psi[1] - by_psi[2],
        )


def servo(spec: mujoco.MjSpec, arm: RigidArm, drives: list[JointDrive], q: np.ndarray):
    """A soft position loop on every motor, 2 Hz; gains [N·m/rad], [N·m·s/rad]."""
    ratio = np.array([drive.ratio for drive in drives])
    inertia = INERTIA + arm.inertia(q) / ratio**2
    omega = 2.0 * np.pi * 2.0
    stiffness, damping = inertia * omega**2, 1.4 * inertia * omega
    for drive, kp, kd in zip(drives, stiffness, damping, strict=True):
        motor = spec.add_actuator(name=f"{drive.joint}_motor", target=drive.rotor)
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        motor.gainprm[0], motor.biastype = 1.0, mujoco.mjtBias.mjBIAS_AFFINE
        motor.biasprm[:3] = 0.0, -kp, -kd
    return stiffness, damping


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=[] if n in QUICK else pytest.mark.slow)
        for n in ARMS
        if n != "iiwa14"  # the axes of the iiwa7
    ],
)
def test_motion_agrees_with_an_independent_integration(name, synthetic_map):
    """RK4 at 10 µs and DOP853 with Pinocchio end within 1e-6 rad at the links.

    Level full with hardening, kinematic error and ripple up to order 122, damped,
    rotors that their links carry along, all joints moved by 0.2 rad.
    """
    arm = RigidArm(name)
    start = np.clip(np.full(len(arm.joints), 0.4), *usable(arm))
    spec, drives = with_drives(arm, synthetic_map)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.timestep = STEP
    stiffness, damping = servo(spec, arm, drives, start)
    model = spec.compile()
    rotors = np.array([model.joint(d.rotor).dofadr[0] for d in drives])
    links = np.array([model.joint(d.joint).dofadr[0] for d in drives])
    ratio, weight = drives[0].ratio, arm.gravity(start[None])[0]

    data = mujoco.MjData(model)
    law = Law(synthetic_map, np.array([drive.damping for drive in drives]))
    data.qpos[rotors] = ratio * start
    data.qpos[links] = start - weight / law.stiffness  # about what gravity asks for
    data.ctrl = stiffness * ratio * (start + 0.2) + weight / ratio
    here = data.qpos[rotors], data.qpos[links]
    np.testing.assert_allclose(  # the closed form is that of the map
        law.torques(*here, (np.zeros(len(links)),) * 2),
        synthetic_map.forces(*here),
        rtol=1e-9,
        atol=1e-9,
    )

    other = pinocchio_model(model)
    assert velocity_index(
        other, [model.joint(j).name for j in range(model.njnt)]
    ) == list(range(model.nv))
    rate = motion(other, law, rotors, links, (data.ctrl.copy(), stiffness, damping))
    begin = np.concatenate([data.qpos, data.qvel])
    found = solve_ivp(
        rate, (0.0, DURATION), begin, method="DOP853", rtol=1e-9, atol=1e-9,
        t_eval=np.linspace(0.0, DURATION, 5)[1:],
    )  # fmt: skip
    assert found.success
    moved = 0.0
    for end in found.y.T:
        mujoco.mj_step(model, data, nstep=round(0.25 * DURATION / STEP))
        off = data.qpos - end[: model.nv]
        assert np.abs(off[links]).max() < 1e-6
        assert np.abs(off[rotors] / ratio).max() < 1e-6
        moved = max(moved, np.abs(data.qpos[links] - start).min())
    assert moved > 0.1


def usable(arm: RigidArm) -> tuple[np.ndarray, np.ndarray]:
    """Starts from which the motion stays inside the limits of the joints."""
    low, high = arm.model.jnt_range.T.copy()
    free = ~arm.model.jnt_limited.astype(bool)
    low[free], high[free] = -10.0, 10.0
    return low + 0.1, high - 0.6


def motion(
    other: pinocchio.Model,
    law: Law,
    rotors: np.ndarray,
    links: np.ndarray,
    control: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> Callable[[float, np.ndarray], np.ndarray]:
    """Rates of positions and velocities."""
    own, (inputs, stiffness, damping) = other.createData(), control
    torque = np.zeros(other.nv)

    def rate(_: float, state: np.ndarray) -> np.ndarray:
        q, v = state[: other.nv], state[other.nv :]
        turning = v[rotors], v[links]
        on_rotors, on_links = law.torques(q[rotors], q[links], turning)
        torque[links] = on_links
        torque[rotors] = on_rotors + inputs - stiffness * q[rotors]
        torque[rotors] -= damping * turning[0]
        return np.concatenate([v, pinocchio.aba(other, own, q, v, torque)])

    return rate
