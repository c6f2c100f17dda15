"""Models with hand-made drives that no one should make, and states to go with them.

Attributes have wrong counts, huge, negative, empty and other than numbers, knots out of
order, too many elements; states are NaN, infinite, 1e15 and 1e-300. Every model is
refused or steps; nothing else is asked of it. Model k of a seed is always the same::

    python -P tests/shared/hostile_drives.py SEED COUNT
"""

from __future__ import annotations

import copy
import json
import sys
from collections import Counter
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

Rng = np.random.Generator

INTEGRATORS = ("Euler", "RK4", "implicit", "implicitfast", "discrete")
SOLVERS = ("Newton", "CG", "PGS")
FLAGS = ("spring", "damper", "warmstart", "energy", "fwdinv", "autoreset", "island")
WILD = (np.nan, np.inf, -np.inf, 1e15, -1e15, 1e-300, -0.0, 5e-324, 1e308, 1e9)
WORDS = ("x", "1,5", "0x10", "1e", "+1", "--1", "1e999", "nan", "inf", "-nan(1)", "٣")
KEYS = ("ratio", "orders", "knots", "potential", "end_stiffness", "kinematic_error")
KEYS += ("damping", "numerical_damping", "passes", "hysteresis", "friction")
KEYS += ("contact_damping",)
BODIES = """
  <body><plugin instance="d{k}"/><inertial pos="0 0 0" mass="1e-9"
    diaginertia="{rotor} {rotor} {rotor}"/><joint name="m{k}" axis="0 0 1"/></body>
  <body><inertial pos="0 0 0" mass="1" diaginertia="{link} {link} {link}"/>
    <joint name="l{k}" axis="0 0 1" {limits}/></body>"""
TENDONS = """
  <fixed name="d{k}" stiffness="1e-9 0 1" springlength="0" {user}>
    <joint joint="m{k}" coef="{coefficient}"/><joint joint="l{k}" coef="-1"/></fixed>
  <fixed name="f{k}" stiffness="1e-9 0 1e-19" springlength="0">
    <joint joint="m{k}" coef="1"/><joint joint="l{k}" coef="{b}"/></fixed>"""
MODEL = """<mujoco><extension><plugin plugin="swgjoint.drive">{instances}</plugin>
  </extension><size nuser_tendon="{users}"/>
  <option timestep="{step}" integrator="{integrator}" solver="{solver}"
    gravity="0 0 0"><flag {flags}/></option>
  <custom><numeric name="{region}" data="{bounds}"/></custom>
  <worldbody>{bodies}</worldbody><tendon>{tendons}</tendon></mujoco>"""


def _text(values: object) -> str:
    return " ".join(repr(float(v)) for v in np.ravel(np.asarray(values, float)))


def sound_attributes(rng: Rng) -> dict[str, str]:
    """Attributes of the right counts; some with sizes that overflow."""
    n, m = int(rng.integers(1, 9)), int(rng.integers(1, 7))
    orders = rng.integers(-5, 130, (n, 2)) * [1, rng.integers(0, 2)]
    orders[0] = 0
    size = 10.0 ** rng.choice([4, 4, 4, -300, 15, 150, 300])
    potential = size * rng.normal(0.0, 1e-2, (n, 2, m, 5))
    potential[0, 0, :, 2] = size
    knots = np.cumsum(10.0 ** rng.choice([-3.0, -3.0, -12.0, 0.0, 300.0], m + 1))
    knots -= knots[m // 2]
    knots += np.arange(m + 1) * np.spacing(np.abs(knots).max())
    elements = rng.uniform(1e-3, 1e4, (int(rng.choice([0, 0, 1, 3, 64])), 2))
    found = {
        "ratio": repr(float(rng.choice([-60.0, 101.0, 1.0, -0.5, 1e6]))),
        "orders": " ".join(map(str, orders.ravel().tolist())),
        "knots": _text(knots),
        "potential": _text(potential),
        "end_stiffness": _text(size * rng.uniform(0, 1, (n, 2, 2))),
        "kinematic_error": _text(10.0 ** rng.choice([-4, 3]) * rng.normal(size=2 * n)),
        "damping": repr(float(rng.choice([0.0, 3.0, 1e10]))),
        "numerical_damping": repr(float(rng.choice([0.0, 0.1, 1.0]))),
        "passes": str(int(rng.choice([1, 2, 20]))),
    }
    if len(elements):
        found["hysteresis"] = _text(elements)
    if rng.random() < 0.5:
        law = 10.0 ** rng.uniform(-12, 12, 7)
        law[3] += law[2]
        found["friction"] = _text([1.0, rng.choice([1.0, -1.0]), *law])
    if rng.random() < 0.5:
        found["contact_damping"] = repr(float(rng.choice([0.0, 3.0, 1e10])))
    return found


def spoiled(text: str, rng: Rng) -> str:
    """The same numbers with one fault."""
    parts = text.split()
    k = int(rng.integers(len(parts)))
    kind = int(rng.integers(9))
    if kind == 0:
        return str(rng.choice(["", " ", "\t\n "]))
    if kind == 1:
        parts[k] = str(rng.choice(WORDS))
    elif kind == 2:
        parts[k] = repr(float(rng.choice(WILD)))
    elif kind == 3:
        parts[k] = "-" + parts[k]
    elif kind == 4:
        del parts[k:]
    elif kind == 5:
        parts.insert(k, parts[k])
    elif kind == 6:
        parts = parts * int(rng.choice([2, 130]))
    elif kind == 7:
        rng.shuffle(parts)
    else:
        parts[k] += "0" * int(rng.choice([1, 400]))
    return " ".join(parts)


def hostile_model(rng: Rng) -> str:
    """MJCF of one to three drives."""
    instances = bodies = tendons = ""
    users = int(rng.choice([0, 3, 5, 8]))
    for k in range(int(rng.integers(1, 4))):
        attributes = sound_attributes(rng)
        for _ in range(int(rng.choice([0, 0, 1, 1, 3]))):
            key = str(rng.choice(KEYS))
            if rng.random() < 0.1:
                attributes.pop(key, None)
            elif attributes.get(key):
                attributes[key] = spoiled(attributes[key], rng)
        try:
            coefficient = repr(1.0 / float(attributes["ratio"]))
        except (KeyError, ValueError, ZeroDivisionError):
            coefficient = "1"
        configs = "".join(
            f"<config key={quoteattr(key)} value={quoteattr(value)}/>"
            for key, value in attributes.items()
        )
        instances += f'<instance name="d{k}">{configs}</instance>'
        b = [*attributes.get("friction", "").split(), "1", "1"][1]
        limited = rng.random() < 0.3
        bodies += BODIES.format(
            k=k,
            rotor=10.0 ** rng.uniform(-9, 1),
            link=10.0 ** rng.uniform(-6, 6),
            limits='limited="true" range="-1 1"' if limited else "",
        )
        user = f'user="{_text(rng.normal(size=users))}"' if users else ""
        tendons += TENDONS.format(k=k, coefficient=coefficient, b=b, user=user)
    off = [flag for flag in FLAGS if rng.random() < 0.15]
    bounds = 10.0 ** rng.uniform(-6, 3, int(rng.choice([1, 4, 4, 5])))
    return MODEL.format(
        instances=instances,
        users=users,
        step=10.0 ** rng.uniform(-7, -1),
        integrator=rng.choice(INTEGRATORS),
        solver=rng.choice(SOLVERS, p=[0.6, 0.2, 0.2]),
        flags=" ".join(
            f'{flag}="{"enable" if flag in ("energy", "fwdinv") else "disable"}"'
            for flag in off
        ),
        region=rng.choice(["swgjoint_region", "left_swgjoint_region", "other"]),
        bounds=_text(bounds * rng.choice([1.0, -1.0, 0.0])),
        bodies=bodies,
        tendons=tendons,
    )


def disturb(model: mujoco.MjModel, data: mujoco.MjData, rng: Rng) -> None:
    """Write a wild number somewhere, or many ordinary ones."""
    arrays = [data.qpos, data.qvel, data.plugin_state, data.qfrc_applied]
    arrays += [a for a in (model.tendon_user.reshape(-1),) if a.size]
    array = arrays[int(rng.integers(len(arrays)))]
    if rng.random() < 0.5:
        array[int(rng.integers(len(array)))] = rng.choice(WILD)
    else:
        array[:] = rng.normal(size=len(array)) * 10.0 ** rng.uniform(-6, 6)


def step_about(model: mujoco.MjModel, rng: Rng) -> None:
    """60 to 160 steps with disturbances, copies, resets and half steps between them."""
    data = mujoco.MjData(model)
    whole = mujoco.mjtState.mjSTATE_INTEGRATION
    kept = np.zeros(mujoco.mj_stateSize(model, whole))
    for _ in range(int(rng.integers(60, 161))):
        if rng.random() < 0.2:
            disturb(model, data, rng)
        act = int(rng.integers(12))
        if act == 0:
            data = copy.copy(data)
        elif act == 1:
            mujoco.mj_forward(model, data)
        elif act == 2:
            mujoco.mj_getState(model, data, kept, whole)
        elif act == 3:
            mujoco.mj_setState(model, data, kept, whole)
        elif act == 4:
            mujoco.mj_resetData(model, data)
        elif act == 5 and model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
            mujoco.mj_step1(model, data)
            other = mujoco.MjData(model)
            mujoco.mj_copyData(other, model, data)
            mujoco.mj_step2(model, other)
        mujoco.mj_step(model, data)


def run(seed: int, count: int) -> Counter[str]:
    """How many models were refused and how many stepped."""
    mujoco.set_mju_user_warning(lambda _: None)
    found: Counter[str] = Counter()
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        try:
            model = mujoco.MjModel.from_xml_string(hostile_model(rng))
        except ValueError as error:
            found["by the plugin" if "plugin" in str(error) else "by the engine"] += 1
            continue
        found["stepped"] += 1
        step_about(model, rng)
    return found


if __name__ == "__main__":
    print(json.dumps(run(*map(int, sys.argv[1:3]))))
