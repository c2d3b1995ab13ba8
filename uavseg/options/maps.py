"""Options of the jobs over occupancy maps, and regions: classify, path, recognise, simulate, ..."""

from __future__ import annotations

from collections.abc import Sequence

from uavseg.options import running, texts
from uavseg.options.flights import AUTOPILOTS, Home
from uavseg.options.option import Options, argument, group, option
from uavseg.options.reading import MAP_STRETCH, ONLY_RASTERS, ReadOptions
from uavseg.options.regions import DivisionOptions, RangeOptions
from uavseg.options.running import StorageOptions, TiledJobOptions, VerbosityOptions, output_option

MODES = ("trinary", "scale", "raw")
Ends = tuple[float, float]


class ModeOptions(Options):
    """ROS maps."""

    mode: str | None = option(
        "How the picture of a ROS map is to be read: three states; or all levels, as a .png (scale) or a "
        ".pgm of per cent (raw).",
        choices=MODES,
        shown="trinary",
        python=False,
    )


class ClassifyOptions(TiledJobOptions):
    """States."""

    path: str = argument("MAP", required=True)
    output: str | None = output_option(
        "The states: .tif, or .yaml for a ROS map with a .pgm beside it.  [default: STEM.states.tif here]",
        "PATH",
        required=False,
    )
    objects: str | None = option(
        "Also write what is occupied, object by object: .geojson, .gpkg, .fgb, .parquet, .shp or .kml; - is "
        "GeoJSON on stdout.",
        metavar="PATH",
        python=False,
        basic=True,
    )
    labels: str | None = option(
        "Also write the ids of the objects as a raster: one .tif, or a .vrt over a folder of tiles.",
        metavar="PATH",
        python=False,
    )
    mode: ModeOptions = group(
        ModeOptions,
        mode={
            "default": "trinary",
            "shown": "",
            "help": "How the picture of a ROS map is to be read; for scale it is a .png.",
        },
    )
    free_below: float = option(
        "Free is what has at most this v.", default=0.498, metavar="V", basic=True, label="Free up to v"
    )
    occupied_above: float = option(
        "Occupied is what has a larger v.", default=0.502, metavar="V", basic=True, label="Occupied above v"
    )
    refine: str = option(
        "Whether the borders of states are found to the cell, or stay those of blocks.",
        default="scan",
        choices=("scan", "none"),
        label="Borders of states",
    )
    min_area: float | str | None = option(
        "Drop objects of less; states stay as they are.",
        metavar="M2|Nha|Npx",
        basic=True,
        label="Smallest object (m², or cells as 5px)",
    )
    allow_lost_obstacles: bool = option(
        "Write states in which obstacles of the map have no occupied cell, instead of refusing.",
        default=False,
        label="Write states in which obstacles are lost",
    )
    simplify: float | None = option(
        "Simplify the outlines of objects.", metavar="METRES", label="Simplify outlines of objects within"
    )
    read: ReadOptions = group(ReadOptions, *ONLY_RASTERS, **MAP_STRETCH)
    division: DivisionOptions = group(DivisionOptions, method={"basic": True})
    creation: StorageOptions = group(StorageOptions)


class PathOptions(TiledJobOptions):
    """Path."""

    map_: str = argument("MAP", required=True)
    ranges: RangeOptions = group(
        RangeOptions,
        range={
            "help": "What is passable in v, such as 0,0.45.",
            "multiple": False,
            "parse": texts.range_named("--range"),
        },
    )
    start: Ends = option(
        "In the map's coordinates (lon,lat if those are).",
        required=True,
        metavar="X,Y",
        parse=texts.numbers("--start is X,Y in the map's coordinates, such as 12.5,40", 2),
        basic=True,
    )
    goal: Ends = option(
        "Where to.",
        required=True,
        metavar="X,Y",
        parse=texts.numbers("--goal is X,Y in the map's coordinates, such as 12.5,40", 2),
        basic=True,
    )
    clearance: float = option(
        "Metres from the centre of a cell to everything else.  [default: none]",
        default=0.0,
        metavar="M",
        shown="-",
        basic=True,
        label="Clearance",
    )
    smooth: bool = option(
        "Pull the path tight, at any angle.",
        default=False,
        basic=True,
        label="Pull the path tight, at any angle",
    )
    output: str = output_option(
        "The path: .geojson (- too), Nav2's waypoints .yaml, a mission .plan, .waypoints, .kmz, .csv, .kml.",
        "PATH",
    )
    refine: str | None = option(
        "What makes a region: cells by their own value, or as in the paper by the mean of their block too.",
        choices=("pixels", "scan"),
        shown="pixels; with --method paper scan",
        label="Regions",
    )
    altitude: float | None = option(
        "For a mission: metres above home.", metavar="M", python=False, basic=True
    )
    home: Home | None = option(
        "For a mission: where the vehicle takes off; auto: the start.",
        metavar="LAT,LON[,M]|auto",
        parse=texts.home,
        python=False,
        basic=True,
    )
    speed: float = option("For a mission.", default=5.0, metavar="M_S", python=False)
    autopilot: str = option("For a mission.", default="ardupilot", choices=AUTOPILOTS, python=False)
    read: ReadOptions = group(ReadOptions, *ONLY_RASTERS, **MAP_STRETCH)
    division: DivisionOptions = group(DivisionOptions)


class DescribeOptions(TiledJobOptions):
    """Description."""

    source: str = argument("REGIONS|MAP", required=True)
    output: str | None = output_option(
        "The regions with their measures: .gpkg, .geojson, .fgb, .parquet, .shp or .kml.", "PATH"
    )
    raster: str | None = option("Of REGIONS: measure texture and bands too.", metavar="RASTER", basic=True)
    layer: str | None = option("The layer of REGIONS, if the file has several.", metavar="NAME")
    gap: float = option("Of MAP: join objects nearer than this.", default=0.0, metavar="METRES", basic=True)
    min_area: float | str | None = option(
        "Of MAP: leave out objects of less.", metavar="M2|Nha|Npx", basic=True
    )
    read: ReadOptions = group(ReadOptions, *ONLY_RASTERS, "index", "expr", "band_names", **MAP_STRETCH)


class RecogniseOptions(DescribeOptions):
    """Recognition."""

    output: str | None = output_option(
        "The regions with their names: .gpkg, .geojson, .fgb, .parquet, .shp or .kml.", "PATH", required=False
    )
    library: str = option("Examples, with a column 'name'.", required=True, metavar="LIBRARY", basic=True)
    learn: str | None = option("Add examples of this name to the library.", metavar="NAME", basic=True)
    ids: Sequence[int] | None = option(
        "With --learn: which regions.", metavar="N,N,...", parse=texts.ids, basic=True
    )
    min_probability: float = option("Below it: 'cannot tell'.", default=0.5, metavar="P", basic=True)


class NextViewOptions(TiledJobOptions):
    """Views."""

    map_: str = argument("MAP", required=True)
    pose: tuple[float, ...] = option(
        "Where the robot is, in the map's coordinates, and where it looks, counterclockwise from the x axis.",
        required=True,
        metavar="X,Y[,DEG]",
        parse=texts.numbers("--pose is X,Y or X,Y,HEADING, such as 12.5,40"),
        basic=True,
    )
    range: float = option("How far the sensor sees.", required=True, metavar="M", basic=True)
    fov: float = option("Its field of view.", default=360.0, metavar="DEG", basic=True)
    count: int = option("Return at most N views.", default=5, minimum=1, metavar="N", basic=True)
    clearance: float = option(
        "From the robot's centre to everything that is not free.", default=0.0, metavar="M", basic=True
    )
    free_below: float = option("Free is what has at most this v.", default=0.498, metavar="V")
    occupied_above: float = option("Occupied is what has a larger v.", default=0.502, metavar="V")
    output: str = output_option("The views and the ways to them: .geojson; - is GeoJSON on stdout.", "PATH")
    read: ReadOptions = group(ReadOptions, *ONLY_RASTERS, **MAP_STRETCH)


class ExploreOptions(running.JobOptions):
    """Drive."""

    scene: str = argument("lens|circles|SCENE.json|MAP", required=True)
    output: str = output_option("The drive, a line, and its views: .geojson; - is GeoJSON on stdout.", "PATH")
    table: str | None = option(
        "Its scans: place, metres, cells that are known.", metavar="PATH.csv", python=False, basic=True
    )
    map: str | None = option(
        "The map that the robot made: .tif (probabilities), or .yaml (ROS map).",
        metavar="MAP",
        python=False,
        basic=True,
    )
    animation: str | None = option(
        "The map while the robot drives, as moving pictures.", metavar="PATH.gif", python=False, basic=True
    )
    start: tuple[float, ...] | None = option(
        "Where it begins, and where it looks.  [default: the scene's first pose]",
        metavar="X,Y[,DEG]",
        parse=texts.numbers("--start is X,Y or X,Y,HEADING, such as 12.5,40"),
        basic=True,
    )
    range: float | None = option("How far the sensor sees.  [default: the scene's]", metavar="M", basic=True)
    fov: float | None = option("Its field of view.  [default: the scene's]", metavar="DEG", basic=True)
    sigma: float | None = option("Standard deviation of ranges.  [default: the scene's]", metavar="M")
    step: float | None = option("Between beams.  [default: the scene's]", metavar="DEG")
    clearance: float = option(
        "From the robot's centre to everything that is not free.", default=0.0, metavar="M", basic=True
    )
    seed: int = option("Of the noise; same seed, same drive.", default=0, minimum=0)
    files: running.OverwriteOptions = group(running.OverwriteOptions)


class BuildMapOptions(Options):
    """Bag."""

    bag: str = argument("BAG", required=True)
    output: str = output_option("The map.", "PATH.yaml|PATH.tif")
    mode: ModeOptions = group(ModeOptions, mode={"basic": True})
    scan: str = option(
        "Of sensor_msgs/LaserScan, MultiEchoLaserScan or PointCloud2.",
        default="/scan",
        metavar="TOPIC",
        basic=True,
    )
    odom: str | None = option(
        "Poses from nav_msgs/Odometry.  [default: /odom, unless --tf is given]", metavar="TOPIC", basic=True
    )
    tf: bool = option("Poses from the tree of /tf and /tf_static.", default=False, basic=True)
    resolution: float = option("Side of a cell.", default=0.05, metavar="M", basic=True)
    sigma: float = option("Standard deviation of ranges.", default=0.03, metavar="M")
    max_range: float | None = option(
        "Use beams up to here.  [default: the range_max of each scan]", metavar="M"
    )
    heights: Ends | None = option(
        "Of point clouds: what lies between these metres above the map's frame is an obstacle.",
        metavar="LO,HI",
        parse=texts.numbers("--heights is LO,HI in metres, such as 0.1,1.8", 2),
    )
    no_return: str = option(
        "What a range is where nothing returned: inf alone, or range_max too.",
        default="inf",
        choices=("inf", "range_max"),
    )
    beam_order: str | None = option(
        "What counts where the sign of angle_increment contradicts the angles.  [default: neither]",
        choices=("angles", "increment"),
    )
    creation: StorageOptions = group(StorageOptions)
    files: running.OverwriteOptions = group(running.OverwriteOptions)
    messages: VerbosityOptions = group(VerbosityOptions)


class MergeMapsOptions(running.JobOptions):
    """Merging."""

    maps: tuple[str, ...] = argument("MAP...", multiple=True, required=True)
    output: str = output_option("The map.", "PATH.yaml|PATH.tif")
    crop: bool = option("End the map where nothing beyond is known.", default=False, basic=True)
    unrotate: bool = option("Let rows run along the x axis: a yaw of 0.", default=False, basic=True)
    resolution: float | None = option(
        "Side of a cell.  [default: that of the first map]", metavar="M", basic=True
    )
    mode: ModeOptions = group(ModeOptions, mode={"basic": True})
    creation: StorageOptions = group(StorageOptions)
    files: running.OverwriteOptions = group(running.OverwriteOptions)


class MaskOptions(running.JobOptions):
    """Mask."""

    regions: str = argument("REGIONS", required=True)
    map: str = option("The map whose cells the mask has.", required=True, metavar="MAP", basic=True)
    output: str = output_option("The mask, with a .pgm and a .params.yaml beside it.", "PATH.yaml")
    speed: int | None = option(
        "A mask of speed: in the regions at most so much of the robot's largest speed.  [default: keep out]",
        metavar="PER_CENT",
        basic=True,
    )
    layer: str | None = option("The layer of REGIONS, if the file has several.", metavar="NAME")
    files: running.OverwriteOptions = group(running.OverwriteOptions)


class SimulateOptions(Options):
    """Sensor."""

    scene: str = argument("lens|circles|SCENE.json", required=True)
    output: str = output_option("The map: .tif (probabilities), or .yaml (ROS map).", "MAP", python=True)
    png: str | None = option(
        "The map as a picture: free black, unknown grey, occupied white.", metavar="PATH.png", basic=True
    )
    truth: str | None = option(
        "What the scene really is: states, solid, visible.", metavar="PATH.tif", basic=True
    )
    seed: int = option("Of the noise; same seed, same map.", default=0, minimum=0, basic=True)
    sigma: float | None = option(
        "Standard deviation of ranges.  [default: the scene's]", metavar="M", basic=True
    )
    max_range: float | None = option(
        "How far the sensor sees.  [default: the scene's]", metavar="M", basic=True
    )
    fov: float | None = option("Its field of view.  [default: the scene's]", metavar="DEG", basic=True)
    step: float | None = option("Between beams.  [default: the scene's]", metavar="DEG", basic=True)
    poses: int | None = option("Scan from the first N poses only.", minimum=1, metavar="N", basic=True)
    creation: StorageOptions = group(StorageOptions)
    files: running.OverwriteOptions = group(running.OverwriteOptions)
    messages: VerbosityOptions = group(VerbosityOptions)


def sensor_changes(options: ExploreOptions | SimulateOptions, range_m: float | None) -> dict[str, float]:
    """Return what is asked for of the range finder of a scene, by the names of its parameters."""
    given = {
        "max_range_m": range_m,
        "fov_deg": options.fov,
        "sigma_m": options.sigma,
        "step_deg": options.step,
    }
    return {name: value for name, value in given.items() if value is not None}
