"""DJI's .kmz files: a zip archive with the two documents of a wayline (WPML)."""

import zipfile
import zlib
from io import BytesIO

from uavseg.errors import MissionError
from uavseg.flight.formats.options import DJI_MODELS, FileOptions
from uavseg.flight.formats.wayline import mission_of_wayline, wayline_losses, wayline_of
from uavseg.flight.formats.wpml import check_wayline, read_waylines, template_kml, waylines_wpml
from uavseg.flight.formats.xml_text import MAX_BYTES
from uavseg.flight.mission.mission import Mission
from uavseg.plain_text import cause_of

NAME = "a .kmz of DJI"
TEMPLATE, WAYLINES = "wpmz/template.kml", "wpmz/waylines.wpml"
MAX_MEMBERS = 1000
_NO_DATE = (1980, 1, 1, 0, 0, 0)  # the same mission gives the same bytes


def write_kmz(mission: Mission, options: FileOptions) -> bytes:
    """Write a mission as the content of a .kmz file; raise MissionError if DJI's format cannot hold it."""
    wayline = wayline_of(mission, NAME)
    check_wayline(wayline, NAME)
    model = DJI_MODELS[options.dji_model]
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, write in ((TEMPLATE, template_kml), (WAYLINES, waylines_wpml)):
            member = zipfile.ZipInfo(name, _NO_DATE)
            member.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(member, write(wayline, model))
    return stream.getvalue()


def kmz_losses(mission: Mission, options: FileOptions) -> list[str]:
    """Return what a .kmz cannot hold of a mission, and what the pilot has to know, one sentence each."""
    wayline, home = wayline_of(mission, NAME), mission.home
    model = DJI_MODELS[options.dji_model]
    notes = wayline_losses(mission, wayline, NAME)
    notes.append(
        f"the .kmz is for a {model.name} (--dji-model); it does not hold home: take off at "
        f"{home.lat:.6f},{home.lon:.6f}, from where heights count"
    )
    if any(point.heading_deg is not None and point.heading_deg % 1 for point in wayline.points):
        notes.append("headings are rounded to whole degrees in a .kmz")
    return notes


def read_kmz(content: bytes, name: str) -> Mission:
    """Read the one wayline of a .kmz file as a mission."""
    wayline, notes = read_waylines(_member(content))
    return mission_of_wayline(wayline, name, notes)


def _member(content: bytes) -> bytes:
    """Decompress the document of the wayline, within bounds."""
    try:
        with zipfile.ZipFile(BytesIO(content)) as archive:
            if len(archive.infolist()) > MAX_MEMBERS:
                raise MissionError(f"it holds more than {MAX_MEMBERS} files")
            info = archive.getinfo(WAYLINES)
            if info.compress_type not in {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}:
                raise MissionError("it is compressed otherwise than by deflate")
            with archive.open(info) as member:
                document = member.read(MAX_BYTES + 1)
    except KeyError as error:
        raise MissionError(f"it holds no {WAYLINES}: it is not a mission of DJI") from error
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError) as error:
        raise MissionError(f"it is not a zip archive that can be read: {cause_of(error)}") from error
    if len(document) > MAX_BYTES:
        raise MissionError(f"{WAYLINES} in it has more than {MAX_BYTES:,} bytes")
    return document
