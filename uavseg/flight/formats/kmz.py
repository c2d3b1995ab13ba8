"""DJI's .kmz files: a zip archive with the two documents of a wayline (WPML)."""

import math
import zipfile
import zlib
from collections.abc import Iterator
from io import BytesIO

from uavseg.errors import MissionError
from uavseg.flight.camera.camera import cameras
from uavseg.flight.formats import wpml
from uavseg.flight.formats.kml import MAX_BYTES
from uavseg.flight.formats.options import DJI_MODELS, TURN_THROUGH, DjiModel, FileOptions
from uavseg.flight.formats.wayline import Wayline, mission_of_wayline, wayline_losses, wayline_of
from uavseg.flight.mission.mission import Mission
from uavseg.plain_text import cause_of

NAME = "a .kmz of DJI"
TEMPLATE, WAYLINES = "wpmz/template.kml", "wpmz/waylines.wpml"
MAX_MEMBERS = 1000
FLY_WAYPOINTS = 99  # controllers with DJI Fly have crashed with more
_NO_DATE = (1980, 1, 1, 0, 0, 0)  # the same mission gives the same bytes


def write_kmz(mission: Mission, options: FileOptions) -> bytes:
    """Write a mission as the content of a .kmz file; raise MissionError if DJI's format cannot hold it.

    So it is if the mission is planned for a camera that the aircraft does not carry.
    """
    wayline = wayline_of(mission, NAME)
    wpml.check_wayline(wayline, NAME)
    _check_camera(mission, options.model)
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, write in ((TEMPLATE, wpml.template_kml), (WAYLINES, wpml.waylines_wpml)):
            member = zipfile.ZipInfo(name, _NO_DATE)
            member.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(member, write(wayline, options))
    return stream.getvalue()


def _check_camera(mission: Mission, model: DjiModel) -> None:
    """Refuse a camera of the catalogue that the aircraft certainly does not carry."""
    # Those of other makers, and Zenmuse of DJI, can be mounted where cameras are exchangeable.
    if mission.photos is None or mission.photos.camera not in cameras():
        return
    camera = mission.photos.camera.name
    if model.exchangeable:
        carried = camera.startswith("DJI Zenmuse") or not camera.startswith("DJI ")
    else:
        carried = not model.cameras or camera in model.cameras
    if not carried:
        carriers = ", ".join(key for key, one in DJI_MODELS.items() if camera in one.cameras)
        other = f"; --dji-model {carriers} carries it" if carriers else ""
        raise MissionError(
            f"the mission is planned for the camera {camera}, which a {model.name} (--dji-model) does not "
            f"carry: it has {' and '.join(model.cameras)}{other}"
        )


def kmz_losses(mission: Mission, options: FileOptions) -> list[str]:
    """Return what a .kmz cannot hold of a mission, and what the pilot has to know, one sentence each."""
    wayline, home, model = wayline_of(mission, NAME), mission.home, options.model
    notes = wayline_losses(mission, wayline, NAME)
    stops = ", which stops at every waypoint, for seconds that the estimate does not count (--turn)"
    notes.append(
        f"the .kmz is for a {model.name} (--dji-model){stops * (options.turn != TURN_THROUGH)}; it does not "
        f"hold home: take off at {home.lat:.6f},{home.lon:.6f}, from where heights count"
    )
    if any(point.heading_deg is not None and point.heading_deg % 1 for point in wayline.points):
        notes.append("headings are rounded to whole degrees in a .kmz")
    if options.turn == TURN_THROUGH:
        notes.append(
            f"with --turn through the aircraft turns up to {wpml.TURN_M:g} m before waypoints, and leaves "
            f"the legs there by up to {wpml.TURN_M / 2:g} m: keep more than that from zones"
        )
    if "visible" in options.lenses and "zoom" in model.lenses:
        notes.append(
            f"a {model.name} takes photographs of visible light with the lens that is in view: choose the "
            "wide one before the flight"
        )
    photos = mission.photos
    if photos is not None and photos.camera in cameras() and photos.camera.name not in model.cameras:
        notes.append(
            f"the mission is planned for the camera {photos.camera.name}, and the .kmz is for the camera of "
            f"a {model.name}: make sure that both show the same ground"
        )
    return [*notes, *(_fly_notes(wayline, model) if model.is_for_fly else ())]


def _fly_notes(wayline: Wayline, model: DjiModel) -> Iterator[str]:
    """Yield what the pilot has to do in DJI Fly, which does not open files of others."""
    yield (
        "DJI Fly opens only its own missions: save one there, and replace its .kmz by this one under its "
        f"name; set the return height in DJI Fly to {wpml.return_height_m(wayline):g} m at least, as the "
        "file does not hold it"
    )
    if model.note:
        yield model.note
    steps = [point.interval_s or point.trigger_m / point.flown_m_s for point in wayline.points]
    intervals = [step for step in steps[:-1] if step > 0]
    if intervals:
        yield (
            "DJI Fly does not trigger the camera between waypoints: start its timed shot by hand at the "
            f"first line, with an interval of {math.floor(10 * min(intervals)) / 10:g} s or the next shorter "
            "one, and stop it after the last"
        )
    if len(wayline.points) > FLY_WAYPOINTS:
        yield (
            f"{len(wayline.points)} waypoints: controllers with DJI Fly have crashed with more than "
            f"{FLY_WAYPOINTS}; split the mission (--max-items {FLY_WAYPOINTS})"
        )


def read_kmz(content: bytes, name: str) -> Mission:
    """Read the one wayline of a .kmz file as a mission."""
    wayline, notes = wpml.read_waylines(_member(content))
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
