"""Transfers over a network in virtual time: loss, refusals, silence, others in between."""

from dataclasses import replace
from typing import Any

import pytest

from tests.flight.link.link_missions import FENCE, HOME, RALLY, fenced, looped, survey
from tests.flight.link.network import GROUND, GroundStation, Network, linked, messages
from tests.flight.link.vehicles import (
    MISSION_MESSAGES,
    ArduPilot,
    FakeVehicle,
    Generic,
    Item,
    Px4,
)
from uavseg.errors import LinkError, MissionError, UnverifiedError
from uavseg.flight.items import (
    CONDITION_GATE,
    FRAME_MISSION,
    FRAME_TERRAIN,
    LOITER_TURNS,
    HomePosition,
    MissionItem,
)
from uavseg.flight.link.download import download_mission
from uavseg.flight.link.link import Link
from uavseg.flight.link.results import Result
from uavseg.flight.link.upload import upload_mission
from uavseg.flight.mission import Mission

VEHICLES: list[type[FakeVehicle]] = [ArduPilot, Px4, Generic]
AUTOPILOTS = {ArduPilot: "ardupilot", Px4: "px4", Generic: "px4"}
LOSSES = [
    {"loss": 0.0},
    {"loss": 0.05, "duplicates": 0.05, "reordered": 0.05},
    {"loss": 0.2, "duplicates": 0.2, "reordered": 0.2},
]


def sent_to(make: type[FakeVehicle], mission: Mission, **how: Any) -> tuple[FakeVehicle, tuple[str, ...]]:
    """A vehicle after an upload, and the warnings."""
    vehicle = make()
    return vehicle, upload_mission(linked(Network([vehicle], **how)), mission)


def rows(vehicle: FakeVehicle, kind: int = 0) -> list[tuple[int, int, int, float]]:
    return [(item.command, item.x, item.y, item.z) for item in vehicle.stored[kind]]


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


# Acknowledgements


class Deaf(Network):
    """A network that drops some messages to the ground."""

    def drop(self, name: str, times: int, **fields: int) -> "Deaf":
        left = [times]

        def keep(to: str, data: bytes) -> bool:
            for message in messages(data) if to == GROUND else []:
                alike = all(getattr(message, field, None) == value for field, value in fields.items())
                if message.get_type() == name and alike and left[0] > 0:
                    left[0] -= 1
                    return False
            return True

        self.before_delivery = keep
        return self


@pytest.mark.parametrize("make", VEHICLES)
@pytest.mark.parametrize("times", [1, 100])
def test_a_lost_last_acknowledgement_is_no_failure(make: type[FakeVehicle], times: int) -> None:
    vehicle, mission = make(), survey(autopilot=AUTOPILOTS[make])
    network = Deaf([vehicle]).drop("MISSION_ACK", times, type=Result.ACCEPTED)
    link = linked(network)
    began = network.now()
    assert not upload_mission(link, mission)
    assert len(vehicle.stored[0]) == len(mission.items) + (make is ArduPilot)
    assert network.now() - began < 15


def test_an_upload_that_a_starting_vehicle_has_no_space_for_is_repeated() -> None:
    vehicle = ArduPilot(boots_s=14.0)
    assert not upload_mission(linked(Network([vehicle])), survey())
    assert len(vehicle.stored[0]) == 13


def test_a_mission_too_large_is_refused_with_what_the_vehicle_says() -> None:
    vehicle = ArduPilot(capacity=10)
    network = Network([vehicle])
    link, began = linked(network), network.now()
    with pytest.raises(LinkError, match=r"13 items of the mission: .*NO_SPACE.*Only 10 items are supported"):
        upload_mission(link, survey())
    assert network.now() - began < 10 and not vehicle.stored[0]


REFUSALS = [Result.UNSUPPORTED, Result.UNSUPPORTED_FRAME, Result.INVALID, Result.INVALID_PARAM5_X]


@pytest.mark.parametrize("make", VEHICLES)
@pytest.mark.parametrize("result", [*REFUSALS, Result.ERROR, Result.DENIED, Result.NO_SPACE])
@pytest.mark.parametrize("number", [0, 5])
def test_a_refusal_names_the_item_and_the_reason(
    make: type[FakeVehicle], result: Result, number: int
) -> None:
    vehicle = make()
    vehicle.refused = {number: result}
    network = Network([vehicle])
    link, began = linked(network), network.now()
    with pytest.raises(LinkError) as refused:
        upload_mission(link, survey(autopilot=AUTOPILOTS[make]))
    said = str(refused.value)
    assert f"refuses item {number} of the mission" in said and f"MAV_MISSION_{result.name})" in said
    assert "(16) in frame" in said or "(22) in frame" in said
    assert ("mix of old and new items" in said) == (make is ArduPilot)
    assert network.now() - began < 6 and not isinstance(refused.value, UnverifiedError)


def test_a_last_item_that_is_refused_is_not_taken_for_a_lost_acknowledgement() -> None:
    for result, words in ((Result.INVALID, "refuses item 11"), (Result.ERROR, "holds 0 items instead of 12")):
        vehicle = Px4()
        vehicle.refused = {11: result}
        with pytest.raises(LinkError, match=words):
            upload_mission(linked(Network([vehicle])), survey(autopilot="px4"))


def test_errors_of_a_vehicle_that_goes_on_are_no_refusal() -> None:
    vehicle = Px4()
    network = Network([vehicle])
    link = linked(network)
    inject = iter([3, 6])
    due = [next(inject)]

    def error_at(to: str, data: bytes) -> bool:
        for message in messages(data) if to == GROUND else []:
            if message.get_type() == "MISSION_REQUEST_INT" and due and message.seq == due[0]:
                due[:] = [n for n in [next(inject, None)] if n is not None]
                vehicle.ack((255, link.component), Result.ERROR, 0)
        return True

    network.before_delivery = error_at
    assert not upload_mission(link, survey(autopilot="px4"))


def test_a_vehicle_that_holds_something_else_afterwards_is_not_verified() -> None:
    class Forgetful(ArduPilot):
        def keep(self, item: Item) -> Item:
            kept = super().keep(item)
            return replace(kept, x=kept.x + 20) if item.command == 16 else kept

    with pytest.raises(LinkError, match=r"does not hold the mission .* item 3: position .* \(and 7 more\)"):
        upload_mission(linked(Network([Forgetful()])), survey())


def test_parameters_that_the_autopilot_does_not_keep_give_a_warning() -> None:
    mission = survey()
    turned = replace(mission.items[3], params=(2.5, 0.0, 0.0, 90.0))
    mission = replace(mission, items=(*mission.items[:3], turned, turned, *mission.items[5:]))
    _, warnings = sent_to(ArduPilot, mission)
    assert warnings == (
        "the vehicle keeps parameter 1 of command 16 as 2 instead of 2.5, and otherwise in 2 items",
        "the vehicle keeps parameter 4 of command 16 as 0 instead of 90, and otherwise in 2 items",
    )


def test_a_trigger_distance_that_is_not_kept_is_a_failure() -> None:
    class Blind(ArduPilot):
        def keep(self, item: Item) -> Item:
            kept = super().keep(item)
            return replace(kept, params=(0.0,) * 4) if item.command == 206 else kept

    with pytest.raises(LinkError, match=r"item 7: parameter 1 is 0 instead of 12\.5"):
        sent_to(Blind, survey())


# Silence


@pytest.mark.parametrize("make", VEHICLES)
@pytest.mark.parametrize("messages_heard", [0, 1, 6, 12, 13, 14, 20])
def test_silence_ends_in_time_and_says_where(make: type[FakeVehicle], messages_heard: int) -> None:
    vehicle = make()
    vehicle.silent_after = messages_heard
    network = Network([vehicle])
    link = linked(network)
    began = network.now()
    with pytest.raises(LinkError) as lost:
        upload_mission(link, survey(autopilot=AUTOPILOTS[make]))
    assert network.now() - began < 31
    last = 13 + (make is ArduPilot)  # messages of an upload: the count and the items
    if messages_heard == 0:
        assert "does not answer to the mission for 10 s" in str(lost.value)
    elif messages_heard < last - 1:
        assert "does not answer" in str(lost.value) or "stopped after" in str(lost.value)
    elif messages_heard == last - 1:
        assert "neither acknowledged nor read back" in str(lost.value)
    assert isinstance(lost.value, UnverifiedError) == (messages_heard >= last)


def test_a_link_without_a_vehicle_ends_in_time() -> None:
    for vehicles in ([], [FakeVehicle()]):
        network = Network(vehicles)
        began = network.now()
        for companion in vehicles:
            companion.autopilot = 8
        with pytest.raises(LinkError, match=r"no vehicle answers at a network within 3 s: "):
            linked(network, 3.0)
        assert network.now() - began == pytest.approx(3.0, abs=0.1)


def test_a_vehicle_that_asks_for_the_same_item_for_ever_does_not_hold_the_upload_up() -> None:
    class Stuck(ArduPilot):
        def on_mission_item_int(self, message: Any, sender: tuple[int, int]) -> None:
            assert self.upload is not None
            self.upload.received_at = self.now
            self.ack(sender, Result.INVALID_SEQUENCE, 0)

    network = Network([Stuck()])
    link, began = linked(network), network.now()
    with pytest.raises(LinkError, match="stopped after 0 of 13 items of the mission: no progress for 10 s"):
        upload_mission(link, survey())
    assert network.now() - began < 60


def test_a_cancelled_upload_is_begun_again() -> None:
    vehicle = ArduPilot()
    network = Network([vehicle])
    link = linked(network, timeout_s=20.0)
    until = network.now() + 8.5

    def cut(to: str, data: bytes) -> bool:
        ours = [one.get_type() for one in messages(data)] if to != GROUND else []
        return not ("MISSION_ITEM_INT" in ours and network.now() < until)

    network.before_delivery = cut
    assert not upload_mission(link, survey())
    assert vehicle.starts >= 2


def test_a_vehicle_that_accepts_but_cannot_be_read_is_unverified() -> None:
    class Mute(Px4):
        def on_mission_request_list(self, message: Any, sender: tuple[int, int]) -> None:
            pass

    with pytest.raises(UnverifiedError, match="accepted the mission, but it could not be read back"):
        upload_mission(linked(Network([Mute()])), survey(autopilot="px4"))
    assert UnverifiedError.exit_code == 3 and LinkError.exit_code == 1


# Others in between


def during_upload(network: Network, act: Any, after: int = 4) -> None:
    """Call something when the link has sent so many items."""
    seen = [0]

    def count(to: str, data: bytes) -> bool:
        seen[0] += to != GROUND and any(one.get_type() == "MISSION_ITEM_INT" for one in messages(data))
        if seen[0] == after:
            seen[0] += 1000
            act()
        return True

    network.before_delivery = count


@pytest.mark.parametrize("make", VEHICLES)
@pytest.mark.parametrize("word", ["mission_count", "mission_clear_all"])
def test_another_ground_station_that_writes_is_noticed(make: type[FakeVehicle], word: str) -> None:
    network = Network([make()])
    link, station = linked(network), GroundStation(network)
    fields = (3, 0) if word == "mission_count" else (0,)
    during_upload(network, lambda: getattr(station.mav, f"{word}_send")(1, 1, *fields))
    with pytest.raises(LinkError, match=r"another ground station \(system 254\) transfers a mission"):
        upload_mission(link, survey(autopilot=AUTOPILOTS[make]))


def test_a_transfer_of_another_ground_station_is_noticed_by_the_requests_of_the_vehicle() -> None:
    vehicle = ArduPilot()
    network = Network([vehicle])
    link, station = linked(network), GroundStation(network)
    station.is_seen = False
    during_upload(network, lambda: vehicle.send_request(254, 190, 0, 0))
    with pytest.raises(LinkError, match=r"another ground station \(system 254\)"):
        upload_mission(link, survey())


def test_a_vehicle_that_is_busy_with_another_upload_denies_ours() -> None:
    vehicle = ArduPilot()
    network = Network([vehicle])
    link, station = linked(network), GroundStation(network)
    station.is_seen = False
    vehicle.give_up_s = 60.0
    vehicle.handle(b"", network.now())
    station.mav.mission_count_send(1, 1, 3, 0)
    link.next_message(network.now() + 0.005, none_expected=True)
    vehicle.send_request = lambda *fields: None  # type: ignore[method-assign]
    with pytest.raises(LinkError, match=r"DENIED|another ground station"):
        upload_mission(link, survey())


def test_ground_stations_that_only_listen_or_read_do_not_disturb() -> None:
    network = Network([ArduPilot()])
    link, station = linked(network), GroundStation(network)

    def read() -> None:
        station.mav.heartbeat_send(6, 8, 0, 0, 4)
        station.mav.mission_request_list_send(1, 1, 0)  # which is denied

    during_upload(network, read)
    assert not upload_mission(link, survey())


def test_a_request_beyond_the_end_is_another_transfer() -> None:
    vehicle = ArduPilot()
    network = Network([vehicle])
    link = linked(network)
    during_upload(network, lambda: vehicle.send_request(255, link.component, 77, 0))
    with pytest.raises(LinkError, match=r"asks for item 77 of 13 .* another transfer"):
        upload_mission(link, survey())


def test_two_vehicles_on_a_link_are_refused_before_anything_is_sent() -> None:
    for other in (Px4(system=2), ArduPilot(system=7)):
        vehicle = ArduPilot()
        with pytest.raises(LinkError, match=r"two vehicles are on the link, systems \d and \d"):
            linked(Network([vehicle, other]))
        assert vehicle.seen | other.seen <= {"HEARTBEAT"}


def test_another_vehicle_that_comes_up_during_a_transfer_is_refused() -> None:
    network = Network([ArduPilot()])
    link = linked(network)
    during_upload(network, lambda: network.vehicles.append(ArduPilot(system=2)))
    with pytest.raises(LinkError, match="systems 1 and 2"):
        upload_mission(link, survey(100))


def test_another_autopilot_or_address_with_the_same_id_is_refused() -> None:
    network = Network([ArduPilot()])
    link = linked(network)
    during_upload(network, lambda: network.vehicles.append(Px4()))
    with pytest.raises(LinkError, match="two vehicles on the link have the system id 1"):
        upload_mission(link, survey(100))
    network = Network([ArduPilot()])
    link, twin = linked(network), ArduPilot()

    def twin_speaks() -> None:
        twin.tick(5.0)
        for data in twin.outbox:
            network.post(GROUND, data, "another address")

    during_upload(network, twin_speaks)
    with pytest.raises(LinkError, match="two vehicles on the link have the system id 1"):
        upload_mission(link, survey(100))


def test_another_system_that_answers_in_place_of_the_vehicle_is_refused() -> None:
    network = Network([ArduPilot()])
    link, stranger = linked(network), GroundStation(network, system=9, component=1)
    during_upload(network, lambda: stranger.mav.mission_request_int_send(255, link.component, 2, 0))
    with pytest.raises(LinkError, match=r"another system \(9\) answers on the link"):
        upload_mission(link, survey())


def test_a_mission_for_another_autopilot_is_refused() -> None:
    for make, autopilot in ((ArduPilot, "px4"), (Px4, "ardupilot")):
        vehicle = make()
        with pytest.raises(MissionError, match=r"the mission is for .* and the vehicle is .*system 1"):
            upload_mission(linked(Network([vehicle])), survey(autopilot=autopilot))
        assert vehicle.seen == {"HEARTBEAT"}
    sent_to(Generic, survey(autopilot="ardupilot"))


# What else the pilot should know


def test_a_fence_that_the_mission_does_not_have_is_kept_with_a_warning() -> None:
    vehicle, _ = sent_to(Px4, fenced(survey(autopilot="px4")))
    warnings = upload_mission(linked(Network([vehicle])), survey(autopilot="px4"))
    assert warnings == (
        "the vehicle keeps its fence (8 items): the mission has none",
        "the vehicle keeps its rally points (2 items): the mission has none",
    )
    assert len(vehicle.stored[1]) == 8


def test_an_armed_vehicle_gives_a_warning() -> None:
    warnings = upload_mission(linked(Network([ArduPilot(armed=True)])), survey())
    assert "armed" in warnings[0]


def test_progress_never_exceeds_the_total_and_ends_there() -> None:
    seen: list[tuple[int, int]] = []
    vehicle = ArduPilot()
    link = linked(Network([vehicle], loss=0.2, seed=4))
    upload_mission(link, fenced(survey(40)), lambda done, total: seen.append((done, total)))
    assert {total for _, total in seen} == {2 * (8 + 2 + 41)}
    assert seen[-1][0] == seen[-1][1] and max(done for done, _ in seen) == seen[-1][0]


# Downloads


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
    with pytest.raises(MissionError, match="cannot be used: ArduPilot does not know command 4501"):
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
