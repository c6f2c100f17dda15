"""What a message must name, whatever its sentence."""

from __future__ import annotations

import re


def naming(*parts: str) -> str:
    """Pattern for ``pytest.raises(match=...)``: every part occurs, in any order.

    A test pins what a user needs from a message: the path of the key or file, the
    value, its unit, and what is accepted. The words around them may change.

    Args:
        parts: Plain strings. One that begins or ends with a letter or digit must begin
            or end a word there, so that ``"1"`` is not found in ``"0.17"``.
    """
    return "(?s)" + "".join(f"(?=.*{_whole(part)})" for part in parts)


def names(message: str, *parts: str) -> bool:
    """Whether every part occurs in a message."""
    return re.search(naming(*parts), message) is not None


def _whole(part: str) -> str:
    first, last = part[0], part[-1]
    before = r"(?<![\w.])" if first.isdigit() else r"(?<!\w)" if first.isalpha() else ""
    after = r"(?!\w|\.\d)" if last.isdigit() else r"(?!\w)" if last.isalpha() else ""
    return before + re.escape(part) + after
