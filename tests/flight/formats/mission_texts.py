"""Content of mission files as text."""

from uavseg.flight.formats.options import FileOptions
from uavseg.flight.formats.plan import write_plan
from uavseg.flight.formats.waypoints import write_waypoints
from uavseg.flight.mission.mission import Mission


def plan_text(mission: Mission, editable: bool = False) -> str:
    return write_plan(mission, FileOptions(editable)).decode()


def waypoints_text(mission: Mission) -> str:
    return write_waypoints(mission, FileOptions()).decode()
