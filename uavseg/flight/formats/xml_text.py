"""XML reader and writer: ElementTree, without document types, entities or deep nesting."""

import xml.etree.ElementTree as ET
from xml.parsers import expat

from uavseg.errors import MissionError
from uavseg.plain_text import one_line

KML_NAMESPACE = "http://www.opengis.net/kml/2.2"
MAX_BYTES = 64 << 20
MAX_DEPTH = 64
MAX_ELEMENTS = 2_000_000


def xml_text(root: ET.Element) -> bytes:
    """Serialise an element as an indented UTF-8 document."""
    ET.indent(root)
    text: str = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def child(parent: ET.Element, tag: str, text: str | float | None = None) -> ET.Element:
    """Append a child element with a text, or a number as Python writes it; return the child."""
    element = ET.SubElement(parent, tag)
    if text is not None:
        element.text = text if isinstance(text, str) else f"{text:.15g}"
    return element


def plain_name(text: str) -> str:
    """Replace characters of a name that XML forbids."""
    return one_line("".join(letter if letter.isprintable() else " " for letter in text), 200)


def parse_xml(content: bytes) -> ET.Element:
    """Parse a document and return its root; namespaces are left out of tags.

    A document type is refused, and with it all entities: they can name other files, and expand a few bytes to
    many. A MissionError says that it is not well-formed, or too large.
    """
    if len(content) > MAX_BYTES:
        raise MissionError(f"it has more than {MAX_BYTES:,} bytes of XML")
    builder = ET.TreeBuilder()
    parser = expat.ParserCreate(namespace_separator=" ")
    handlers = _Handlers(builder)
    parser.StartDoctypeDeclHandler = handlers.refuse_doctype
    parser.StartElementHandler, parser.EndElementHandler = handlers.start, handlers.end
    parser.CharacterDataHandler = builder.data
    parser.buffer_text = True
    try:
        parser.Parse(content, True)
        return builder.close()
    except (expat.ExpatError, LookupError, ValueError, AssertionError) as error:
        if isinstance(error, MissionError):
            raise
        raise MissionError(f"it is not well-formed XML: {one_line(error, 80)}") from error


class _Handlers:
    """Handlers of elements, which count them and their depth."""

    def __init__(self, builder: ET.TreeBuilder) -> None:
        self.builder = builder
        self.depth = self.count = 0

    def start(self, name: str, attributes: dict[str, str]) -> None:
        self.depth += 1
        self.count += 1
        if self.depth > MAX_DEPTH or self.count > MAX_ELEMENTS:
            raise MissionError("its elements are too many, or too deep in each other")
        self.builder.start(_local(name), {_local(key): value for key, value in attributes.items()})

    def end(self, name: str) -> None:
        self.depth -= 1
        self.builder.end(_local(name))

    def refuse_doctype(self, *_: object) -> None:
        raise MissionError("it declares a document type (DTD), which files of missions do not need")


def _local(name: str) -> str:
    return name.rpartition(" ")[2]
