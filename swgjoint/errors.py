"""Exceptions and solver outcomes.

Each message names the fault, its place, the value with its unit, and what is accepted.
"""

from __future__ import annotations

from enum import Enum


class SwgError(Exception):
    """Base class of all exceptions that swgjoint raises deliberately."""


class InputError(SwgError, ValueError):
    """A file, key, name or value that cannot be used; the exit status is 2."""


class DesignError(InputError):
    """A design that is inconsistent or cannot be built, with one line per fault."""


class MapFileError(InputError):
    """A ``.swg`` file that is damaged, malicious or of an unsupported schema."""


class MissingExtraError(SwgError, ImportError):
    """An optional dependency that is needed but not installed."""


class ComputationError(SwgError, RuntimeError):
    """A failed computation, with advice in the message; the exit status is 1."""


class OutputWarning(UserWarning):
    """An output file could not be written; the result itself remains valid."""


def out_of_memory(error: Exception) -> bool:
    """Whether an error of Python or MuJoCo means that memory ran out."""
    return isinstance(error, MemoryError) or "could not allocate" in str(error).lower()


class Outcome(Enum):
    """Outcome of a solve; the value of a failure is the text that a user sees."""

    CONVERGED = "converged"
    MAX_ITERATIONS = (
        "the Newton iteration did not converge: use smaller load steps or a smaller "
        "wave-generator step"
    )
    ACTIVE_SET_CYCLES = (
        "the contact active set did not settle: use a smaller wave-generator step or "
        "refine the mesh"
    )
    SINGULAR = (
        "the stiffness matrix is singular: the output is free to move (backlash) or "
        "the structure is not supported; apply a torque"
    )
    DIVERGED = "the solution left the range of the model: lower the torque"

    @property
    def ok(self) -> bool:
        """Whether the solve succeeded."""
        return self is Outcome.CONVERGED
