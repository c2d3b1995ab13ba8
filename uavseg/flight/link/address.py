"""Addresses of vehicles: udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT, serial:DEVICE[:BAUD]."""

from dataclasses import dataclass

from uavseg.errors import ParameterError
from uavseg.plain_text import shown

KINDS = ("udpout", "udpin", "tcp", "serial")
DEFAULT_BAUD = 57600  # of telemetry radios; over USB it has no effect
_EXPECTED = "udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE[:BAUD]"


@dataclass(frozen=True, slots=True)
class Address:
    """Where a vehicle is reached.

    Parameters
    ----------
    kind : "udpout", "udpin", "tcp" or "serial"
    place : str
        Name or IP address of a host, or path of a serial device.
    number : int
        Port of the host, or baud rate of the device.
    """

    kind: str
    place: str
    number: int

    def __str__(self) -> str:
        return f"{self.kind}:{self.place}:{self.number}"


def parse_address(text: str) -> Address:
    """The address that a text names.

    Raises
    ------
    ParameterError
        If it names none.

    Examples
    --------
    >>> parse_address("udpout:192.168.4.1:14550")
    Address(kind='udpout', place='192.168.4.1', number=14550)
    >>> parse_address("serial:/dev/ttyUSB0").number
    57600
    """
    kind, _, rest = text.strip().partition(":")
    if kind not in KINDS or not rest:
        hint = "; udpin listens, udpout speaks first" if kind == "udp" else ""
        raise ParameterError(f"a vehicle's address is {_EXPECTED}, not {shown(text)}{hint}")
    place, colon, number = rest.rpartition(":")
    if kind == "serial" and not (colon and number.isdecimal()):
        return Address(kind, rest, DEFAULT_BAUD)
    maximum = 65535 if kind != "serial" else 10_000_000
    is_number = number.isascii() and number.isdecimal() and 0 < int(number) <= maximum
    if not is_number or (not place and kind != "udpin"):
        raise ParameterError(f"a vehicle's address is {_EXPECTED}, not {shown(text)}")
    return Address(kind, place.removeprefix("[").removesuffix("]"), int(number))
