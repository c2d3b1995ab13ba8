"""Sphinx configuration of the documentation site: Markdown pages, docstrings, and the commands' own help."""

from pathlib import Path

import click
from sphinx.application import Sphinx

import uavseg
from uavseg.cli import main
from uavseg.options.option import Option, options_of

project = "uavseg"
author = "uavseg contributors"
copyright = "2026 the uavseg authors"
version = release = uavseg.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
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
    if page == "reference/cli":
        source[0] += "\n".join(map(command_reference, main.list_commands(click.Context(main))))


def command_reference(name: str) -> str:
    """Return the section of a command: its help, and a table of options for each group."""
    command = main.get_command(click.Context(main), name)
    context = click.Context(command, info_name=f"uavseg {name}")
    paragraphs = (command.help or "").replace("\b", "").split("\n\n")
    text = "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
    usage = " ".join(command.collect_usage_pieces(context))
    parts = [f"\n## uavseg {name}\n", text, f"\n```console\n$ uavseg {name} {usage}\n```"]
    parameters = {str(one.name): one for one in command.params}
    described = options_of(command.job)
    for group in dict.fromkeys(one.group for one in described.values()):
        rows = [_row(parameters[key], one) for key, one in described.items() if one.group == group]
        parts += [f"\n**{group}**\n", "| option | default | what it does |", "|---|---|---|", *rows]
    return "\n".join(parts) + "\n"


def _row(parameter: click.Option, described: Option) -> str:
    """Return the row of an option."""
    value = described.metavar or "|".join(described.choices) or ("" if described.type is bool else "N")
    flags = ", ".join(f"`{flag}`" for flag in [*parameter.opts, *parameter.secondary_opts])
    default = "required" if described.required else described.shown.removeprefix("-")
    if not default and described.default not in (None, (), False):
        default = str(described.default)
    cells = [f"{flags} `{value}`" if value else flags, default, described.help]
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"
