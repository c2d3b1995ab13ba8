"""The HTML page of a web map: library, style, program and data in one file that loads nothing."""

import base64
import hashlib
import html
import json
from functools import cache
from pathlib import Path
from string import Template
from typing import Any

_ASSETS = Path(__file__).parent / "assets"
_PROGRAM = (
    *("blocks.js", "outlines.js", "elements.js", "regions.js", "cells.js", "slider.js", "missions.js"),
    *("position.js", "app.js"),
)
_SERVED = ("asking.js", "drawing.js", "code_tiles.js", "served.js")  # before app.js
_MAPPED = "//# sourceMappingURL"


def render_page(title: str, data: dict[str, Any], served: bool = False, embedded: bool = False) -> bytes:
    """Render the content of an HTML file with data for its program, values of JSON.

    The page has a Content-Security-Policy that allows nothing but its own script and style, by their hashes,
    workers that this script makes, and images within the file: content of data can neither run nor load
    anything. A `served` page may send requests to its server, and no other; an `embedded` one exchanges its
    range with the window that frames it.
    """
    script, style = _script(served, embedded), _style()
    sources = "img-src data: 'self'; connect-src 'self'" if served else "img-src data:"
    policy = (
        f"default-src 'none'; script-src '{_hash(script)}'; style-src '{_hash(style)}'; "
        f"worker-src blob:; {sources}; base-uri 'none'; form-action 'none'"
    )
    page = Template(asset("page.html")).substitute(
        policy=policy,
        title=html.escape(title),
        icon='<link rel="icon" href="data:,">' if served else "",  # or the browser asks for one
        licence=asset("leaflet/LICENSE").replace("--", "- -"),
        style=style,
        data=_json(data),
        script=script,
    )
    return page.encode()


def data_url(content: bytes, media_type: str) -> str:
    """Encode a file as a URL that holds it."""
    return f"data:{media_type};base64,{base64.b64encode(content).decode()}"


def _json(data: dict[str, Any]) -> str:
    """Encode as JSON without a character that ends a script element or begins a comment in one."""
    text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


@cache
def _script(served: bool, embedded: bool) -> str:
    library = asset("leaflet/leaflet.js")
    programs = [*_PROGRAM[:-1], *_SERVED * served, _PROGRAM[-1], *["embed.js"] * embedded]
    return "\n".join([library[: library.rindex(_MAPPED)], *map(asset, programs)])


@cache
def _style() -> str:
    style = asset("leaflet/leaflet.css").replace("url(images/marker-icon.png)", "none")
    for name in ("layers.png", "layers-2x.png"):
        url = data_url((_ASSETS / "leaflet" / name).read_bytes(), "image/png")
        style = style.replace(f"url(images/{name})", f"url({url})")
    return f"{style}\n{asset('page.css')}"


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def asset(name: str) -> str:
    """Read the text of a file of `assets`."""
    return (_ASSETS / name).read_text(encoding="utf-8").replace("\r\n", "\n")
