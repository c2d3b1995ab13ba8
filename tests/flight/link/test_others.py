"""Others on the link during a transfer: ground stations, vehicles, other autopilots."""

import pytest

from tests.flight.link.link_missions import survey
from tests.flight.link.network import GROUND, GroundStation, Network, linked
from tests.flight.link.transfers import AUTOPILOTS, VEHICLES, during_upload, sent_to
from tests.flight.link.vehicles import (
    ArduPilot,
    FakeVehicle,
    Generic,
    Px4,
)
from uavseg.errors import LinkError, MissionError
from uavseg.flight.link.missions import upload_mission


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
