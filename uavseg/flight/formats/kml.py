"""Missions as .kml files (OGC KML 2.2), to look at in Google Earth and other globes.

Where the altitude of home above the sea is known, heights above home are drawn as heights above the sea
(altitudeMode absolute); where it is not, they are drawn above the ground (relativeToGround), which is right
as far as the ground is as high as home. Heights above the terrain are drawn above the ground.

XML is read and written by ElementTree, without document types, entities or deep nesting; so is DJI's WPML,
which is KML with elements of its own.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from xml.parsers import expat

from uavseg.errors import MissionError
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.formats.waypoints import decimal
from uavseg.flight.mission import features
from uavseg.flight.mission.features import MissionFeature, Place, Value, features_of, mission_of_features
from uavseg.flight.mission.mission import Mission
from uavseg.plain_text import one_line, shown

KML_NAMESPACE = "http://www.opengis.net/kml/2.2"
MAX_BYTES = 64 << 20
MAX_DEPTH = 64
MAX_ELEMENTS = 2_000_000
FOLDERS = {features.FLIGHT: "line of flight", features.PHOTOS: "photographs", features.HOME: "home"}
FOLDERS |= {features.ITEM: "items", features.FENCE: "fence", features.RALLY: "rally points"}
_COLORS = {features.FLIGHT: "ff00d7ff", features.PHOTOS: "ff0055ff", features.FENCE: "ff00ff00"}  # aabbggrr
_FLAGS = {"true": True, "false": False}
_SHAPES = ("Point", "LineString", "Polygon")


def write_kml(mission: Mission, options: FileOptions) -> bytes:
    """Write a mission as the content of a .kml file."""
    root = ET.Element("kml", {"xmlns": KML_NAMESPACE})
    document = child(root, "Document")
    child(document, "name", plain_name(mission.name) or "mission")
    for kind, color in _COLORS.items():
        style = ET.SubElement(document, "Style", {"id": kind})
        line = child(style, "LineStyle")
        child(line, "color", color)
        child(line, "width", "2")
        child(child(style, "PolyStyle"), "fill", "0")
    folders: dict[str, ET.Element] = {}
    for feature in features_of(mission):
        if feature.role not in folders:
            folders[feature.role] = child(document, "Folder")
            child(folders[feature.role], "name", FOLDERS[feature.role])
        _placemark(folders[feature.role], feature, mission.home.altitude_m)
    return xml_text(root)


def kml_losses(mission: Mission, options: FileOptions) -> list[str]:
    """Return the note that heights are drawn above the ground, where the altitude of home is not known."""
    if mission.home.altitude_m:
        return []
    return ["the altitude of home is not given, so that the .kml draws heights above the ground under them"]


def _placemark(folder: ET.Element, feature: MissionFeature, home_m: float) -> None:
    placemark = child(folder, "Placemark")
    child(placemark, "name", _name(feature))
    if feature.role in _COLORS:
        child(placemark, "styleUrl", f"#{feature.role}")
    data = child(placemark, "ExtendedData")
    for key, value in {"kind": feature.role, **feature.values}.items():
        child(ET.SubElement(data, "Data", {"name": key}), "value", _value_text(value))
    if feature.shape == "Polygon":
        ring = child(child(child(placemark, "Polygon"), "outerBoundaryIs"), "LinearRing")
        places = (f"{decimal(lon, 1)},{decimal(lat, 1)}" for lat, lon, _ in feature.places)
        child(ring, "coordinates", " ".join(places))
    elif feature.shape:
        geometry = child(placemark, feature.shape)
        if feature.shape == "LineString":
            child(geometry, "tessellate", "0")
        is_raised = feature.heights == features.ABOVE_HOME and home_m != 0
        above_sea, added = is_raised or feature.heights == features.ABOVE_SEA, home_m if is_raised else 0.0
        child(geometry, "altitudeMode", "absolute" if above_sea else "relativeToGround")
        texts = (f"{decimal(lon, 1)},{decimal(lat, 1)},{m + added:.3f}" for lat, lon, m in feature.places)
        child(geometry, "coordinates", " ".join(texts))


def _name(feature: MissionFeature) -> str:
    values = feature.values
    if feature.role == features.ITEM:
        return f"{values['number']} (command {values['command']})"
    if feature.role == features.FENCE:
        return "stay inside" if values["inclusion"] else "keep out"
    return FOLDERS[feature.role]


def _value_text(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return "" if value is None else repr(value) if isinstance(value, float) else str(value)


def read_kml(content: bytes, name: str) -> Mission:
    """Read a .kml file that `write_kml` wrote."""
    return mission_of_features(map(_read_placemark, parse_xml(content).iter("Placemark")), name)


def _read_placemark(placemark: ET.Element) -> MissionFeature:
    values = {
        entry.get("name", ""): _read_value(entry.findtext("value") or "")
        for entry in placemark.findall("ExtendedData/Data")
    }
    shape = next((shape for shape in _SHAPES if placemark.find(shape) is not None), "")
    places = tuple(_read_places(placemark.findtext(f".//{shape}//coordinates") or "")) if shape else ()
    if shape and not places:
        raise MissionError("a placemark in it has no coordinates")
    return MissionFeature(str(values.get("kind")), shape, places, values=values)


def _read_places(text: str) -> Iterator[Place]:
    for place in text.split():
        numbers = place.split(",")
        try:
            yield float(numbers[1]), float(numbers[0]), 0.0
        except (ValueError, IndexError) as error:
            raise MissionError(f"{shown(place)} in it is not longitude,latitude") from error


def _read_value(text: str) -> Value:
    """Return a number, a flag or None where the text is one, else the text."""
    if text in _FLAGS:
        return _FLAGS[text]
    try:
        return float(text) if text else None
    except ValueError:
        return text


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
