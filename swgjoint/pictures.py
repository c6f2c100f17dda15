"""Write matplotlib figures to files; text from input files is drawn literally."""

from __future__ import annotations

import base64
import io
import re
import unicodedata
from collections.abc import Iterator
from typing import IO, Any

LONGEST_WORD = 80
"""Largest length of a word in a picture [characters]; longer words are shortened."""
_EFFORT = 3
"""Effort of the PNG compression [-]. The default, 6, takes 40 % longer for 4 % less."""
_UNSEEN = {"Cc", "Cs", "Cf", "Co", "Cn"}
"""Categories of invisible characters (Unicode Standard, table 4-4)."""


def save_png(figure: Any, out: IO[bytes], *, dpi: float) -> None:
    """Write a matplotlib figure as PNG.

    Args:
        figure: The figure; ``$`` in its text is drawn literally, not as mathematics.
        out: Binary stream that receives the file.
        dpi: Resolution [pixels per inch].
    """
    import numpy as np
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.ticker import FixedFormatter, FuncFormatter
    from PIL import Image

    for text in _texts(figure):
        text.set_text(plain_text(text.get_text()))
    # matplotlib sets tick labels when it draws them; those of a logarithmic axis are
    # mathematical text and must still be parsed
    literal = (FixedFormatter, FuncFormatter)
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if isinstance(axis.get_major_formatter(), literal):
                for tick in axis.get_major_ticks(len(axis.get_majorticklocs())):
                    tick.label1.set_parse_math(False)
                    tick.label2.set_parse_math(False)
    figure.dpi = dpi
    canvas = figure.canvas
    if not isinstance(canvas, FigureCanvasAgg):  # else it knows the sizes of its texts
        canvas = FigureCanvasAgg(figure)
    canvas.draw()  # once; savefig draws twice
    # figures have an opaque background, so all pixels are opaque
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    image.save(out, format="png", dpi=(dpi, dpi), compress_level=_EFFORT)


def inline_picture(data: bytes) -> str:
    """Picture as base64 text, for embedding in a page."""
    return base64.b64encode(data).decode("ascii")


def _texts(artist: Any) -> Iterator[Any]:
    """All texts in an artist but the tick labels, which matplotlib sets as it draws."""
    from matplotlib.axis import Axis
    from matplotlib.text import Text

    if isinstance(artist, Axis):
        yield from (artist.label, artist.offsetText)
        return
    for child in artist.get_children():
        if isinstance(child, Text):
            yield child
        else:
            yield from _texts(child)


def png(figure: Any, *, dpi: float) -> bytes:
    """Encode a matplotlib figure as a PNG file.

    Args:
        figure: The figure.
        dpi: Resolution [pixels per inch].
    """
    out = io.BytesIO()
    save_png(figure, out, dpi=dpi)
    return out.getvalue()


def plain_text(text: str) -> str:
    """Prepare text for a picture.

    Invisible characters become ``?``, long words are shortened and ``$`` is escaped.
    """
    text = "".join(
        "?" if unicodedata.category(c) in _UNSEEN and c != "\n" else c for c in text
    )
    text = re.sub(
        rf"\S{{{LONGEST_WORD + 1},}}",
        lambda word: f"{word[0][: LONGEST_WORD - 3]}...",
        text,
    )
    return text.replace("\\$", "$").replace("$", "\\$")
