"""How the documentation is built: `uv run --group docs sphinx-build -W docs docs/_build/html`."""

import os
import re
import sys
from importlib.resources import files
from pathlib import Path

import semgp

HERE = Path(__file__).resolve().parent
MATHJAX = files("sphinx-mathjax-offline") / "static" / "mathjax" / "tex-svg.js"
TRAILING = re.compile(r"(?<![`\w])(\w*[A-Za-z0-9])_(?=[^\w])")

project = "semgp"
author = "The semgp authors"
copyright = "2026, The semgp authors"
version = release = semgp.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon"]
exclude_patterns = ["_build", "**/.*"]
html_theme = "furo"
html_title = "semgp"
html_static_path = ["_static", str(MATHJAX)]
mathjax_path = MATHJAX.name  # formulas without a network, and without asking anybody for them
html_css_files = ["semgp.css"]
html_theme_options = {"light_css_variables": {"color-brand-primary": "#2a6f97", "color-brand-content": "#2a6f97"}}

# Pages
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 3
myst_dmath_double_inline = True
# Changelog and contributing begin below their titles; `sites` in a docstring is what several classes have.
suppress_warnings = ["myst.header", "ref.python"]

# Notebooks: every code cell runs when its page is built, in an empty folder; an error ends the build. Pages whose
# text has not changed are taken from `_build/.jupyter_cache`: remove `_build` to run everything again.
nb_execution_mode = os.environ.get("SEMGP_DOCS_EXECUTION", "cache")  # "off" for a quick look at the text
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 600
nb_merge_streams = True
os.environ["PYTHONPATH"] = os.pathsep.join([str(HERE / "_run"), os.environ.get("PYTHONPATH", "")])
sys.path.insert(0, str(HERE / "_run"))

# Reference
default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # numpydoc sections say the types, with shapes and units
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False


def plain_docstring(app, what, name, obj, options, lines: list[str]) -> None:
    """Escape what our docstrings mean as it stands, and the extensions do not.

    To reStructuredText |x| and names that end in _ are references; to napoleon what stands before the colon of a
    property's first line is its type.
    """
    for i, line in enumerate(lines):
        outside = line.split("``")[::2]
        if any("|" in part or TRAILING.search(part) for part in outside):
            lines[i] = TRAILING.sub(r"\1\\_", line).replace("|", "\\|")
    if what in ("property", "attribute", "data") and lines:
        lines[0] = lines[0].replace(": ", " \N{EN DASH} ", 1)


def setup(app) -> None:
    """Tell Sphinx of what this file adds."""
    app.connect("autodoc-process-docstring", plain_docstring, priority=100)  # before napoleon
