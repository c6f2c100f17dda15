"""Sphinx settings of the guide; the command is in contributing.md."""

from __future__ import annotations

import sys
from pathlib import Path

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml

import swgjoint

sys.path.insert(0, str(Path(__file__).parent))  # sphinx -P leaves it out
from executed_pages import write_pages

for _name in swgjoint.__all__:  # autodoc would import them with TYPE_CHECKING = True
    getattr(swgjoint, _name)

project = "swgjoint"
author = "the authors of swgjoint"
release = version = swgjoint.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
nb_execution_mode = "off"  # executed_pages executes the notebooks
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 4
smartquotes = False  # options begin with two hyphens
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_preserve_defaults = True

html_theme = "furo"
html_title = f"swgjoint {version}"
html_show_copyright = False
html_static_path = ["_static"]
html_css_files = ["wide.css"]
html_math_renderer = "mathml"


def _write(text: str):
    """Visitor that writes a formula as MathML, which needs no script from elsewhere."""

    def visit(self, node):
        block = isinstance(node, nodes.math_block)
        self.body.append(text.format(tex2mathml(node.astext(), as_block=block)))
        raise nodes.SkipNode

    return visit


def setup(app):
    """Register the renderer of formulas, and the notebooks as pages."""
    inline, block = _write("{}"), _write("<div class='formula'>{}</div>")
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.connect(
        "builder-inited", lambda app: write_pages(Path(app.srcdir) / "examples")
    )
