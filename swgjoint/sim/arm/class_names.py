"""Check of MJCF class names, which the engine would use as format strings.

MuJoCo 4.0.0 inserts the name of an unknown class into the format string of its error
message. ``class="%n"`` therefore terminates the process instead of raising an error.
"""

from __future__ import annotations

import html
import re
from pathlib import Path

from swgjoint.errors import InputError
from swgjoint.models_path import is_file

_ATTRIBUTE = re.compile(r"""\b(?:child)?class\s*=\s*("[^"]*"|'[^']*')""")
_INCLUDE = re.compile(r"""<(?:include|model)\b[^>]*?\bfile\s*=\s*("[^"]*"|'[^']*')""")


def check_class_names(path: Path) -> None:
    """Check the names of classes in a model file and in the files that it includes.

    Args:
        path: MJCF file.

    Raises:
        InputError: If the name of a class contains a percent sign.
    """
    waiting, seen = [path], set[Path]()
    while waiting:
        file = waiting.pop()
        if file in seen or not is_file(file):
            continue  # the engine reports missing files
        seen.add(file)
        # in every encoding that the engine reads, the markup itself is ASCII
        text = file.read_text(encoding="latin-1")
        for quoted in _ATTRIBUTE.findall(text):
            if "%" in html.unescape(quoted):
                raise InputError(
                    f"{file}: class name {html.unescape(quoted)[:60]}; accepted:"
                    " names without a percent sign"
                )
        included = (html.unescape(quoted[1:-1]) for quoted in _INCLUDE.findall(text))
        waiting += [path.parent / name for name in included]
