"""Sphinx configuration of the documentation site: Markdown pages, docstrings, and the commands' own help."""

from pathlib import Path

from sphinx.application import Sphinx

import uavseg

project = "uavseg"
author = "uavseg contributors"
copyright = "2026 the uavseg authors"
version = release = uavseg.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click"]
exclude_patterns = ["_build"]
root_doc = "index"

smartquotes = False  # `--range` in help texts keeps its two hyphens

html_theme = "furo"
html_title = f"uavseg {release}"
html_show_sourcelink = False

myst_heading_anchors = 3  # links such as [text](page.md#heading)
default_role = "code"  # single backticks in docstrings
napoleon_google_docstring = False
napoleon_use_param = False  # keeps "band, ..., resume" one entry
napoleon_use_rtype = False
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
maximum_signature_line_length = 80

# Pages that lie outside of docs/, and the page that shows each of them.
SHOWN_AS = {
    "../README.md#words": "glossary.md",
    "../benchmarks/README.md": "benchmarks.md",
    "../CONTRIBUTING.md": "contributing.md",
}


def setup(app: Sphinx) -> None:
    """Connect to Sphinx."""
    app.connect("source-read", point_into_the_site)


def point_into_the_site(app: Sphinx, page: str, source: list[str]) -> None:
    """Rewrite links to files outside of docs/, which have a page of their own in the site."""
    if Path(app.env.doc2path(page)).suffix == ".md":
        for outside, inside in SHOWN_AS.items():
            source[0] = source[0].replace(f"]({outside})", f"]({inside})")
