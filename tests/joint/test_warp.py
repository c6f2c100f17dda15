"""Drives in MuJoCo Warp: the law of the plugin, on the CPU device, in many worlds.

Not among the packages of the extra ``test`` (warp-lang alone is a wheel of 150 MB).
"""

from __future__ import annotations

import textwrap
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from messages import naming

import swgjoint
from swgjoint.errors import InputError
from swgjoint.joint.attach import attach
from swgjoint.joint.reference import TwinMotion, scheme_force
from swgjoint.joint.step_damping import damp_as_asked
from swgjoint.joint.variation import Variation
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import Jenkin

mjw = pytest.importorskip(
    "mujoco_warp", reason="not installed; to run this: pip install 'swgjoint[warp]'"
)
wp = pytest.importorskip("warp")
warp = pytest.importorskip("swgjoint.joint.warp")

ELEMENTS = (
    Jenkin(stiffness=1e4, yield_torque=3.0),
    Jenkin(stiffness=3e3, yield_torque=6.0),
)
LOADED = (
    *ELEMENTS,
    Jenkin(stiffness=5e4, yield_torque=0.0, yield_curve=((8.0, 2.0), (40.0, 0.5))),
)
PAIR = """
<mujoco>
  <option timestep="1e-3" integrator="discrete" gravity="0 0 0"/>
  <worldbody>
    <body pos="0 0 .5">
      <joint name="j" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="3" diaginertia=".4 .4 .4"/>
    </body>
  </worldbody>
</mujoco>
"""
ARM = """
<mujoco>
  <option timestep="1e-3" integrator="discrete"/>
  <worldbody>
    <body>
      <joint name="a" axis="0 1 0" damping="1"/>
      <inertial pos="0 0 .3" mass="6" diaginertia=".2 .2 .02"/>
      <body pos="0 0 .6">
        <joint name="b" axis="0 1 0" damping="1"/>
        <inertial pos="0 0 .2" mass="3" diaginertia=".06 .06 .01"/>
        <body pos="0 0 .4">
          <joint name="c" axis="1 0 0" damping=".1"/>
          <inertial pos="0 .1 .05" mass="1" diaginertia=".004 .003 .003"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


class Both:
    """The same model in MuJoCo with the plugin and in MuJoCo Warp without it."""

    def __init__(self, xml, drive, joints=("j",), worlds=1, **keys):
        spec = mujoco.MjSpec.from_string(xml)
        keys = {"rotor_inertia": 4e-5, "damping_ratio": 0.02, "friction": True} | keys
        self.drives = [attach(spec, joint=j, drive=drive, **keys) for j in joints]
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.plain = warp.without_plugin(spec)
        with wp.ScopedDevice("cpu"):
            self.m = mjw.put_model(self.plain)
            self.d = mjw.make_data(self.plain, nworld=worlds)
        self.call = warp.install(self.m, self.d, self.plain, self.drives)

    def put(self, qpos, qvel, force=0.0):
        """Set every world to a state in single precision, and MuJoCo to the first."""
        shape = (self.d.nworld, -1)
        for name, values in (
            ("qpos", qpos),
            ("qvel", qvel),
            ("qfrc_applied", force + np.zeros(self.model.nv)),
        ):
            values = np.atleast_2d(np.asarray(values, np.float32))
            rows = np.broadcast_to(values, (self.d.nworld, values.shape[1]))
            getattr(self.d, name).assign(rows.reshape(shape))
            getattr(self.data, name)[:] = values[0]

    def pair(self, drive):
        """Addresses of rotor and link."""
        joints = [self.model.joint(name) for name in (drive.rotor, drive.joint)]
        return [int(j.dofadr[0]) for j in joints]


@pytest.fixture(params=["conservative", "slipping", "loaded", "rubbing"])
def drive(request, synthetic_map: DriveMap, friction_law) -> DriveMap:
    """The synthetic map with side bands, without and with losses, in two layouts."""
    if request.param == "conservative":
        return synthetic_map
    elements = LOADED if request.param == "loaded" else ELEMENTS
    ring = replace(synthetic_map, layout="flexspline_fixed", hysteresis=elements)
    return replace(ring, friction=friction_law) if request.param == "rubbing" else ring


def test_force_direction_and_stiffness_equal_reference(drive):
    """In 64 random worlds the callback hands over what the law in numpy says.

    The states are made by two steps under random forces, so that the memory of the
    scheme counts. Forces are handed over in single precision: 1e-6 of the largest.
    """
    both = Both(PAIR, drive, worlds=64)
    rng = np.random.default_rng(3)
    one, ((q, v),) = both.drives[0], [(both.pair(both.drives[0]),) * 2]
    psi = rng.uniform(-0.3, 0.3, 64)
    reach = 1.3 * drive.torsion_knots[-1]
    theta = drive.ratio * (psi + rng.uniform(-reach, reach, 64))
    both.put(
        np.stack([theta, psi], -1)[:, np.argsort(q)],
        rng.normal(0, [30.0, 0.5], (64, 2))[:, np.argsort(v)],
        rng.normal(0, [1.0, 40.0], (64, 2))[:, np.argsort(v)],
    )
    for _ in range(2):
        mjw.step(both.m, both.d)
    mjw.forward(both.m, both.d)

    d, h = both.d, float(both.m.opt.timestep.numpy()[0])
    steps, rest = both.call.steps.numpy(), both.call.rest.numpy()
    count = len(drive.hysteresis)
    tendon = both.plain.tendon(one.tendon).id
    largest = max(abs(t) for t in drive.torque_range)
    knots, crossed, slips = drive.torsion_knots, 0, 0
    friction = both.plain.tendon("j_friction").id if drive.friction else -1
    for world in range(64):
        (theta, psi), (dtheta, dpsi) = (
            d.qpos.numpy()[world][q].astype(float),
            d.qvel.numpy()[world][v].astype(float),
        )
        limits = rest[world][count:]
        want = scheme_force(
            drive,
            TwinMotion(
                theta=theta,
                psi=psi,
                theta_rate=dtheta,
                psi_rate=dpsi,
                rotor_weight=1 / 4e-5,
                link_weight=1 / 0.4,
                rotor_acceleration=steps[world, 0]["a_rotor"],
                link_acceleration=steps[world, 0]["a_link"],
                rest=tuple(rest[world][:count]),
                limit=tuple(np.where(limits > 0, limits, np.inf)),
                relaxed=steps[world, 0]["relaxed"] if drive.friction else None,
            ),
            timestep=h,
            damping=one.damping,
        )
        g = np.array([want.g_theta, want.g_psi])
        length = float(d.ten_length.numpy()[world, tendon])
        assert 1e-9 + 3 * length**2 == pytest.approx(want.metric, rel=1e-6)
        entries = [both.call.drives.numpy()[0][f"entry_{k}"] for k in ("rotor", "link")]
        np.testing.assert_allclose(d.ten_J.numpy()[world][entries], g, rtol=1e-6)
        shift = h * want.metric * float(d.ten_velocity.numpy()[world, tendon]) * g
        if drive.friction:
            b, rub = np.array(drive.friction_direction), want.friction
            speed = float(d.ten_velocity.numpy()[world, friction])
            shift = shift + h * rub.metric * speed * b
            length = float(d.ten_length.numpy()[world, friction])
            assert 1e-9 + 3e-19 * length**2 == pytest.approx(rub.metric, rel=1e-6)
            slips += int(abs(rub.stretch) > 0.99 * rub.reach)
        np.testing.assert_allclose(
            d.qfrc_passive.numpy()[world][v] * [abs(drive.ratio), 1],
            (np.array([want.theta, want.psi]) + shift) * [abs(drive.ratio), 1],
            rtol=0,
            atol=1e-6 * (largest + np.abs(shift[1])),
        )
        begin = drive.torsion(theta - h * dtheta / 2, psi - h * dpsi / 2)
        end = drive.torsion(theta + h * dtheta / 2, psi + h * dpsi / 2)
        crossed += int(np.digitize(begin, knots) != np.digitize(end, knots))
    assert crossed > 5  # also pieces of several polynomials
    assert 5 < slips < 64 or not drive.friction


def test_contact_damping_acts_in_the_worlds_that_touch(synthetic_map):
    """Of two worlds without losses only the one beyond its joint limit is damped."""
    limited = 'axis="0 0 1" limited="true" range="-10 10"/>'
    xml = PAIR.replace('axis="0 0 1"/>', limited)
    both = Both(xml, synthetic_map, worlds=2, damping_ratio=0.0)
    [one], ratio = both.drives, synthetic_map.ratio
    pair = both.pair(one)
    order = np.argsort(pair)
    psi = np.array([0.2, 0.1])
    both.put(np.stack([ratio * psi, psi], -1)[:, order], np.array([3.0, 0.2])[order])
    mjw.forward(both.m, both.d)
    h = float(both.m.opt.timestep.numpy()[0])
    tendon = both.plain.tendon(one.tendon).id
    for world, damping in enumerate((one.contact_damping, 0.0)):
        theta, psi = both.d.qpos.numpy()[world][pair].astype(float)
        rates = both.d.qvel.numpy()[world][pair].astype(float)
        want = scheme_force(
            synthetic_map,
            TwinMotion(
                theta=theta,
                psi=psi,
                theta_rate=rates[0],
                psi_rate=rates[1],
                rotor_weight=1 / 4e-5,
                link_weight=1 / 0.4,
            ),
            timestep=h,
            damping=damping,
        )
        length = float(both.d.ten_length.numpy()[world, tendon])
        assert 1e-9 + 3 * length**2 == pytest.approx(want.metric, rel=1e-6)


def test_pair_moves_as_with_the_plugin(drive):
    """250 loaded steps of a pair equal MuJoCo with the plugin.

    The torsion swings by 2e-3 rad. Single precision rounds the angle of the rotor by
    2e-7 rad and more, and the difference of the two swings grows with time: 2.5e-7 rad
    at the end, 8e-7 after twice as many steps.
    """
    both = Both(PAIR, drive)
    order = np.argsort(both.pair(both.drives[0]))
    speed = 20.0
    both.put(
        np.array([0.0, 0.0])[order],
        np.array([speed, speed / drive.ratio])[order],
        np.array([-40.0 / drive.ratio, 24.0])[order],
    )
    torsion = []
    for _ in range(250):
        mujoco.mj_step(both.model, both.data)
        mjw.step(both.m, both.d)
        states = both.data.qpos[order], both.d.qpos.numpy()[0][order]
        torsion.append([float(drive.torsion(*q)) for q in states])
    torsion = np.array(torsion)
    assert np.ptp(torsion[:, 0]) > 1e-3
    np.testing.assert_allclose(torsion[:, 1], torsion[:, 0], rtol=0, atol=1e-6)


def test_arm_moves_as_with_the_plugin(drive):
    """Three driven joints of a falling arm, 150 steps, equal MuJoCo with the plugin.

    4e-7 rad apart where the links have moved by up to 1.3 rad; 3e-6 with friction, for
    round-off decides in which step a bristle begins to slip.
    """
    both = Both(ARM, drive, joints=("a", "b", "c"))
    mujoco.mj_forward(both.model, both.data)
    start = np.zeros(both.model.nq)
    both.put(start, np.zeros(both.model.nv), 0.1 * np.arange(both.model.nv))
    for _ in range(150):
        mujoco.mj_step(both.model, both.data)
        mjw.step(both.m, both.d)
    links = [both.pair(one)[1] for one in both.drives]
    want, got = both.data.qpos[links], both.d.qpos.numpy()[0][links]
    assert np.abs(want).max() > 0.05
    near = 1e-5 if drive.friction else 2e-6
    np.testing.assert_allclose(got, want, rtol=0, atol=near)


def test_responses_are_those_of_the_engine(drive):
    """The weights of the prediction are the diagonal of MuJoCo's inverse of M."""
    both = Both(ARM, drive, joints=("a", "b", "c"))
    qpos = np.random.default_rng(1).uniform(-1, 1, both.model.nq)
    both.put(qpos, np.zeros(both.model.nv))
    mujoco.mj_forward(both.model, both.data)
    mjw.forward(both.m, both.d)
    for k, one in enumerate(both.drives):
        step = both.call.steps.numpy()[0, k]
        pair = both.pair(one)
        units = np.eye(both.model.nv)[pair]
        inverse = np.zeros_like(units)
        mujoco.mj_solveM(both.model, both.data, inverse, units)
        want = [row[dof] for row, dof in zip(inverse, pair, strict=True)]
        # products of single precision
        assert [step["w_rotor"], step["w_link"]] == pytest.approx(want, rel=1e-5)


def test_repeated_forward_changes_nothing_and_reset_forgets(drive):
    """``forward`` between steps leaves the memory alone; a reset empties it."""
    ends = []
    both = Both(PAIR, drive)
    for extra in (0, 2):
        mjw.reset_data(both.m, both.d)
        both.put([0.0, 0.0], [5.0, 0.1], [0.5, -20.0])
        for _ in range(20):
            for _ in range(extra):
                mjw.forward(both.m, both.d)
            mjw.step(both.m, both.d)
        ends.append(both.d.qpos.numpy().copy())
    np.testing.assert_array_equal(ends[0], ends[1])


def test_energy_is_kept(synthetic_map):
    """Without damping the scheme neither makes nor takes energy in 300 steps.

    Harmonics that the step carries, h w = 0.25: both lose 0.06 %.
    """
    drive = synthetic_map.with_harmonics(synthetic_map.orders[:, 0] < 100)
    both = Both(PAIR.replace("1e-3", "5e-4"), drive, damping_ratio=0.0)
    order = np.argsort(both.pair(both.drives[0]))

    def energies():
        states = [(both.data.qpos, both.data.qvel)]
        states += [(both.d.qpos.numpy()[0], both.d.qvel.numpy()[0])]
        for q, v in states:
            v = v[order].astype(float)
            x = q[order] - 0.5 * both.model.opt.timestep * v
            potential = drive.energy(drive.torsion(*x), *x)
            yield float(0.5 * np.array([4e-5, 0.4]) @ v**2 + potential)

    both.put(np.array([0.1, 0.0])[order], np.zeros(2))
    found = []
    for _ in range(301):
        mujoco.mj_step(both.model, both.data)
        mjw.step(both.m, both.d)
        found.append(list(energies()))
    assert found[-1] == pytest.approx(found[0], rel=2e-3)


def test_what_is_not_held_is_refused(synthetic_map):
    """Other integrators and a second callback raise one line each."""
    with pytest.raises(InputError, match=naming("integrator", "rk4", "discrete")):
        Both(PAIR.replace("discrete", "RK4"), synthetic_map)
    both = Both(PAIR, synthetic_map)
    with pytest.raises(
        InputError, match=naming("MuJoCo Warp", "passive callback", "none")
    ):
        warp.install(both.m, both.d, both.plain, both.drives)


def test_every_world_has_its_own_specimen(drive):
    """Worlds with deviations move as worlds with the maps that the deviations give.

    Both in double precision from the same single-precision state: the rounding of sums
    in another order is all that may differ. The plugin's specimen stands beside them.
    """
    rng = np.random.default_rng(8)
    rows = [
        Variation(stiffness=s, kinematic_error=e, theta=a, psi=b, losses=f)
        for s, e, a, b, f in rng.uniform(-0.4, 0.4, (3, 5))
    ]
    both = Both(PAIR, drive, worlds=3, variable=True, damping_ratio=0.0)
    both.call.specimens.assign([[row.numbers] for row in rows])
    tendon = both.model.tendon(both.drives[0].tendon).id
    both.model.tendon_user[tendon][:5] = rows[0].numbers
    order = np.argsort(both.pair(both.drives[0]))
    start = np.zeros(2), np.array([20.0, 0.0])[order], np.array([0.0, 24.0])[order]
    both.put(*start)
    alone = [Both(PAIR, row.apply_to(drive), damping_ratio=0.0) for row in rows]
    for one in alone:
        one.put(*start)
    for _ in range(60):
        mujoco.mj_step(both.model, both.data)
        mjw.step(both.m, both.d)
        for one in alone:
            mjw.step(one.m, one.d)
    ends = both.d.qpos.numpy()
    want = np.concatenate([one.d.qpos.numpy() for one in alone])
    assert np.ptp(ends, axis=0).min() > 3e-5  # the worlds differ
    np.testing.assert_allclose(ends, want, rtol=0, atol=1e-6)
    # rounding of the states to single precision: at most 7 units in the last place over
    # 32 starts, a drive without losses included
    last = float(np.spacing(np.abs(ends[0]).max()))
    np.testing.assert_allclose(ends[0], both.data.qpos, rtol=0, atol=10.0 * last)


def test_deviations_in_the_model_hold_in_every_world(synthetic_map):
    """A specimen written into the compiled model is that of all worlds at first."""
    spec = mujoco.MjSpec.from_string(PAIR)
    one = attach(
        spec, joint="j", drive=synthetic_map, rotor_inertia=4e-5, variable=True
    )
    plain = warp.without_plugin(spec)
    plain.tendon_user[plain.tendon(one.tendon).id][:5] = (0.1, -0.2, 0.3, 0.4, -0.5)
    with wp.ScopedDevice("cpu"):
        m, d = mjw.put_model(plain), mjw.make_data(plain, nworld=2)
    call = warp.install(m, d, plain, [one])
    np.testing.assert_array_equal(
        call.specimens.numpy(), [[(0.1, -0.2, 0.3, 0.4, -0.5)]] * 2
    )


def test_torsion_and_torque_of_a_step_are_on_the_device(drive):
    """Torsion is that of the map, torque accelerates the link together with the load.

    The link's acceleration is a difference of single-precision speeds: 0.4 kg·m² times
    their resolution of 1e-8 rad/s over a step of 1 ms are 5e-6 N·m, and 2e-5 rad·K.
    """
    both = Both(PAIR, drive, worlds=2)
    pair = both.pair(both.drives[0])
    order, load = np.argsort(pair), 24.0
    both.put(np.zeros(2), np.array([20.0, 0.1])[order], np.array([0.0, load])[order])
    speeds, torque = [], []
    for _ in range(40):
        positions = both.d.qpos.numpy()[0][pair].astype(float)
        speeds.append(both.d.qvel.numpy()[0][pair[1]])
        mjw.step(both.m, both.d)
        torque.append(both.call.torque.numpy()[0, 0])
    assert both.call.torsion.numpy()[0, 0] == pytest.approx(
        drive.torsion(*positions), rel=1e-6, abs=1e-9
    )
    rates = np.diff(np.array(speeds, float)) / 1e-3
    assert torque[0] == 0.0
    np.testing.assert_allclose(torque[1:], 0.4 * rates - load, rtol=0, atol=1e-3)
    assert np.ptp(torque) > 5.0
    mjw.reset_data(both.m, both.d)
    mjw.forward(both.m, both.d)
    assert not both.call.torque.numpy().any()


def test_the_example_of_the_module_runs():
    """From a spec to a step and to specimens, as its docstring shows them."""
    lines = (warp.__doc__ or "").splitlines()
    code = textwrap.dedent("\n".join(line for line in lines if line.startswith("    ")))
    names = {"spec": mujoco.MjSpec.from_string(PAIR), "drive_map": DriveMap.linear(2e4)}
    names |= {"swgjoint": swgjoint, "mjw": mjw}
    names |= {name: getattr(warp, name) for name in ("without_plugin", "install")}
    names["variations"] = [Variation(stiffness=0.1), Variation()]
    with wp.ScopedDevice("cpu"):
        exec(code.replace("4096", "2"), names)
    assert names["d"].time.numpy() == pytest.approx(2 * [1e-3])


@pytest.mark.parametrize("taken_out", [False, True])
def test_native_corners_and_damper_move_as_in_mujoco(taken_out):
    """Dead bands and the compensating damper are in MuJoCo Warp what they are here."""
    drive = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0.0)
    spec = mujoco.MjSpec.from_string(PAIR)
    got = {
        "j": attach(spec, joint="j", drive=drive, level="native", rotor_inertia=4e-5)
    }
    if taken_out:
        got = damp_as_asked(spec, got)
    one, model = got["j"], spec.compile()
    data = mujoco.MjData(model)
    with wp.ScopedDevice("cpu"):
        m, d = mjw.put_model(model), mjw.make_data(model, nworld=1)
    q = [int(model.joint(name).qposadr[0]) for name in (one.rotor, "j")]
    data.qpos[q] = 0.0, -3e-3  # beyond both corners
    d.qpos.assign(np.float32(data.qpos)[None])
    twist = np.array([1.0 / one.ratio, -1.0])
    here, there = [], []
    for _ in range(100):
        mujoco.mj_step(model, data)
        mjw.step(m, d)
        here.append(data.qpos[q] @ twist)
        there.append(d.qpos.numpy()[0][q].astype(float) @ twist)
    assert np.ptp(here) > 3e-3
    np.testing.assert_allclose(here, there, atol=1e-8)
