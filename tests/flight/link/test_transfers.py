"""Missions that go there and back, whatever the network loses."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from tests.flight.link.link_missions import FENCE, HOME, RALLY, fenced, looped, survey
from tests.flight.link.network import GROUND, Network, linked
from tests.flight.link.transfers import AUTOPILOTS, LOSSES, VEHICLES, during_upload, rows, sent_to
from tests.flight.link.vehicles import (
    MISSION_MESSAGES,
    ArduPilot,
    FakeVehicle,
    Generic,
    Item,
    Px4,
)
from uavseg.errors import LinkError
from uavseg.flight.link.link import Link
from uavseg.flight.link.missions import download_mission, upload_mission
from uavseg.flight.mission.items import (
    FRAME_TERRAIN,
    HomePosition,
    MissionItem,
)


@pytest.mark.slow
@pytest.mark.parametrize("make", VEHICLES)
@pytest.mark.parametrize("how", LOSSES, ids=lambda how: f"{how['loss']:.0%}")
@pytest.mark.parametrize(
    "seed", [1, pytest.param(2, marks=pytest.mark.slow), pytest.param(3, marks=pytest.mark.slow)]
)
def test_500_items_arrive_whatever_the_network_loses(
    make: type[FakeVehicle], how: dict[str, float], seed: int
) -> None:
    mission = survey(500, AUTOPILOTS[make])
    vehicle, warnings = sent_to(make, mission, seed=seed, **how)
    known = [HOME, *mission.items] if make is ArduPilot else list(mission.items)
    assert len(vehicle.stored[0]) == len(known)
    for item, (_, x, y, z) in zip(known, rows(vehicle), strict=True):
        if isinstance(item, HomePosition) or item.has_position:
            assert (x, y) == (round(item.lat * 1e7), round(item.lon * 1e7))
            assert z == pytest.approx(item.altitude_m, abs=0.0101)
    assert [row[0] for row in rows(vehicle)] == [getattr(item, "command", 16) for item in known]
    assert not warnings


@pytest.mark.parametrize("make", VEHICLES)
@pytest.mark.parametrize("how", LOSSES, ids=lambda how: f"{how['loss']:.0%}")
def test_a_mission_with_a_fence_comes_back_equal(make: type[FakeVehicle], how: dict[str, float]) -> None:
    for mission in (fenced(survey(30, AUTOPILOTS[make])), looped(AUTOPILOTS[make])):
        vehicle, warnings = sent_to(make, mission, seed=7, **how)
        assert not warnings
        assert [item.command for item in vehicle.stored[1]] == [5001] * 4 * len(mission.fence[:1]) + [
            5002
        ] * 3 * len(mission.fence[:1]) + [5004] * len(mission.fence[:1])
        found = download_mission(linked(Network([vehicle], seed=8, **how)))
        assert found.fence == mission.fence and found.rally == mission.rally
        assert found.autopilot == mission.autopilot or make is Generic
        assert len(found.items) == len(mission.items)
        for mine, theirs in zip(mission.items, found.items, strict=True):
            assert (theirs.command, theirs.frame) == (mine.command, mine.frame)
            assert theirs.lat == pytest.approx(mine.lat, abs=1e-7)
            assert theirs.lon == pytest.approx(mine.lon, abs=1e-7)
            assert theirs.altitude_m == pytest.approx(mine.altitude_m, abs=0.0101)
            if mine.command != 21:  # ArduPilot tells a direction of landing
                assert theirs.params == mine.params


@pytest.mark.parametrize("make", VEHICLES)
def test_nothing_but_heartbeats_and_the_mission_protocol_is_sent(make: type[FakeVehicle]) -> None:
    vehicle, _ = sent_to(make, fenced(survey(30, AUTOPILOTS[make])), seed=3, loss=0.2)
    download_mission(linked(Network([vehicle])))
    assert vehicle.seen <= MISSION_MESSAGES
    assert vehicle.currents == {0, 1}


def test_jumps_lead_to_the_same_item_with_a_home_row_and_without() -> None:
    for make, target in ((ArduPilot, 2), (Px4, 1)):
        vehicle, _ = sent_to(make, looped(AUTOPILOTS[make]))
        [jump] = [item for item in vehicle.stored[0] if item.command == 177]
        assert jump.params[:2] == (target, 3)
        assert (vehicle.stored[0][target].x, vehicle.stored[0][target].z) == (470010000, 450)


def test_home_is_replaced_by_the_vehicle_and_read_from_it() -> None:
    vehicle = ArduPilot(Item(16, 0, (0.0,) * 4, 470000001, 80000009, 410.25))
    mission = survey()
    assert not upload_mission(linked(Network([vehicle])), mission)
    found = download_mission(linked(Network([vehicle])))
    assert found.home == HomePosition(47.0000001, 8.0000009, 410.25)
    assert replace(found, home=HOME).items[:2] == mission.items[:2]


def test_home_comes_from_a_message_or_from_the_first_item_with_a_note() -> None:
    vehicle = Px4(home=(47.01, 8.01, 399.0))
    upload_mission(linked(Network([vehicle])), survey(autopilot="px4"))
    found = download_mission(linked(Network([vehicle])))
    assert found.home == HomePosition(47.01, 8.01, 399.0) and not found.notes
    vehicle.home = None
    found = download_mission(linked(Network([vehicle])))
    assert (found.home.lat, found.home.lon, found.home.altitude_m) == (47.0, 8.0, 0.0)
    assert "home" in found.notes[0]
    unset = ArduPilot(Item(16, 0, (0.0,) * 4, 0, 0, 0.0))
    upload_mission(linked(Network([unset])), survey())
    assert "home" in download_mission(linked(Network([unset]))).notes[0]


def test_a_fence_that_the_mission_does_not_have_is_kept_with_a_warning() -> None:
    vehicle, _ = sent_to(Px4, fenced(survey(autopilot="px4")))
    warnings = upload_mission(linked(Network([vehicle])), survey(autopilot="px4"))
    assert warnings == (
        "the vehicle keeps its fence (8 items): the mission has none",
        "the vehicle keeps its rally points (2 items): the mission has none",
    )
    assert len(vehicle.stored[1]) == 8


@pytest.mark.parametrize("make", VEHICLES)
@pytest.mark.parametrize("mode", [128, 128 | 8 | 1, 255])  # alone, with guided and custom mode, all flags
def test_nothing_is_sent_to_an_armed_vehicle(make: type[FakeVehicle], mode: int) -> None:
    vehicle = make(armed=True)
    vehicle.armed_mode = mode
    with pytest.raises(LinkError, match=r"is armed and may be flying: nothing was sent to it.*--while-armed"):
        upload_mission(linked(Network([vehicle])), fenced(survey(autopilot=AUTOPILOTS[make])))
    assert vehicle.seen <= {"HEARTBEAT"} and vehicle.stored == {0: [], 1: [], 2: []}


def test_an_armed_vehicle_gets_its_mission_where_that_is_allowed() -> None:
    vehicle = ArduPilot(armed=True)
    [warning] = upload_mission(linked(Network([vehicle])), survey(), while_armed=True)
    assert "armed" in warning and len(vehicle.stored[0]) == 13


def test_the_last_heartbeat_of_the_autopilot_says_whether_it_is_armed() -> None:
    vehicle = ArduPilot(armed=True)
    network = Network([vehicle])
    link = linked(network)
    vehicle.armed = False
    link.next_message(network.now() + 3, none_expected=True)
    assert upload_mission(link, survey()) == ()
    vehicle.armed = True
    link.next_message(network.now() + 3, none_expected=True)
    with pytest.raises(LinkError, match="armed"):
        upload_mission(link, survey())


def test_a_heartbeat_of_another_component_does_not_say_whether_the_motors_are_armed() -> None:
    vehicle = ArduPilot(armed=True)
    network = Network([vehicle])
    link = linked(network)
    other = common.MAVLink(
        SimpleNamespace(write=lambda data: network.post(GROUND, bytes(data), "vehicles")), vehicle.system, 100
    )
    for _ in range(5):
        other.heartbeat_send(2, vehicle.autopilot, 0, 0, 4)
    with pytest.raises(LinkError, match="armed"):
        upload_mission(link, survey())


def test_a_vehicle_that_is_armed_during_an_upload_gets_no_further_list() -> None:
    vehicle = ArduPilot()
    network = Network([vehicle], latency_s=0.3)
    during_upload(network, lambda: setattr(vehicle, "armed", True))
    with pytest.raises(LinkError, match=r"armed after its fence had been sent.*nothing more was sent"):
        upload_mission(linked(network), fenced(survey()))
    assert len(vehicle.stored[1]) == 8 and not vehicle.stored[0] and not vehicle.stored[2]


@pytest.mark.parametrize("make", VEHICLES)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["z", "param1"])
def test_a_vehicle_that_holds_no_number_is_not_called_equal(
    make: type[FakeVehicle], value: float, field: str
) -> None:
    class Wrong(make):  # type: ignore[valid-type,misc]
        def item_message(self, item: Item, number: int, *rest: Any) -> None:
            changes = {"z": value} if field == "z" else {"params": (value, *item.params[1:])}
            super().item_message(replace(item, **changes), number, *rest)

    with pytest.raises(LinkError, match=f"item [01]: .* {value:g} .*instead of "):
        sent_to(Wrong, survey(autopilot=AUTOPILOTS[make]))


@pytest.mark.parametrize("make", VEHICLES)
def test_where_a_mission_waits_is_compared_and_ardupilot_goes_on_with_a_note(make: type[FakeVehicle]) -> None:
    mission = survey(12, AUTOPILOTS[make])
    items = (*mission.items[:4], replace(mission.items[4], autocontinue=False), *mission.items[5:])
    waiting = replace(mission, items=items)
    vehicle, told = sent_to(make, waiting)
    held = download_mission(linked(Network([vehicle])))
    if make is ArduPilot:
        note = "the vehicle keeps autocontinue of item 5 as 1 instead of 0: it does not wait there"
        assert note in told and all(item.autocontinue for item in held.items)
    else:
        assert not any("autocontinue" in text for text in told)
        assert [item.autocontinue for item in held.items] == [item.autocontinue for item in items]
        assert any("item 5 has autocontinue 0: the vehicle waits there" in note for note in held.warnings)


def test_progress_never_exceeds_the_total_and_ends_there() -> None:
    seen: list[tuple[int, int]] = []
    vehicle = ArduPilot()
    link = linked(Network([vehicle], loss=0.2, seed=4))
    upload_mission(link, fenced(survey(40)), lambda done, total: seen.append((done, total)))
    assert {total for _, total in seen} == {2 * (8 + 2 + 41)}
    assert seen[-1][0] == seen[-1][1] and max(done for done, _ in seen) == seen[-1][0]


def test_terrain_heights_go_there_and_back() -> None:
    mission = survey()
    high = replace(mission.items[4], frame=FRAME_TERRAIN)
    mission = replace(mission, items=(*mission.items[:4], high, *mission.items[5:]))
    vehicle, _ = sent_to(ArduPilot, mission)
    assert [item.frame for item in vehicle.stored[0]].count(10) == 1
    found: tuple[MissionItem, ...] = download_mission(linked(Network([vehicle]))).items
    assert found[4].frame == FRAME_TERRAIN


def test_an_interrupted_transfer_releases_the_vehicle() -> None:
    vehicle = Px4()
    network = Network([vehicle])
    link: Link = linked(network)

    def interrupt() -> None:
        raise KeyboardInterrupt

    during_upload(network, interrupt)
    with pytest.raises(KeyboardInterrupt):
        upload_mission(link, survey(autopilot="px4"))
    network.before_delivery = lambda to, data: True
    link.next_message(network.now() + 0.1)
    assert vehicle.upload is None and not vehicle.stored[0]


def test_the_fence_goes_first() -> None:
    order: list[int] = []

    class Noting(ArduPilot):
        def on_mission_count(self, message: Any, sender: tuple[int, int]) -> None:
            order.append(message.mission_type)
            super().on_mission_count(message, sender)

    sent_to(Noting, replace(survey(), fence=FENCE, rally=RALLY))
    assert order == [1, 2, 0]
