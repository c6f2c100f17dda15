"""Model that a run steps: without stages of a step that have nothing to do."""

from __future__ import annotations

import copy

import mujoco


def skip_idle_stages(model: mujoco.MjModel) -> mujoco.MjModel:
    """The model, or a copy that skips contacts or sensors if it has none.

    In every step the engine sorts the bodies by their places before it finds that no
    pair of them may touch. It also looks three times in every instance of a plugin for
    sensors to compute, even if the model has no sensor. The results of the copy are the
    same bits.

    Args:
        model: Compiled model; it remains unchanged, so that geoms of it may become
            able to touch later.
    """
    disable = mujoco.mjtDisableBit
    touch = model.geom_contype.any() and model.geom_conaffinity.any()
    idle = 0
    if not (touch or model.npair or model.nflex):
        idle |= int(disable.mjDSBL_CONTACT)
    if model.nplugin and not model.nsensor:
        idle |= int(disable.mjDSBL_SENSOR)
    if not idle & ~model.opt.disableflags:
        return model
    quick = copy.copy(model)
    quick.opt.disableflags |= idle
    return quick
