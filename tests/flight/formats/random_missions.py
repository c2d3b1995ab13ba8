"""Random missions near Sydney: with everything that a mission can hold, and those that a route can hold."""

from dataclasses import replace

from hypothesis import strategies as st

from tests.flight.fences import fences, rally_points
from uavseg.flight.mission.items import (
    AUTOPILOTS,
    CAMERA_DISTANCE,
    CHANGE_SPEED,
    FRAME_AMSL,
    FRAME_MISSION,
    FRAME_RELATIVE,
    FRAME_TERRAIN,
    IMAGE_START,
    IMAGE_STOP,
    LAND,
    LOITER_TIME,
    LOITER_TURNS,
    MIN_PHOTO_STEP,
    MIN_SPEED_M_S,
    MOUNT_CONTROL,
    RETURN,
    ROI_LOCATION,
    ROI_NONE,
    SPLINE_WAYPOINT,
    TAKEOFF,
    WAYPOINT,
    HomePosition,
    MissionItem,
)
from uavseg.flight.mission.mission import Mission

HOME = HomePosition(-33.856784123, 151.215296987, 12.5)
numbers = st.floats(-1e4, 1e4)
lats, lons = st.floats(-33.9, -33.8), st.floats(151.1, 151.3)
heights = st.floats(0.5, 400)
headings = st.none() | st.floats(0.5, 359.5)
homes = st.builds(
    HomePosition, st.floats(-33.87, -33.83), st.floats(151.15, 151.25), st.sampled_from([0.0, 12.5, 431.25])
)

ORDERS = [RETURN, CHANGE_SPEED, CAMERA_DISTANCE, MOUNT_CONTROL]


def places(commands: list[int], frames: list[int]) -> st.SearchStrategy[MissionItem]:
    params = st.tuples(numbers, numbers, numbers, st.none() | numbers)
    classes = st.sampled_from(commands), st.sampled_from(frames)
    spots = st.builds(MissionItem, *classes, params, lats, lons, heights, st.booleans())
    return spots.map(_valid)


def _valid(item: MissionItem) -> MissionItem:
    """Only headings may be unset."""
    if item.command in {WAYPOINT, LAND, TAKEOFF} or item.params[3] is not None:
        return item
    return replace(item, params=(*item.params[:3], 0.0))


photo_steps = numbers.filter(lambda value: not 0 < value < MIN_PHOTO_STEP)  # no camera is faster
speed_orders = numbers.filter(lambda value: not 0 < value < MIN_SPEED_M_S)
orders = st.builds(
    MissionItem,
    st.sampled_from(ORDERS),
    st.just(FRAME_MISSION),
    st.tuples(photo_steps, speed_orders, numbers, numbers),
)


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    """Any mission that its autopilot takes."""
    autopilot = draw(st.sampled_from(list(AUTOPILOTS)))
    others = autopilot != "ardupilot"
    commands = [WAYPOINT, LOITER_TIME, LAND, TAKEOFF, SPLINE_WAYPOINT] + [LOITER_TURNS] * (not others)
    frames = [FRAME_RELATIVE, FRAME_AMSL] + [FRAME_TERRAIN] * (not others)
    spots = places(commands, frames)
    items = draw(st.lists(st.one_of(spots, orders), max_size=12))
    items.insert(draw(st.integers(0, len(items))), draw(places([WAYPOINT], frames)))
    shapes, rally = draw(fences), draw(rally_points)
    return Mission(draw(homes), tuple(items), autopilot, fence=tuple(shapes), rally=tuple(rally))


takeoffs = st.floats(2, 300)
speeds, pitches = st.floats(0.5, 15), st.floats(-90, 0)
steps = st.builds(
    lambda command, values: {
        CHANGE_SPEED: MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, values[0], -1.0, 0.0)),
        MOUNT_CONTROL: MissionItem(MOUNT_CONTROL, FRAME_MISSION, (values[1], 0.0, 0.0, 0.0), altitude_m=2.0),
        CAMERA_DISTANCE: MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (values[2], 0.0, 1.0, 0.0)),
        0: MissionItem(CAMERA_DISTANCE, FRAME_MISSION, (0.0, 0.0, 0.0, 0.0)),
        IMAGE_START: MissionItem(IMAGE_START, FRAME_MISSION, (0.0, 0.0, 1.0, 0.0)),
        1: MissionItem(IMAGE_START, FRAME_MISSION, (0.0, values[2], 0.0, 0.0)),
        IMAGE_STOP: MissionItem(IMAGE_STOP, FRAME_MISSION),
        ROI_LOCATION: MissionItem(
            ROI_LOCATION, FRAME_RELATIVE, lat=-33.85, lon=151.2 + values[2] / 1e4, altitude_m=values[0]
        ),
        ROI_NONE: MissionItem(ROI_NONE, FRAME_MISSION),
    }[command],
    st.sampled_from(
        [CHANGE_SPEED, MOUNT_CONTROL, CAMERA_DISTANCE, 0, IMAGE_START, 1, IMAGE_STOP, ROI_LOCATION, ROI_NONE]
    ),
    st.tuples(speeds, pitches, st.floats(1, 50)),
)


@st.composite
def routes(draw: st.DrawFn) -> Mission:
    """Missions along waypoints, as planners write them, which DJI's and Litchi's files can hold.

    Waypoints are 200 m apart, and heights below 500 m.
    """
    home = draw(homes)
    count = draw(st.integers(2, 12))
    items = [
        MissionItem(
            TAKEOFF, FRAME_RELATIVE, (0.0, 0.0, 0.0, None), home.lat, home.lon, draw(st.floats(2, 300))
        ),
        MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, draw(speeds), -1.0, 0.0)),
    ]
    if draw(st.booleans()):
        pitch = (draw(pitches), 0.0, 0.0, 0.0)
        items.append(MissionItem(MOUNT_CONTROL, FRAME_MISSION, pitch, altitude_m=2.0))
    for number in range(count):
        lat, lon = (
            home.lat + 0.002 * (number % 4),
            home.lon + 0.002 * (number // 4) + draw(st.floats(0, 1e-4)),
        )
        params = (draw(st.sampled_from([0.0, 2.5])), 0.0, 0.0, draw(headings))
        sea_m = home.altitude_m if draw(st.booleans()) else None
        height = draw(heights)
        frame = FRAME_RELATIVE if sea_m is None else FRAME_AMSL
        items.append(MissionItem(WAYPOINT, frame, params, lat, lon, height + (sea_m or 0.0)))
        items += draw(st.lists(steps, max_size=3, unique_by=lambda item: item.command))
    ending = draw(st.sampled_from([RETURN, LAND, None]))
    if ending == RETURN:
        items.append(MissionItem(RETURN, FRAME_MISSION))
    elif ending == LAND:
        items.append(MissionItem(LAND, FRAME_RELATIVE, (0.0, 0.0, 0.0, None)))
    return Mission(home, tuple(items), "px4")
