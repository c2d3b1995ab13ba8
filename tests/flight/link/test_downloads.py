"""Missions read from a vehicle: what is missing, changes meanwhile, or is not safe."""

from dataclasses import replace
from typing import Any

import pytest

from tests.flight.link.link_missions import fenced, survey
from tests.flight.link.network import GROUND, Network, linked, messages
from tests.flight.link.transfers import VEHICLES, sent_to
from tests.flight.link.vehicles import (
    ArduPilot,
    Generic,
    Item,
    Px4,
)
from uavseg.errors import LinkError, MissionError
from uavseg.flight.link.messages import Result
from uavseg.flight.link.missions import download_mission
from uavseg.flight.mission.items import (
    CONDITION_GATE,
    FRAME_MISSION,
    LOITER_TURNS,
    MissionItem,
)


def test_a_vehicle_without_a_mission_says_so() -> None:
    for make in VEHICLES:
        with pytest.raises(MissionError, match="holds no mission"):
            download_mission(linked(Network([make()])))


def test_a_return_point_of_a_fence_gives_a_note() -> None:
    vehicle, _ = sent_to(ArduPilot, fenced(survey()))
    vehicle.stored[1].append(Item(5000, 0, (0.0,) * 4, 470000000, 80000000, 0.0))
    found = download_mission(linked(Network([vehicle])))
    assert found.fence == fenced(survey()).fence
    assert found.notes == ("the return point of the fence was not read",)


def test_a_mission_of_a_generic_vehicle_is_read_as_one_for_the_autopilot_whose_rules_it_keeps() -> None:
    gate = MissionItem(CONDITION_GATE, FRAME_MISSION, (0.0,) * 4)
    mission = survey(autopilot="px4")
    loiter = replace(mission.items[2], command=LOITER_TURNS, params=(1.0, 0.0, 0.0, 0.0))
    for items, autopilot in (
        (mission.items, "generic"),
        ((*mission.items, loiter), "ardupilot"),
        ((*mission.items, gate), "px4"),
    ):
        vehicle, _ = sent_to(Generic, replace(mission, items=items, autopilot=autopilot))
        found = download_mission(linked(Network([vehicle])))
        assert found.autopilot == autopilot
        assert any("generic" in note for note in found.notes) == (autopilot != "generic")
    vehicle.stored[0][3] = replace(vehicle.stored[0][3], frame=10)  # which PX4 refuses, as ArduPilot the gate
    with pytest.raises(MissionError, match="cannot be used: item 13: ArduPilot does not know command 4501"):
        download_mission(linked(Network([vehicle])))


def test_a_vehicle_without_fences_gives_a_note() -> None:
    class Simple(ArduPilot):
        def on_mission_request_list(self, message: Any, sender: tuple[int, int]) -> None:
            if message.mission_type:
                self.ack(sender, Result.UNSUPPORTED, message.mission_type)
            else:
                super().on_mission_request_list(message, sender)

    vehicle, warnings = sent_to(Simple, survey())
    assert not warnings
    notes = download_mission(linked(Network([vehicle]))).notes
    assert [note.split(":")[0] for note in notes] == [
        "the fence of the vehicle could not be read",
        "the rally points of the vehicle could not be read",
    ]


def test_a_download_that_the_vehicle_stops_is_begun_again() -> None:
    vehicle, _ = sent_to(Px4, survey(40, "px4"))
    network = Network([vehicle])
    link = linked(network)
    stops = iter([10, 20])
    due = [next(stops)]

    def stop(to: str, data: bytes) -> bool:
        for message in messages(data) if to != GROUND else []:
            if message.get_type() == "MISSION_REQUEST_INT" and due and message.seq == due[0]:
                due[:] = [n for n in [next(stops, None)] if n is not None]
                assert isinstance(vehicle, Px4)
                vehicle.sending = None
                vehicle.ack((255, link.component), Result.ERROR, 0)
        return True

    network.before_delivery = stop
    found = download_mission(link).items
    assert [item.altitude_m for item in found] == [item.altitude_m for item in survey(40, "px4").items]


def test_a_mission_that_changes_while_it_is_read_is_refused() -> None:
    vehicle, _ = sent_to(ArduPilot, survey(40))
    network = Network([vehicle])
    link = linked(network)

    def change(to: str, data: bytes) -> bool:
        for message in messages(data) if to != GROUND else []:
            if message.get_type() == "MISSION_REQUEST_INT" and message.seq == 9 and message.mission_type == 0:
                vehicle._mav.mission_count_send(255, link.component, 3, 0)
        return True

    network.before_delivery = change
    with pytest.raises(LinkError, match="changes while it is read"):
        download_mission(link)


def test_a_mission_that_would_not_be_safe_is_refused() -> None:
    vehicle, _ = sent_to(ArduPilot, survey())
    vehicle.stored[0][5].z = 5000.0
    with pytest.raises(MissionError, match=r"what the vehicle holds cannot be used: altitude is 5000 m"):
        download_mission(linked(Network([vehicle])))
    vehicle, _ = sent_to(Px4, fenced(survey(autopilot="px4")))
    vehicle.stored[1].pop(2)
    with pytest.raises(MissionError, match="cannot be used: a fence polygon of the vehicle has 3 of 4"):
        download_mission(linked(Network([vehicle])))
