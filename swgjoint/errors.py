"""Exceptions that say what, the value with its unit, where, and what is accepted."""

from __future__ import annotations

from enum import Enum


class SwgError(Exception):
    """Root of all errors raised by swgjoint on purpose."""


class InputError(SwgError, ValueError):
    """Bad input: a file, key, name or value that cannot be used (exit status 2)."""


class DesignError(InputError):
    """A design that is inconsistent or cannot be built; one line per fault."""


class MapFileError(InputError):
    """A ``.swg`` file that is damaged, hostile or of another schema."""


class MissingExtraError(SwgError, ImportError):
    """An optional dependency is needed and not installed."""


class ComputationError(SwgError, RuntimeError):
    """A computation that failed; carries the outcome's advice (exit status 1)."""


class OutputWarning(UserWarning):
    """A file that belongs to a result could not be written; the result stands."""


def out_of_memory(error: Exception) -> bool:
    """Whether memory ran out; MuJoCo reports that by errors of its own."""
    return isinstance(error, MemoryError) or "could not allocate" in str(error).lower()


class Outcome(Enum):
    """Outcome of a solve; the value is the advice that a user sees."""

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
