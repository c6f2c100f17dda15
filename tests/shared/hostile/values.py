"""Numbers and texts that a careless reader stumbles over."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

Item = TypeVar("Item")

NUMBERS = (
    *(0.0, -0.0, 1e308, -1e308, 5e-324, 1e-300, 1e15, -1.0, 1e-9, 0.5, 2.0**53),
    *(float("inf"), float("-inf"), float("nan")),
)
WHOLE = (0, -1, 1, 2**31, 2**63, -(2**63), 10**30, 10**400)
TEXTS = (
    "",
    " ",
    ".",
    "..",
    "../../up",
    "a/b",
    "/etc/passwd",
    "a\0b",
    "$\\frac{$",
    "$x^$",
    "$$",
    "\\",
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "{{ 7*7 }}",
    "%s %d %n",
    "\x1b[31mred\x07",
    "line\nbreak\r\n",
    "\x7f\x85\u2028",
    "\u202eabc",
    "Δφ [°]",
    "\U0001d6fc" * 40,
    "e\u0301" * 200,
    "CON",
    "-o",
    "--help",
    "nan",
    "1e999",
    "true",
    "CSG-25-100",
    "reference-2d",
    "none.toml",
    ".",
    "~",
    "x" * 300,
    "n" * 5000,
)
SURROGATE = "lone \udc80 surrogate"


def pick(rng: np.random.Generator, items: tuple[Item, ...] | list[Item]) -> Item:
    """One of the items, whatever they are."""
    return items[int(rng.integers(len(items)))]


def factor(rng: np.random.Generator) -> float:
    """What a plausible number is multiplied by."""
    return pick(rng, [-1.0, 0.0, 0.1, 0.5, 0.9, 1.1, 2.0, 10.0, 57.3, 1e3, 1e6])


def flipped(rng: np.random.Generator, data: bytes) -> bytes:
    """Damage of a file in transit: cut, bytes changed, put in twice or taken out."""
    if not data:
        return data
    content = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        at = int(rng.integers(len(content)))
        length = int(rng.integers(1, 40))
        what = int(rng.integers(5))
        if what == 0:
            content[at] = int(rng.integers(256))
        elif what == 1:
            content[at:at] = content[at : at + length]
        elif what == 2:
            del content[at : at + length]
        elif what == 3:
            content[at:at] = rng.bytes(length)
        else:
            content = content[:at]
        if not content:
            break
    return bytes(content)
