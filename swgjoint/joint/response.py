r"""How a joint answers to its own torque with all others free, as the plugin takes it.

The plugin predicts the step of a drive from what its torque does to rotor and link.
With the others free that is the diagonal of the inverse mass matrix. From the engine's
factor M = L'DL,

.. math:: (M^{-1})_{ii} = \sum_j (L^{-T} e_i)_j^2 / D_j

over the dofs j that carry i. What a prediction leaves out comes back a step late as an
acceleration by other forces: too small a response feeds the torsion modes of a chain,
too large a one damps them.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.typing import Array


def responses(
    model: mujoco.MjModel,
    factor: Array,
    inverse_diagonal: Array,
    dofs: Sequence[int] | NDArray[np.intp],
) -> Array:
    """Diagonal elements of the inverse mass matrix [1/(kg·m²)].

    Args:
        model: Compiled.
        factor: ``qLD`` of one or many simulations. Shape (..., nC).
        inverse_diagonal: ``qLDiagInv`` of them. Shape (..., nv).
        dofs: Of the joints.

    Returns:
        Shape (..., number of dofs).
    """
    found = []
    for dof in dofs:
        row, count = int(model.M_rowadr[dof]), int(model.M_rownnz[dof])
        carriers = model.M_colind[row : row + count]
        # one column of L^-T, from the dof up to the root
        x = np.zeros((*factor.shape[:-1], count))
        x[..., -1] = 1.0
        for a in range(count - 1, 0, -1):
            at = int(model.M_rowadr[carriers[a]])
            x[..., :a] -= factor[..., at : at + a] * x[..., a, None]
        found.append((x**2 * inverse_diagonal[..., carriers]).sum(-1))
    return np.stack(found, -1)
