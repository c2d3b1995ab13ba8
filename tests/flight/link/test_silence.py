"""Vehicles that fall silent or make no progress: a transfer ends in time and says where."""

from typing import Any

import pytest

from tests.flight.link.link_missions import survey
from tests.flight.link.network import GROUND, Network, linked, messages
from tests.flight.link.transfers import AUTOPILOTS, VEHICLES
from tests.flight.link.vehicles import (
    ArduPilot,
    FakeVehicle,
    Px4,
)
from uavseg.errors import LinkError, UnverifiedError
from uavseg.flight.link.messages import Result
from uavseg.flight.link.missions import upload_mission


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
