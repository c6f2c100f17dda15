"""The engine plugin ``swgjoint.drive``: its library, attributes and self-test.

``swgjoint/plugin/README.md`` states the command that builds the library in place.
"""

from __future__ import annotations

from base64 import b64encode
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from swgjoint.engine import MUJOCO_VERSION as MUJOCO_VERSION
from swgjoint.engine import NAME as NAME
from swgjoint.engine import library as library
from swgjoint.errors import ComputationError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction import Friction
from swgjoint.maps.hysteresis import vary_with_load, yield_table
from swgjoint.maps.phase_bounds import MANY

if TYPE_CHECKING:
    from swgjoint.joint.drive import JointDrive

NUMERICAL_DAMPING = 0.1
"""Coefficient nu1 of the numerical damping of unresolved torsion modes [-].

With a = (h w)² at the torsion frequency w, the step contains the fraction
nu1 a²/(16 + a²) of a backward step. This adds less than 1e-4 of critical damping below
h w = 0.5, and 0.03 at h w = 2. The coefficient must be positive for the scheme to be
stable on stiff joints.
"""
PASSES = 2
"""Evaluations of the map per step: the first predicts the motion of rotor and link, the
second gives the force."""
TENDON_STIFFNESS = (1e-9, 0.0, 1.0)
"""Stiffness polynomial of the drive's tendon [N·m/rad, N·m/rad², N·m/rad³]. The plugin
sets the length so that the tangent of the cubic spring is the stiffness p."""
FRICTION_STIFFNESS = (1e-9, 0.0, 1e-19)
"""Stiffness polynomial of the friction tendon. Its length is a rotation of many turns,
but with such a small cubic part its own spring force is negligible. The plugin
identifies the tendon by this cubic part, which MuJoCo's XML therefore has to preserve.
"""


@cache
def load() -> None:
    """Register the plugin with MuJoCo; further calls have no effect.

    Raises:
        ComputationError: If MuJoCo has another version, or the library is not built or
            cannot be loaded.
    """
    if mujoco.__version__ != MUJOCO_VERSION:
        raise ComputationError(
            f"mujoco {mujoco.__version__} is installed, the drive plugin needs "
            f"{MUJOCO_VERSION}: pip install mujoco=={MUJOCO_VERSION}"
        )
    path = library()
    if not path.exists():
        raise ComputationError(
            f"the drive plugin for mujoco {MUJOCO_VERSION} is not built ({path} is "
            "missing): reinstall swgjoint with a C++ compiler present, or use level "
            "'rigid', 'kinematic', 'linear' or 'native'"
        )
    try:
        mujoco.mj_loadPluginLibrary(str(path))
    except Exception as error:
        raise ComputationError(
            f"MuJoCo {MUJOCO_VERSION} cannot load {path}: {error}"
        ) from error


def load_plugin() -> Path:
    """Register the drive plugin with MuJoCo, so that saved models with drives load.

    Importing swgjoint already registers the plugin. This function raises an error that
    names what is missing, and returns the path that ``mj_loadPluginLibrary`` needs in C
    and C++.

    Returns:
        Path of the library.

    Raises:
        ComputationError: If MuJoCo has another version, or the library is not built or
            cannot be loaded.
    """
    load()
    return library()


def _text(values: np.ndarray) -> str:
    # repr gives the shortest text that converts back to the same bits
    return " ".join(map(repr, np.ravel(values).astype(float).tolist()))


def _bytes(values: np.ndarray) -> str:
    """Numbers as bytes in base64; decimals take 25 times as long."""
    raw = np.ascontiguousarray(values, dtype="<f8").tobytes()
    return "base64:" + b64encode(raw).decode()


def config(
    drive: DriveMap,
    *,
    damping: float,
    contact_damping: float = 0.0,
    numerical_damping: float = NUMERICAL_DAMPING,
    passes: int = PASSES,
) -> dict[str, str]:
    """Attributes of a plugin instance as text; they contain the whole map.

    The amplitudes of more than 128 harmonics are written in base64.

    Args:
        drive: Map to evaluate.
        damping: Damping torque per torsion rate [N·m·s/rad].
        contact_damping: Smallest damping, torque per torsion rate, while a contact or a
            limit acts [N·m·s/rad].
        numerical_damping: See :data:`NUMERICAL_DAMPING` [-].
        passes: See :data:`PASSES`.

    Returns:
        Attribute texts by key.
    """
    numbers = _bytes if len(drive.orders) - 1 > MANY else _text
    return (
        {
            "ratio": repr(drive.ratio),
            "orders": " ".join(str(int(n)) for n in np.ravel(drive.angle_orders)),
            "knots": _text(drive.torsion_knots),
            "potential": numbers(drive.potential),
            "end_stiffness": numbers(drive.end_stiffness),
            "kinematic_error": numbers(drive.kinematic_error),
            "damping": repr(float(damping)),
            "contact_damping": repr(float(contact_damping)),
            "numerical_damping": repr(float(numerical_damping)),
            "passes": str(int(passes)),
        }
        | (
            {
                "hysteresis": _text(
                    np.array([(e.stiffness, e.yield_torque) for e in drive.hysteresis])
                )
            }
            if drive.hysteresis
            else {}
        )
        | (
            {"yield_curve": _text(yield_numbers(drive))}
            if vary_with_load(drive.hysteresis)
            else {}
        )
        | ({"friction": _text(friction_numbers(drive))} if drive.friction else {})
    )


def yield_numbers(drive: DriveMap) -> np.ndarray:
    """Numbers of the attribute ``yield_curve``. Shape (1 + n (1 + n_elements),).

    They are n, then n elastic torques [N·m] and, for each element, n yield torques
    [N·m].
    """
    at, yields = yield_table(drive.hysteresis)
    return np.array([at.size, *at, *yields.ravel()])


def friction_numbers(drive: DriveMap) -> np.ndarray:
    """Numbers of the attribute ``friction``: direction, then the law. Shape (9,).

    The constant bending torque is added to the Coulomb and static torques.
    """
    f = drive.friction
    assert f is not None
    return np.array(
        [
            *drive.friction_direction,
            f.stiffness,
            f.damping,
            f.coulomb + f.bending,
            f.static + f.bending,
            f.stribeck_speed,
            f.viscous,
            f.load / abs(drive.ratio),
        ]
    )


_SELF_TEST = """
<mujoco>
  <extension><plugin plugin="swgjoint.drive"><instance name="d">{config}</instance>
  </plugin></extension>
  <option timestep="0.002" integrator="discrete" gravity="0 0 0"/>
  <worldbody>
    <body><plugin instance="d"/>
      <inertial pos="0 0 0" mass="1" diaginertia="4e-5 4e-5 4e-5"/>
      <joint name="m" axis="0 0 1"/></body>
    <body><inertial pos="0 0 0" mass="1" diaginertia="1 1 .5"/>
      <joint name="l" axis="0 0 1"/></body>
  </worldbody>
  <tendon><fixed name="d" stiffness="1e-9 0 1" springlength="0">
    <joint joint="m" coef="{coef!r}"/><joint joint="l" coef="-1"/></fixed>
    <fixed name="f" stiffness="1e-9 0 1e-19" springlength="0">
    <joint joint="m" coef="1"/><joint joint="l" coef="-1"/></fixed></tendon>
</mujoco>
"""


def metric_error() -> float:
    """Relative error of one engine step against (M + h² (p g g' + p_b b b'))⁻¹ h f [-].

    The scheme passes the direction g, the stiffness p and the stiffness p_b of friction
    to the engine through ``ten_J`` and ``ten_length``. MuJoCo does not document this
    use, so the function tests it on the installed engine.
    """
    from swgjoint.joint.reference import TwinMotion, metric_of, scheme_force

    load()
    drive = DriveMap.linear(2e4)
    drive = replace(
        drive,
        orders=np.array([[0, 0], [4, 0]]),
        potential=np.concatenate([drive.potential, 0.0 * drive.potential]),
        end_stiffness=np.concatenate([drive.end_stiffness, 0.0 * drive.end_stiffness]),
        kinematic_error=np.array([[0.0, 0.0], [3e-4, 2e-4]]),
        friction=Friction(stiffness=70.0, coulomb=0.05, static=0.05, viscous=1e-3),
    )
    damping, h = 3.0, 0.002
    keys = config(drive, damping=damping)
    text = "".join(f'<config key="{k}" value="{v}"/>' for k, v in keys.items())
    model = mujoco.MjModel.from_xml_string(
        _SELF_TEST.format(config=text, coef=1.0 / drive.ratio)
    )
    data = mujoco.MjData(model)
    data.qpos[:] = 0.3, 0.3 / drive.ratio + 1e-3
    data.qvel[:] = v = np.array([20.0, 0.1])
    inertia = np.array([4e-5, 0.5])
    force = scheme_force(
        drive,
        TwinMotion(
            theta=0.3,
            psi=float(data.qpos[1]),
            theta_rate=v[0],
            psi_rate=v[1],
            rotor_weight=1.0 / inertia[0],
            link_weight=1.0 / inertia[1],
        ),
        timestep=h,
        damping=damping,
    )
    metric = np.diag(inertia) + metric_of(drive, force, timestep=h)
    expected = np.linalg.solve(metric, h * np.array([force.theta, force.psi]))
    mujoco.mj_step(model, data)
    return float(np.linalg.norm(data.qvel - v - expected) / np.linalg.norm(expected))


@cache
def require_metric() -> None:
    """Reject the discrete integrator if the engine does not accept the metric.

    Raises:
        ComputationError: If a test step deviates; the message names the alternative.
    """
    error = metric_error()
    if not error < 1e-9:
        raise ComputationError(
            f"MuJoCo {mujoco.__version__} does not include the drive stiffness in its "
            f"discrete integrator (relative error of a step {error:.1e}): set "
            "integrator RK4 and a step below 0.3 divided by the fastest torsion "
            "frequency [rad/s]"
        )


_WIDTH = 24
"""Characters of a number in reserved text: the most that its shortest text has."""


def _wide(drive: DriveMap) -> str:
    """Numbers of the attribute ``friction`` as text whose length is always the same."""
    return " ".join(f"{x!r:>{_WIDTH}}" for x in friction_numbers(drive).tolist())


def reserve_friction(spec: mujoco.MjSpec, drive: JointDrive) -> None:
    """Write the friction of an attached drive as text that any other friction fits.

    Args:
        spec: Model before compilation.
        drive: A drive of level ``full`` with friction.
    """
    [instance] = [one for one in spec.plugins if one.name == drive.plugin]
    instance.config = {**instance.config, "friction": _wide(drive.drive)}


def replace_friction(
    model: mujoco.MjModel, name: str, old: DriveMap, new: DriveMap
) -> None:
    """Replace the friction of a drive in a compiled model.

    Data made from the model afterwards use the new friction; existing data do not.

    Args:
        model: Model whose friction :func:`reserve_friction` prepared.
        name: Name of the plugin instance.
        old: Map with the present friction.
        new: Map with the new friction.
    """
    instance = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_PLUGIN, name)
    first = int(model.plugin_attradr[instance])
    texts = model.plugin_attr[first:].tobytes()
    sought = b"\0" + _wide(old).encode() + b"\0"
    at = texts.find(sought)
    assert at >= 0, "the friction of the instance is not the old one"
    text = np.frombuffer(_wide(new).encode(), np.int8)
    model.plugin_attr[first + at + 1 : first + at + 1 + text.size] = text
