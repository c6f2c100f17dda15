"""Check of arguments of the public functions that are either True or False."""

from __future__ import annotations

from swgjoint.errors import InputError


def check_flags(**flags: object) -> None:
    """Reject arguments that are not a bool, such as the text ``"no"``, which is true.

    Args:
        **flags: Values by the name of their argument.

    Raises:
        InputError: If a value is neither True nor False, of Python or of numpy.

    >>> check_flags(friction=False)
    """
    import numpy as np

    for name, value in flags.items():
        if not isinstance(value, bool | np.bool_):
            text = repr(value)
            text = text if len(text) <= 40 else f"{text[:37]}..."
            raise InputError(f"{name} = {text}; accepted: True, False")
