"""What a compiled model contains, and what was left out and why."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from swgjoint.sim.assembly import Assembly
    from swgjoint.sim.transmission import Transmission

_LEFT_OUT = {
    "rigid": "torsion, kinematic error and torque ripple (level rigid)",
    "linear": "kinematic error, torque ripple and hardening (level linear)",
}


def contents(assembly: Assembly) -> dict[str, Any]:
    """Counts of the compiled model and the content of every joint; JSON values only."""
    model = assembly.model
    return {
        "degrees_of_freedom": int(model.nv),
        "tendons": int(model.ntendon),
        "plugin_instances": int(model.nplugin),
        "actuators": int(model.nu),
        "integrator": assembly.scene.simulation.integrator,
        "step_s": assembly.scene.simulation.step_s,
        "joints": {t.joint: _joint(t) for t in assembly.transmissions},
        "left_out": [
            {"joint": t.joint, **item}
            for t in assembly.transmissions
            for item in _left_out(t)
        ],
    }


def _joint(transmission: Transmission) -> dict[str, Any]:
    attached = transmission.attached
    return {
        "level": attached.level,
        "drive": transmission.drive.name,
        "source": transmission.drive.level,
        "ratio": attached.ratio,
        "rotor": attached.rotor,
        "tendon": attached.tendon,
        "plugin": attached.plugin,
        "rotor_inertia_kgm2": attached.rotor_inertia,
        "stiffness_Nm_rad": None if attached.level == "rigid" else attached.stiffness,
        "damping_Nms_rad": attached.damping,
        "natural_frequency_Hz": attached.natural_frequency / 6.283185307179586,
        "orders": list(attached.kept_orders) if attached.level == "full" else [],
    }


def _left_out(transmission: Transmission) -> list[dict[str, str]]:
    attached = transmission.attached
    items = []
    if attached.level in _LEFT_OUT:
        items.append(
            {"part": _LEFT_OUT[attached.level], "reason": "the scene asks for no more"}
        )
    if attached.unresolved:
        left = [f"{u.order:.4g}" for u in attached.unresolved]
        orders = f"orders {left[0]} to {left[-1]}" if left[1:] else f"order {left[0]}"
        items.append(
            {
                "part": f"{orders} per input turn ({len(left)} harmonics)",
                "reason": "the step cannot carry them at the speed of this joint",
            }
        )
    return items
