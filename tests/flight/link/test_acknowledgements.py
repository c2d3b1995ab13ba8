"""How an upload ends: acknowledgements, refusals, and what the vehicle holds afterwards."""

from dataclasses import replace

import pytest

from tests.flight.link.link_missions import survey
from tests.flight.link.network import GROUND, Network, linked, messages
from tests.flight.link.transfers import AUTOPILOTS, VEHICLES, sent_to
from tests.flight.link.vehicles import (
    ArduPilot,
    FakeVehicle,
    Item,
    Px4,
)
from uavseg.errors import LinkError, UnverifiedError
from uavseg.flight.link.messages import Result
from uavseg.flight.link.missions import upload_mission


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
