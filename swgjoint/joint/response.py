r"""Response of a joint to its own torque with all other joints free, as in the plugin.

The plugin predicts the step of a drive from the response of rotor and link to its
torque. With the other joints free, the response is the diagonal of the inverse mass
matrix. The engine's factorisation M = L'DL gives

.. math:: (M^{-1})_{ii} = \sum_j (L^{-T} e_i)_j^2 / D_j,

summed over dof i and the dofs j that carry it. Any part of the response that the
prediction omits returns one step late as an acceleration by other forces. If the
predicted response is too small, this feeds energy into the torsion modes of a chain;
if it is too large, this damps them.
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
        model: Compiled model.
        factor: ``qLD`` of one or many simulations. Shape (..., nC).
        inverse_diagonal: ``qLDiagInv`` of the same simulations. Shape (..., nv).
        dofs: Indices of the dofs of the joints.

    Returns:
        Diagonal elements of the given dofs. Shape (..., number of dofs).
    """
    diagonal = []
    for dof in dofs:
        row, count = int(model.M_rowadr[dof]), int(model.M_rownnz[dof])
        if count == 1:  # carried by no other dof
            diagonal.append(inverse_diagonal[..., dof])
            continue
        carriers = model.M_colind[row : row + count]
        # one column of L^-T, from the dof up to the root
        x = np.zeros((*factor.shape[:-1], count))
        x[..., -1] = 1.0
        for a in range(count - 1, 0, -1):
            at = int(model.M_rowadr[carriers[a]])
            x[..., :a] -= factor[..., at : at + a] * x[..., a, None]
        diagonal.append((x**2 * inverse_diagonal[..., carriers]).sum(-1))
    return np.stack(diagonal, -1)
