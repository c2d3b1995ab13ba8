"""Options of missions: how to fly, what to keep away from; and of plan."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

from uavseg.options import texts
from uavseg.options.option import Options, argument, group, option
from uavseg.options.running import JobOptions, OverwriteOptions, output_option

if TYPE_CHECKING:
    from uavseg.flight.camera.camera import Camera
    from uavseg.flight.mission.vehicle import Vehicle

Home = tuple[float, ...] | Literal["auto"]
Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None
AUTOPILOTS = ("ardupilot", "px4", "generic")
SEVERAL_PATHS: dict[str, Any] = {"multiple": True, "parse": texts.or_none, "metavar": "PATH", "basic": True}
DEM: dict[str, Any] = {"multiple": True, "parse": texts.or_none, "metavar": "DEM.tif"}


class FlightOptions(Options):
    """Flight."""

    altitude: float | None = option(
        "Height of the flight above home, or with --dem above the ground, in metres.",
        metavar="M",
        basic=True,
        label="Height of the flight",
    )
    home: Home | None = option(
        "Where the vehicle starts, and metres above the sea; auto: outside of regions and zones.",
        metavar="LAT,LON[,M]|auto",
        parse=texts.home,
        basic=True,
        label="Home",
    )
    pattern: str | None = option(
        "A point in each region, its outline, parallel lines over it, lines along its middle, or a circle "
        "around it.  [visit, or survey with --spacing or a camera]",
        choices=("visit", "perimeter", "survey", "corridor", "orbit"),
        basic=True,
        label="Pattern",
    )
    spacing: float | None = option(
        "Metres between the lines of a survey or corridor.", metavar="M", label="Between lines"
    )
    angle: float | Literal["auto"] = option(
        "Azimuth of the lines, clockwise from north; auto: the one of the least time.",
        default="auto",
        metavar="DEG|auto",
        parse=texts.number_or("auto", "auto", "--angle is a number of degrees or auto"),
        label="Direction of lines",
    )
    speed: float = option("Metres per second.", default=5.0, metavar="M_S", basic=True, label="Speed in m/s")
    wind: float | Sequence[float] | None = option(
        "Wind to plan and estimate for, and the azimuth in degrees that it comes from; by default any.  "
        "[default: estimates are for calm air, and flights with --endurance are divided for 5 m/s]",
        metavar="M_S[,FROM]",
        parse=texts.numbers("--wind is M_S or M_S,FROM, such as 6 or 6,270"),
        label="Wind in m/s",
    )
    autopilot: str = option(
        "What the mission is for; generic: any, with what ArduPilot and PX4 both accept.",
        default="ardupilot",
        choices=AUTOPILOTS,
        basic=True,
        label="Autopilot",
    )
    tolerance: float | None = option(
        "How far outlines may be moved to save corners.  [default: 1 m, or a pixel where larger]", metavar="M"
    )
    vehicle: str | os.PathLike[str] | Vehicle | None = option(
        "What flies, for estimates of time and energy: accelerations, speeds, power and battery. "
        "[default: a multirotor with the parameters of its autopilot]",
        metavar="FILE.json",
        label="Vehicle",
    )


class PhotoOptions(Options):
    """Photographs."""

    camera: str | os.PathLike[str] | Camera | None = option(
        "Photograph with this camera: spacing, trigger distance and the highest speed follow. "
        "uavseg cameras lists them.",
        metavar="NAME|FILE.json",
        basic=True,
        label="Camera",
    )
    gsd: float | None = option(
        "Ground sampling distance, in place of --altitude: centimetres per pixel.",
        metavar="CM",
        basic=True,
        label="Ground sampling distance in cm",
    )
    overlap: Sequence[float] = option(
        "Overlap of photographs along lines and between them, in per cent.",
        default=(75.0, 70.0),
        metavar="FRONT,SIDE",
        parse=texts.numbers("--overlap is FRONT,SIDE in per cent, such as 75,70"),
        shown="75,70",
        basic=True,
        label="Overlap",
    )
    gimbal_pitch: float | Sequence[float] = option(
        "Where the camera looks: -90 is down. A survey with several, as -90,-60, sees all from four sides.",
        default=-90.0,
        metavar="DEG[,DEG]",
        parse=texts.numbers("--gimbal-pitch is degrees, or several between commas, such as -90,-60"),
    )
    sensor: Sequence[float] | None = option(
        "In place of --camera: its sensor in millimetres.",
        metavar="WxH",
        parse=texts.numbers("--sensor is WIDTHxHEIGHT, such as 13.2x8.8", 2, separator="x"),
    )
    image: Sequence[float] | None = option(
        "With --sensor: the image in pixels.",
        metavar="WxH",
        parse=texts.numbers("--image is WIDTHxHEIGHT, such as 13.2x8.8", 2, separator="x"),
    )
    focal: float | None = option("With --sensor: the focal length.", metavar="MM")
    min_interval: float | None = option(
        "With --sensor: shortest time between photographs; it limits the speed.  [default: 0]", metavar="S"
    )
    trigger: str | None = option(
        "Photographs by distance, by time, in hover at a waypoint for each, or not by the mission.  "
        "[default: distance; hover on a visit]",
        choices=("distance", "interval", "hover", "none"),
        label="Photographs",
    )
    shutter: float | None = option(
        "Exposure time in seconds, such as 1/1000, by which motion blur limits the speed.  [default: 1/1000]",
        metavar="1/S|S",
        parse=texts.shutter,
    )


class PatternOptions(Options):
    """Patterns."""

    margin: float | None = option(
        "Survey, corridor: regions are grown by it before they are covered. Orbit: distance of the circle "
        "from the region.  [default: 0]",
        metavar="M",
    )
    width: float | None = option(
        "Corridor: width of lines in REGIONS.  [default: half of the spacing, for one line of flight]",
        metavar="M",
    )
    crosshatch: bool = option(
        "Survey: once more, in lines at a right angle to the first.",
        default=False,
        label="Survey twice, at a right angle",
    )
    turnaround: float | None = option(
        "Survey: straight on without photographs before and after each line, for fixed wings.", metavar="M"
    )
    offset: float | None = option(
        "Perimeter: distance outward from the outline, negative inward.  [default: 0]", metavar="M"
    )
    min_leg: float | None = option(
        "Perimeter: no leg is shorter.  [default: what is flown in a second]", metavar="M"
    )
    holes: str | None = option(
        "Perimeter: whether the outlines of holes are flown.  [default: skip]", choices=("skip", "fly")
    )
    hold: float | None = option("Visit: seconds over each region.  [default: 0]", metavar="S")


class TerrainOptions(Options):
    """Terrain."""

    dem: Paths = option(
        "Fly --altitude above the ground of this elevation model, not above home; may be repeated, for a "
        "mosaic.",
        label="Elevation model",
        **DEM,
    )
    terrain: str | None = option(
        "Heights above the sea or above home from --dem, with points added where the ground bends; frame: "
        "above the terrain that the vehicle knows itself (ArduPilot).  [absolute with --dem]",
        choices=("frame", "absolute", "relative"),
        label="Heights with an elevation model",
    )
    terrain_tolerance: float | None = option(
        "How far the height above the ground may differ.  [default: 5, or a quarter of the height]",
        metavar="M",
    )
    climb: float | None = option(
        "How fast the vehicle climbs in forward flight; steeper legs are flown slower.  "
        "[default: 2.5, or 3 for px4]",
        metavar="M_S",
    )
    descent: float | None = option("How fast it descends.  [default: 1.5]", metavar="M_S")


class SafetyOptions(Options):
    """Safety."""

    avoid: Any = option(
        "Keep-out zones that no leg enters: a file of polygons, lines and points, or a range of intensity "
        "that is looked for in the raster. May be given several times.",
        default=(),
        metavar="FILE|LO,HI",
        multiple=True,
        parse=texts.zones,
        basic=True,
        label="Keep-out zones",
    )
    avoid_margin: float = option(
        "Least distance to keep-out zones.", default=10.0, metavar="M", label="Distance to keep-out zones"
    )
    zone_width: float = option(
        "Width of lines and diameter of points in files of --avoid; --avoid-margin comes on top.",
        default=10.0,
        metavar="M",
        label="Width of lines and points that are zones",
    )
    zone_height: float | None = option(
        "How high all zones are above home: a flight that is higher by their margin, and by 5 m, may pass "
        "over them.  [default: they reach to the sky]",
        metavar="M",
        label="Height of keep-out zones",
    )
    allow_edge: bool = option(
        "Fly over regions that touch the edge of the raster all the same; they may go on beyond it, or be a "
        "collar.",
        default=False,
        label="Fly over regions at the edge of the raster",
    )
    max_altitude: float | None = option(
        "Refuse to fly higher above home, or above the ground where it is known.",
        default=120.0,
        metavar="M",
        label="Highest above home",
    )
    max_distance: float | None = option(
        "Refuse to fly farther from home.", metavar="M", label="Farthest from home"
    )
    fence: float | None = option(
        "Write a fence so far around each flight, which excludes keep-out zones.",
        default=50.0,
        metavar="M|none",
        parse=texts.number_or("none", None, "--fence is a number of metres or none"),
        shown="50",
        label="Fence in metres",
    )
    rally: Sequence[Sequence[float]] = option(
        "A place to return to in an emergency, with a height above home. May be given several times.",
        default=(),
        metavar="LAT,LON,M",
        multiple=True,
        parse=texts.each(texts.numbers("--rally is LAT,LON,M in degrees and metres", 3)),
    )


class LimitOptions(Options):
    """Batteries."""

    endurance: float | None = option(
        "Minutes in the air on a full battery: the mission is divided into flights that fit.",
        metavar="MIN",
        label="Minutes in the air",
    )
    reserve: float = option(
        "Part of the endurance that is left at the end of each flight.",
        default=20.0,
        metavar="PERCENT",
        label="Reserve in per cent",
    )
    max_items: int | None = option(
        "Items of a flight at most: the mission is divided likewise.  [default: 650 for ardupilot, else 500]",
        metavar="N",
    )
    max_waypoints: int | None = option(
        "Waypoints of a flight at most: the mission is divided likewise.  [default: 99 for a .csv of Litchi]",
        metavar="N",
    )
    flights: int | None = option(
        "Divide into so many flights of like length.  [default: the fewest that fit]",
        metavar="N",
        label="Flights",
    )
    vehicles: int = option(
        "Divide for so many vehicles in the air at once: each has its own part of the area and its own "
        "height, 5 m above the one before, and all take about as long.",
        default=1,
        metavar="N",
        label="Vehicles at once",
    )


class MissionFileOptions(Options):
    """Mission files."""

    editable: bool = option(
        "In a .plan, survey items that QGroundControl can edit where a part is convex; the same flight.",
        default=False,
        python=False,
        label="Survey items that QGroundControl can edit",
    )
    dji_model: str = option(
        "The aircraft of a .kmz: m3e, m3t, m3m, m4e, m4t, m30, m30t, m3d, m3td, m300-h20, m350-h30 ..., or "
        "for DJI Fly mini4pro, mini5pro, air3, air3s, mavic3 ...",
        default="m3e",
        metavar="NAME",
        python=False,
    )
    lens: str | None = option(
        "Lenses of a .kmz that photograph, of wide, zoom, ir, visible and narrow_band.  [default: all of the "
        "aircraft that serve for maps]",
        metavar="NAME,NAME,...",
        python=False,
    )
    turn: str = option(
        "In a .kmz: stop at waypoints, or fly through them, which cuts corners by up to a metre.",
        default="stop",
        choices=("stop", "through"),
        python=False,
    )


class MissionOptions(Options):
    """Mission."""

    flight: FlightOptions = group(FlightOptions)
    photos: PhotoOptions = group(PhotoOptions)
    pattern: PatternOptions = group(PatternOptions)
    terrain: TerrainOptions = group(TerrainOptions)
    safety: SafetyOptions = group(SafetyOptions)
    limits: LimitOptions = group(LimitOptions)
    files: MissionFileOptions = group(MissionFileOptions)


class PlanOptions(JobOptions):
    """Regions."""

    regions: str = argument("REGIONS", required=True)
    output: str = output_option("The mission: .plan, .waypoints, .kmz, .csv, .kml or .geojson.", "PATH")
    mission: MissionOptions = group(MissionOptions)
    ids: Sequence[int] | None = option(
        "Only the regions with these ids.", metavar="N,N,...", parse=texts.ids, basic=True
    )
    largest: int | None = option(
        "Only the N largest.", minimum=1, metavar="N", basic=True, label="Only the largest"
    )
    where: str | None = option(
        'Only regions that fulfil it, as in "mean > 0.7 and area_m2 > 500". A comparison with a missing '
        "number is neither true nor false, so != and not do not select it either.",
        metavar="CONDITION",
        basic=True,
        label="Only regions where",
    )
    classes: str | Sequence[str] | None = option(
        "Fly over regions of this class only. May be given several times.",
        "--class",
        multiple=True,
        parse=texts.or_none,
        metavar="NAME",
    )
    avoid_classes: str | Sequence[str] = option(
        "Regions of this class are keep-out zones. May be given several times.",
        "--avoid-class",
        default=(),
        multiple=True,
        metavar="NAME",
    )
    raster: Any = option(
        "Where ranges of --avoid are looked for, and at whose edge no region may lie; see --allow-edge.",
        metavar="PATH",
        label="Raster of the regions",
    )
    layer: str | None = option("The layer of a file that has several.", metavar="NAME")
    as_json: bool = option(
        "Write the estimates as JSON, for programs.", "--json", default=False, python=False, basic=True
    )
    footprints: bool = option(
        "With --json: also what ground each photograph shows, four corners (lon, lat) in degrees.",
        default=False,
        python=False,
    )
    files: OverwriteOptions = group(OverwriteOptions, overwrite={"help": "Replace a mission that is there."})
