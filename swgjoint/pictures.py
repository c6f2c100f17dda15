"""How a figure becomes a file: texts that come from elsewhere are shown as they are."""

from __future__ import annotations

import io
import re
import unicodedata
from typing import IO, Any

LONGEST_WORD = 80
"""Characters of a name in a picture; a longer one is cut."""
_UNSEEN = {"Cc", "Cs", "Cf", "Co", "Cn"}
"""Categories of characters without a shape (Unicode Standard, table 4-4)."""


def save_png(figure: Any, out: IO[bytes], *, dpi: float) -> None:
    """Draw a figure of matplotlib as PNG.

    Args:
        figure: Without mathematics in its texts: ``$`` is drawn as it is.
        out: Where the bytes go.
        dpi: Pixels per inch.
    """
    from matplotlib.text import Text
    from matplotlib.ticker import FixedFormatter, FuncFormatter

    for text in figure.findobj(Text):
        text.set_text(plain_text(text.get_text()))
    # the texts of ticks are set when they are drawn; those of a logarithmic scale are
    # mathematics of matplotlib's own
    given = (FixedFormatter, FuncFormatter)
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if isinstance(axis.get_major_formatter(), given):
                for tick in axis.get_major_ticks(len(axis.get_majorticklocs())):
                    tick.label1.set_parse_math(False)
                    tick.label2.set_parse_math(False)
    figure.savefig(out, format="png", dpi=dpi)


def png(figure: Any, *, dpi: float) -> bytes:
    """A matplotlib figure as the bytes of a PNG file.

    Args:
        figure: The figure.
        dpi: Resolution [pixels per inch].
    """
    out = io.BytesIO()
    save_png(figure, out, dpi=dpi)
    return out.getvalue()


def plain_text(text: str) -> str:
    """A text for a picture: no mathematics, no unseen characters, no endless word."""
    text = "".join(
        "?" if unicodedata.category(c) in _UNSEEN and c != "\n" else c for c in text
    )
    text = re.sub(
        rf"\S{{{LONGEST_WORD + 1},}}",
        lambda word: f"{word[0][: LONGEST_WORD - 3]}...",
        text,
    )
    return text.replace("\\$", "$").replace("$", "\\$")
