"""Model that a run steps: without the search for contacts where none can occur."""

from __future__ import annotations

import copy

import mujoco


def skip_contact_search(model: mujoco.MjModel) -> mujoco.MjModel:
    """The model, or a copy that skips the search for contacts if nothing can touch.

    In every step the engine sorts the bodies by their places before it finds that no
    pair of them may touch. The results of the copy are the same bits.

    Args:
        model: Compiled model; it remains unchanged, so that geoms of it may become
            able to touch later.
    """
    touch = model.geom_contype.any() and model.geom_conaffinity.any()
    skips = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT
    if touch or model.npair or model.nflex or skips:
        return model
    quick = copy.copy(model)
    quick.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    return quick
