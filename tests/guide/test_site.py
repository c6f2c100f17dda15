"""The guide as a site: it builds with executed notebooks and has no dead links."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from executed import GUIDE, executed, executed_pages, pages_folder


class Anchors(HTMLParser):
    """Links and anchors of a page of the site."""

    def __init__(self, page):
        super().__init__()
        self.links, self.anchors = set(), set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        """Called for each tag."""
        for key, value in attributes:
            if key == "id" or (tag == "a" and key == "name"):
                self.anchors.add(value)
            elif key in ("href", "src") and value:
                self.links.add(value)


def dead_links(folder):
    """Links of a site to pages, anchors and files that it does not have."""
    pages = {path.resolve(): Anchors(path) for path in sorted(folder.rglob("*.html"))}
    dead = []
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            name = unquote(parts.path)
            target = (path.parent / name).resolve() if name else path
            anchors = pages[target].anchors if target in pages else set()
            if not target.exists() or parts.fragment not in ("", *anchors):
                dead.append(f"{path.relative_to(folder.resolve())}: {link}")
    return dead


def test_a_dead_link_of_the_site_is_noticed(tmp_path):
    """A page, a picture and an anchor."""
    (tmp_path / "a.html").write_text(
        '<a href="b.html#here">1</a><a href="b.html#no">2</a><a href="#">3</a>'
        '<img src="none.png"><a href="c.html">4</a><a href="https://d.e/f">5</a>'
    )
    (tmp_path / "b.html").write_text('<p id="here">')
    found = {"a.html: b.html#no", "a.html: none.png", "a.html: c.html"}
    assert set(dead_links(tmp_path)) == found


@pytest.mark.slow
def test_site_builds_without_a_warning(tmp_path):
    """Sphinx treats warnings as errors: references, headings, pages in no contents.

    Every page is there, the notebooks as this run executed them, and no link is dead.
    """
    missing = [
        name
        for name in ("sphinx", "myst_nb", "furo")
        if not importlib.util.find_spec(name)
    ]
    if missing:
        pytest.skip(f"{', '.join(missing)} not installed: pip install '.[docs]'")
    notebooks = executed_pages().notebooks()
    for notebook in notebooks:
        executed(notebook)
    copy = tmp_path / "notebooks"  # the pages of the notebooks are written beside
    shutil.copytree(GUIDE.parent, copy, ignore=shutil.ignore_patterns("examples"))
    (copy / "guide" / "examples").mkdir()
    for page in pages_folder().glob("*.ipynb"):
        shutil.copy(page, copy / "guide" / "examples")
    command = ["-W", "--keep-going", "-q", "-b", "html", "-d", tmp_path / "trees"]
    site = tmp_path / "html"
    done = subprocess.run(
        [sys.executable, "-P", "-m", "sphinx", *command, copy / "guide", site],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    texts = [path for path in GUIDE.rglob("*.md") if path.parent != GUIDE / "examples"]
    pages = {path.relative_to(GUIDE).with_suffix(".html") for path in texts}
    pages |= {Path("examples", f"{notebook.stem}.html") for notebook in notebooks}
    assert [page for page in pages if not (site / page).exists()] == []
    gallery = (site / "examples" / "index.html").read_text(encoding="utf-8")
    assert all(f'href="{notebook.stem}.html"' in gallery for notebook in notebooks)
    executed_anew = [
        page.name
        for page in pages_folder().glob("*.ipynb")
        if page.read_bytes() != (copy / "guide" / "examples" / page.name).read_bytes()
    ]
    assert executed_anew == []
    assert dead_links(site) == []
