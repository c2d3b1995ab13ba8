"""XML within bounds: written by ElementTree, read without document types, entities or deep nesting."""

import xml.etree.ElementTree as ET
from collections.abc import Callable
from xml.parsers import expat

from uavseg.errors import MissionError
from uavseg.plain_text import one_line

MAX_BYTES = 64 << 20
MAX_DEPTH = 64
MAX_ELEMENTS = 2_000_000


def xml_text(root: ET.Element) -> bytes:
    """An element as an indented UTF-8 document."""
    ET.indent(root)
    text: str = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def child(parent: ET.Element, tag: str, text: str | float | None = None) -> ET.Element:
    """Append an element with a text, or a number as Python writes it, to another; returns it."""
    element = ET.SubElement(parent, tag)
    if text is not None:
        element.text = text if isinstance(text, str) else f"{text:.15g}"
    return element


def plain_name(text: str) -> str:
    """A name of which every character may stand in XML."""
    return one_line("".join(letter if letter.isprintable() else " " for letter in text), 200)


def parse_xml(content: bytes) -> ET.Element:
    """The root of a document; names of its namespaces are left out of tags.

    A document type is refused, and with it every entity of one's own: neither files are read that it names,
    nor do a few bytes become many.

    Raises
    ------
    MissionError
        If it is not well-formed, or beyond the bounds.
    """
    if len(content) > MAX_BYTES:
        raise MissionError(f"it has more than {MAX_BYTES:,} bytes of XML")
    builder = ET.TreeBuilder()
    parser = expat.ParserCreate(namespace_separator=" ")
    bounds = _Bounds()
    parser.StartDoctypeDeclHandler = _refuse_doctype
    parser.StartElementHandler = _start(builder, bounds)
    parser.EndElementHandler = _end(builder, bounds)
    parser.CharacterDataHandler = builder.data
    parser.buffer_text = True
    try:
        parser.Parse(content, True)
        return builder.close()
    except (expat.ExpatError, LookupError, ValueError, AssertionError) as error:
        if isinstance(error, MissionError):
            raise
        raise MissionError(f"it is not well-formed XML: {one_line(error, 80)}") from error


class _Bounds:
    """How deep and how many the elements are that have begun."""

    depth = 0
    count = 0


def _start(builder: ET.TreeBuilder, bounds: _Bounds) -> Callable[[str, dict[str, str]], None]:
    def start(name: str, attributes: dict[str, str]) -> None:
        bounds.depth += 1
        bounds.count += 1
        if bounds.depth > MAX_DEPTH or bounds.count > MAX_ELEMENTS:
            raise MissionError("its elements are too many, or too deep in each other")
        builder.start(_local(name), {_local(key): value for key, value in attributes.items()})

    return start


def _end(builder: ET.TreeBuilder, bounds: _Bounds) -> Callable[[str], None]:
    def end(name: str) -> None:
        bounds.depth -= 1
        builder.end(_local(name))

    return end


def _local(name: str) -> str:
    return name.rpartition(" ")[2]


def _refuse_doctype(*_: object) -> None:
    raise MissionError("it declares a document type (DTD), which files of missions do not need")
