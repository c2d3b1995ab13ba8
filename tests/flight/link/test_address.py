"""Addresses of vehicles."""

import pytest

from uavseg.errors import ParameterError
from uavseg.flight.link.transport import parse_address
from uavseg.jobs.flights.link import download


@pytest.mark.parametrize(
    ("text", "place", "number"),
    [
        ("udpout:192.168.4.1:14550", "192.168.4.1", 14550),
        ("udpin::14550", "", 14550),
        ("udpin:0.0.0.0:14550", "0.0.0.0", 14550),
        ("tcp:drone.local:5760", "drone.local", 5760),
        ("tcp:[::1]:5760", "::1", 5760),
        ("serial:/dev/ttyUSB0:115200", "/dev/ttyUSB0", 115200),
        ("serial:/dev/serial/by-id/usb-a:b", "/dev/serial/by-id/usb-a:b", 57600),
        ("serial:COM7", "COM7", 57600),
        (" udpout:a:1 ", "a", 1),
    ],
)
def test_an_address_names_a_place_and_a_port_or_a_speed(text: str, place: str, number: int) -> None:
    address = parse_address(text)
    assert (address.scheme, address.place, address.number) == (text.strip().split(":")[0], place, number)
    assert parse_address(f"{address.scheme}:{address.place}:{address.number}") == address


@pytest.mark.parametrize(
    "text",
    [
        *("", "drone", "udp:1.2.3.4:5", "udpout:1.2.3.4", "udpout::14550", "udpout:a:0", "udpout:a:65536"),
        *("tcp:a:x", "serial:", "udpout:", "tcp:a:-1", "tcp:a:\u0661", "/dev/ttyUSB0", "http://a:80"),
    ],
)
def test_what_is_no_address_is_refused_with_the_forms(text: str) -> None:
    with pytest.raises(ParameterError, match=r"udpout:HOST:PORT, .* not '"):
        download(text)


@pytest.mark.parametrize("timeout_s", [0.0, -1.0, 601.0, *map(float, ("nan", "inf", "-inf"))])
def test_a_timeout_is_positive_and_bounded(timeout_s: float) -> None:
    with pytest.raises(ParameterError, match="timeout"):
        download("udpout:a:1", timeout_s)
