"""Files for DJI Fly: the dialect of its own missions, and what the pilot has to do there."""

import warnings
import xml.etree.ElementTree as ET
import zipfile
from io import BytesIO
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from tests.flight.formats.random_missions import routes
from tests.flight.formats.test_kmz import SURVEY, UP, mission_of
from tests.flight.mission_items import waypoint
from uavseg.errors import ParameterError
from uavseg.flight.formats import files
from uavseg.flight.formats.kmz import kmz_losses, write_kmz
from uavseg.flight.formats.options import DJI_MODELS, TURNS, FileOptions
from uavseg.flight.mission.items import CHANGE_SPEED, FRAME_MISSION, IMAGE_START, MissionItem
from uavseg.flight.mission.mission import Mission
from uavseg.jobs.flights.check import CheckRequest, check

KML, FLY = "{http://www.opengis.net/kml/2.2}", "{http://www.uav.com/wpmz/1.0.2}"
MODELS = [key for key, model in DJI_MODELS.items() if model.is_for_fly]
CONFIG = (
    *("flyToWaylineMode", "finishAction", "exitOnRCLost", "executeRCLostAction", "globalTransitionalSpeed"),
    "droneInfo",
)
HEADING = (
    *("waypointHeadingMode", "waypointHeadingAngle", "waypointPoiPoint", "waypointHeadingAngleEnable"),
    *("waypointHeadingPathMode", "waypointHeadingPoiIndex"),
)


def roots(mission: Mission, model: str = "mini4pro", turn: str = "stop") -> tuple[ET.Element, ET.Element]:
    content = write_kmz(mission, FileOptions(dji_model=model, turn=turn))
    with zipfile.ZipFile(BytesIO(content)) as made:
        assert made.namelist() == ["wpmz/template.kml", "wpmz/waylines.wpml"]
        template, waylines = (ET.fromstring(made.read(name)) for name in made.namelist())
    return template, waylines


def names(element: ET.Element | None) -> tuple[str, ...]:
    assert element is not None
    return tuple(one.tag.removeprefix(FLY) for one in element)


def notes(mission: Mission, model: str = "mini4pro") -> str:
    return "\n".join(kmz_losses(mission, FileOptions(dji_model=model)))


def test_all_aircraft_of_dji_fly_are_there() -> None:
    minis, mavics = {"mini4pro", "mini5pro", "mini3pro"}, {"mavic3", "mavic3classic", "mavic3pro"}
    assert set(MODELS) == minis | mavics | {"air3", "air3s"}


@pytest.mark.parametrize("model", MODELS)
def test_files_are_as_the_app_writes_them(model: str) -> None:
    template, waylines = roots(SURVEY, model)
    assert names(template[0]) == ("author", "createTime", "updateTime", "missionConfig")
    assert template.findtext(f".//{FLY}author") == "fly"
    for root in (template, waylines):
        config = root.find(f".//{FLY}missionConfig")
        assert names(config) == CONFIG
        drone = root.find(f".//{FLY}droneInfo")
        assert names(drone) == ("droneEnumValue", "droneSubEnumValue")
        assert root.findtext(f".//{FLY}executeRCLostAction") == "goBack"
    assert not list(template.iter(f"{KML}Placemark"))
    assert waylines.findtext(f".//{FLY}executeHeightMode") == "relativeToStartPoint"
    placemarks = list(waylines.iter(f"{KML}Placemark"))
    assert [one.findtext(f"{FLY}index") for one in placemarks] == ["0", "1", "2", "3"]
    for one in placemarks:
        assert names(one.find(f"{FLY}waypointHeadingParam")) == HEADING
        assert (
            one.findtext(f"{FLY}waypointHeadingParam/{FLY}waypointPoiPoint") == "0.000000,0.000000,0.000000"
        )
        assert names(one.find(f"{FLY}waypointGimbalHeadingParam")) == (
            *("waypointGimbalPitchAngle", "waypointGimbalYawAngle"),
        )
    assert "payloadInfo" not in ET.tostring(waylines, encoding="unicode")


@pytest.mark.slow
@given(mission=routes(), model=st.sampled_from(MODELS), turn=st.sampled_from(TURNS))
@settings(max_examples=50)
def test_actions_are_those_at_waypoints_alone(mission: Mission, model: str, turn: str) -> None:
    waylines = roots(mission, model, turn)[1]
    assert {one.tag.partition("}")[0] + "}" for one in waylines.iter()} == {KML, FLY}
    assert {one.text for one in waylines.iter(f"{FLY}actionTriggerType")} <= {"reachPoint"}
    assert {one.text for one in waylines.iter(f"{FLY}actionActuatorFunc")} <= {
        *("gimbalRotate", "hover", "takePhoto"),
    }
    for group in waylines.iter(f"{FLY}actionGroup"):
        assert group.findtext(f"{FLY}actionGroupStartIndex") == group.findtext(f"{FLY}actionGroupEndIndex")
    assert "payloadLensIndex" not in ET.tostring(waylines, encoding="unicode")


def test_the_interval_to_set_by_hand_is_said() -> None:
    assert "an interval of 1.6 s or the next shorter one" in notes(SURVEY)  # 12.5 m at 7.5 m/s
    fast = mission_of(
        MissionItem(CHANGE_SPEED, FRAME_MISSION, (1.0, 5.0, -1.0, 0.0)),
        waypoint(47.001),
        MissionItem(IMAGE_START, FRAME_MISSION, (0.0, 3.0, 0.0, 0.0)),
        waypoint(47.002),
    )
    assert "an interval of 3 s or" in notes(fast)
    assert "timed shot" not in notes(mission_of(waypoint(47.001), waypoint(47.002)))


def test_a_series_that_begins_at_the_last_waypoint_is_none() -> None:
    series = MissionItem(IMAGE_START, FRAME_MISSION, (0.0, 3.0, 0.0, 0.0))
    assert "timed shot" not in notes(mission_of(waypoint(47.001), waypoint(47.002), series))


def test_what_the_pilot_has_to_set_is_said() -> None:
    low = mission_of(waypoint(47.001), waypoint(47.002, altitude_m=72.5))
    assert "return height in DJI Fly to 72.5 m at least" in notes(low)
    assert "replace its .kmz by this one" in notes(low)
    many = mission_of(*(waypoint(47 + n / 10_000) for n in range(1, 101)))
    assert "100 waypoints" in notes(many) and "99" in notes(many)
    assert "crashed" not in notes(low)
    assert "flies no waypoint missions" in notes(low, "mini3pro")
    assert "not published" in notes(low, "air3s") and "not published" not in notes(low, "mini5pro")


@pytest.mark.parametrize("model", MODELS)
def test_a_lens_is_chosen_in_the_app(model: str) -> None:
    with pytest.raises(ParameterError, match="leave --lens out"):
        FileOptions(dji_model=model, lens="wide")


def test_a_file_is_checked_and_read_back(tmp_path: Path) -> None:
    path = tmp_path / "fly.kmz"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        files.write_mission(SURVEY, path, dji_model="mini5pro")
    assert any("DJI Fly opens only" in str(one.message) for one in caught)
    found = check(path, CheckRequest())
    assert found.problems == ()
    places = [(item.lat, item.lon) for item in found.mission.items if item.command == 16]
    assert places == [(47.001, 8.0), (47.002, 8.0), (47.002, 8.001), (47.001, 8.001)]
    assert found.mission.items[0].altitude_m == UP.altitude_m  # the app climbs to the first waypoint
