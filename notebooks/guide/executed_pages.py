"""Execute the notebooks and write them, with a gallery, as pages of the guide.

Sphinx calls :func:`write_pages` before it reads the guide. A notebook is executed again
only if its text or the code of the package has changed.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import tempfile
from base64 import b64decode
from functools import cache
from pathlib import Path
from typing import Any

import jupytext
import nbformat
from nbclient import NotebookClient
from PIL import Image

from swgjoint.code_hash import code_hash
from swgjoint.files import write_whole
from swgjoint.models_path import models_path

FOLDER = Path(__file__).resolve().parents[1]
"""Folder of the notebooks."""
SETTINGS = {
    "MPLBACKEND": "module://matplotlib_inline.backend_inline",
    "OPENBLAS_NUM_THREADS": "1",
}
"""Environment of the kernel."""
LIMIT = 600
"""Largest duration of a cell [s]."""
PLOT_OBJECT = re.compile(r"\[?(<matplotlib\.|Text\()")
"""Beginning of the text of matplotlib objects."""
WIDTH = 400
"""Width of a picture of the gallery [pixels]."""
INDEX = """\
# Examples

These pages are the notebooks in `notebooks/`, executed with the package of this guide.

```{{container}} gallery
{figures}
```

```{{toctree}}
:hidden:

{names}
```
"""
FIGURE = """
:::{{figure}} {name}.png
:target: {name}.html
:alt: First picture of this page

{title}
:::
"""


def notebooks() -> list[Path]:
    """Python files of the notebooks, sorted by name."""
    return sorted(FOLDER.glob("*.py"))


def write_pages(folder: Path) -> None:
    """Write the executed notebooks, their pictures and the gallery to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    pages = [write_page(path, folder / f"{path.stem}.ipynb") for path in notebooks()]
    figures = [
        FIGURE.format(name=path.stem, title=title_of(page))
        for path, page in zip(notebooks(), pages, strict=True)
    ]
    names = "\n".join(path.stem for path in notebooks())
    text = INDEX.format(figures="".join(figures), names=names)
    write_whole(folder / "index.md", text)
    for path, page in zip(notebooks(), pages, strict=True):
        write_whole(folder / f"{path.stem}.png", thumbnail(page))


def write_page(source: Path, page: Path) -> Any:
    """Notebook of a page, executed unless the page is up to date.

    Args:
        source: Python file of the notebook.
        page: File to write, ``.ipynb``.

    Returns:
        The executed notebook.
    """
    key = hashlib.sha256(source.read_bytes() + contents().encode()).hexdigest()
    if page.exists():
        stored = nbformat.read(page, as_version=4)
        if stored.metadata.get("swgjoint") == key:
            return stored
    executed = execute(source)
    executed.metadata["swgjoint"] = key
    write_whole(page, nbformat.writes(executed))
    return executed


@cache
def contents() -> str:
    """Hash of what notebooks use: code of the package, models and stored results."""
    files = [*models_path().rglob("*"), *FOLDER.glob("*.json"), *FOLDER.glob("*/*.swg")]
    files += FOLDER.glob("training/*")
    digest = hashlib.sha256(code_hash(".").encode())
    found = {hashlib.sha256(p.read_bytes()).digest() for p in files if p.is_file()}
    for content in sorted(found):  # wherever the files are
        digest.update(content)
    return digest.hexdigest()


def execute(source: Path) -> Any:
    """Execute a notebook in an empty folder, warnings being errors.

    Raises:
        nbclient.exceptions.CellExecutionError: If a cell raises an exception.
        RuntimeError: If the notebook leaves a file in its folder.
    """
    notebook = jupytext.read(source, fmt="py:percent")
    first = (
        "import sys, warnings\n"
        f"__file__ = {str(source)!r}\n"
        f"sys.path.insert(0, {str(source.parent)!r})\n"
        "_filters = warnings.filters[:]\n"
        "warnings.simplefilter('error')"
    )
    last = "warnings.filters[:] = _filters"  # the end of the kernel may warn
    cells = [nbformat.v4.new_code_cell(text) for text in (first, last)]
    notebook.cells = [cells[0], *notebook.cells, cells[1]]
    with tempfile.TemporaryDirectory(prefix="swgjoint-notebook-") as folder:
        client = NotebookClient(
            notebook,
            timeout=LIMIT,
            kernel_name="python3",
            resources={"metadata": {"path": folder}},
            extra_arguments=["--log-level=ERROR"],
        )
        client.execute(env={**os.environ, **SETTINGS})
        left = sorted(path.name for path in Path(folder).iterdir())
    if left:
        raise RuntimeError(f"{source.name} leaves {', '.join(left)} in its folder")
    notebook.cells = notebook.cells[1:-1]
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs = [out for out in cell.outputs if not is_plot_object(out)]
    return notebook


def is_plot_object(output: Any) -> bool:
    """Whether an output is the text of an object such as a legend, next to its plot."""
    data = output.get("data", {})
    return set(data) == {"text/plain"} and bool(PLOT_OBJECT.match(data["text/plain"]))


def title_of(notebook: Any) -> str:
    """Heading of a notebook."""
    return re.sub(r"^# ", "", notebook.cells[0].source.splitlines()[0])


def thumbnail(notebook: Any) -> bytes:
    """First picture of a notebook as a small PNG.

    Raises:
        RuntimeError: If the notebook shows no picture.
    """
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            if picture := output.get("data", {}).get("image/png"):
                image = Image.open(io.BytesIO(b64decode(picture)))
                image.thumbnail((WIDTH, WIDTH))
                png = io.BytesIO()
                image.save(png, "PNG")
                return png.getvalue()
    raise RuntimeError(f"{title_of(notebook)}: no picture for the gallery")
