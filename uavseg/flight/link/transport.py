"""Transports: UDP, TCP and serial lines that carry bytes to and from a vehicle and never block for long."""

import os
import socket
import threading
import time
from pathlib import Path
from typing import Any, Protocol

from uavseg.dataclass import dataclass
from uavseg.errors import LinkError, ParameterError, caused_errors, named_errors
from uavseg.plain_text import shown

SCHEMES = ("udpout", "udpin", "tcp", "serial")
DEFAULT_BAUD = 57600  # of telemetry radios; over USB it has no effect
_EXPECTED = "udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE[:BAUD]"
SEND_S = 2.0  # a peer that takes no bytes for this long is lost
_BYTES = 65535
Source = Any  # address of UDP from which bytes came; None where there is one peer only
_PATTERNS = ("ttyACM*", "ttyUSB*", "ttyAMA*", "cu.usb*")


@dataclass(frozen=True, slots=True)
class Address:
    """Address of a vehicle."""

    scheme: str  # "udpout", "udpin", "tcp" or "serial"
    place: str  # name or IP address of a host, or path of a serial device
    number: int  # port of the host, or baud rate of the device

    def __str__(self) -> str:
        return f"{self.scheme}:{self.place}:{self.number}"


def parse_address(text: str) -> Address:
    """Parse the address of a vehicle; ParameterError if the text is not an address.

    Examples
    --------
    >>> parse_address("udpout:192.168.4.1:14550")
    Address(scheme='udpout', place='192.168.4.1', number=14550)
    >>> parse_address("serial:/dev/ttyUSB0").number
    57600
    """
    scheme, _, rest = text.strip().partition(":")
    if scheme not in SCHEMES or not rest:
        hint = "; udpin listens, udpout speaks first" if scheme == "udp" else ""
        raise ParameterError(f"a vehicle's address is {_EXPECTED}, not {shown(text)}{hint}")
    place, colon, number = rest.rpartition(":")
    if scheme == "serial" and not (colon and number.isdecimal()):
        return Address(scheme, rest, DEFAULT_BAUD)
    maximum = 65535 if scheme != "serial" else 10_000_000
    is_number = number.isascii() and number.isdecimal() and 0 < int(number) <= maximum
    if not is_number or (not place and scheme != "udpin"):
        raise ParameterError(f"a vehicle's address is {_EXPECTED}, not {shown(text)}")
    return Address(scheme, place.removeprefix("[").removesuffix("]"), int(number))


class Transport(Protocol):
    """Carrier of bytes."""

    is_datagram: bool = False  # whether each piece that arrives holds whole messages
    trouble: str = ""  # what the system reported last, such as a refused connection
    _port: Any

    def send(self, data: bytes) -> None:
        """Send bytes; may lose them."""

    def receive(self, timeout_s: float) -> tuple[bytes, Source] | None:
        """Return the next piece and its source, or None if none comes in time."""

    def answer(self, source: Source) -> None:
        """Send to this source from now on, where there is more than one."""
        return

    def close(self) -> None:
        """Release the port."""
        self._port.close()


def open_transport(address: Address, timeout_s: float) -> Transport:
    """Open the transport to a vehicle.

    A LinkError says that the host is not known, the port taken, the connection refused, or the device not
    there.
    """
    if address.scheme == "serial":
        return SerialLine(address)
    try:
        family, where = _resolve(address, timeout_s)
        if address.scheme == "tcp":
            return TcpStream(address, family, where, timeout_s)
        return UdpSocket(address, family, where)
    except OSError as error:
        if isinstance(error, LinkError):
            raise
        raise LinkError(f"cannot open {address}: {_reason(error)}") from error


class UdpSocket(Transport):
    """Datagrams: `udpout` sends to one address, `udpin` listens and answers who spoke."""

    is_datagram = True

    def __init__(self, address: Address, family: int, where: Any) -> None:
        self._listens = address.scheme == "udpin"
        self._peer: Source = None
        self._port = socket.socket(family, socket.SOCK_DGRAM)
        try:
            if self._listens:
                self._port.bind(where)
            else:
                self._port.connect(where)
        except OSError:
            self._port.close()
            raise

    def send(self, data: bytes) -> None:
        """Send a datagram; a listening socket has none to send to before somebody spoke."""
        try:
            if not self._listens:
                self._port.send(data)
            elif self._peer is not None:
                self._port.sendto(data, self._peer)
        except OSError as error:  # a datagram may get lost in any case; the transfer repeats it
            self.trouble = _reason(error)

    def receive(self, timeout_s: float) -> tuple[bytes, Source] | None:
        self._port.settimeout(max(timeout_s, 0.001))
        try:
            data, source = self._port.recvfrom(_BYTES)
        except TimeoutError:
            return None
        except OSError as error:  # such as a port on which nobody listens yet
            self.trouble = _reason(error)
            time.sleep(min(timeout_s, 0.01))
            return None
        if self._peer is None:
            self._peer = source
        return data, source

    def answer(self, source: Source) -> None:
        self._peer = source


class TcpStream(Transport):
    """One TCP connection."""

    def __init__(self, address: Address, family: int, where: Any, timeout_s: float) -> None:
        self._address = address
        self._port = socket.socket(family, socket.SOCK_STREAM)
        try:
            self._port.settimeout(timeout_s)
            self._port.connect(where)
            self._port.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except OSError:
            self._port.close()
            raise

    def send(self, data: bytes) -> None:
        try:
            self._port.settimeout(SEND_S)
            self._port.sendall(data)
        except OSError as error:
            raise LinkError(f"the connection to {self._address} is lost: {_reason(error)}") from error

    def receive(self, timeout_s: float) -> tuple[bytes, Source] | None:
        try:
            self._port.settimeout(max(timeout_s, 0.001))
            data = self._port.recv(_BYTES)
        except TimeoutError:
            return None
        except OSError as error:
            raise LinkError(f"the connection to {self._address} is lost: {_reason(error)}") from error
        if not data:
            raise LinkError(f"the connection to {self._address} was closed by the other side")
        return data, None


class SerialLine(Transport):
    """Serial device, through pyserial."""

    def __init__(self, address: Address) -> None:
        missing = 'serial lines need pyserial: pip install "uavseg[serial]"'
        with caused_errors(missing, LinkError, ImportError, form="{}"):
            import serial
        self._address = address
        try:
            self._port = serial.Serial(address.place, address.number, timeout=0, write_timeout=SEND_S)
        except (OSError, ValueError) as error:  # SerialException is an OSError
            raise LinkError(f"cannot open {address}: {error}") from error

    def send(self, data: bytes) -> None:
        with named_errors(f"the serial line {self._address} is lost", OSError, LinkError):
            self._port.write(data)

    def receive(self, timeout_s: float) -> tuple[bytes, Source] | None:
        with named_errors(f"the serial line {self._address} is lost", OSError, LinkError):
            self._port.timeout = max(timeout_s, 0.001)
            data = self._port.read(1)
            data += self._port.read(self._port.in_waiting)
        return (data, None) if data else None


def _reason(error: OSError) -> str:
    """Return the message of the operating system, without its number."""
    return (error.strerror or str(error) or type(error).__name__).lower()


def _resolve(address: Address, timeout_s: float) -> tuple[int, Any]:
    """Resolve a host in a thread, because a resolver may hang and cannot be interrupted."""
    result: list[Any] = []
    socket_type = socket.SOCK_STREAM if address.scheme == "tcp" else socket.SOCK_DGRAM
    flags = socket.AI_PASSIVE if address.scheme == "udpin" else 0

    def resolve() -> None:
        place = address.place or None
        try:
            result.extend(socket.getaddrinfo(place, address.number, type=socket_type, flags=flags))
        except (OSError, UnicodeError) as error:
            result.append(error)

    thread = threading.Thread(target=resolve, daemon=True)
    thread.start()
    thread.join(timeout_s)
    if not result or isinstance(result[0], Exception):
        why = result[0] if result else f"no answer within {timeout_s:g} s"
        raise LinkError(f"cannot open {address}: the host {shown(address.place)} is not known ({why})")
    return result[0][0], result[0][4]


@dataclass(frozen=True, slots=True)
class SerialPort:
    """Serial device, such as /dev/ttyACM0 or COM3."""

    device: str
    description: str  # may be empty
    is_allowed: bool  # whether the user may read and write it

    def __str__(self) -> str:
        return f"{self.device} ({self.description})" if self.description else self.device


def serial_ports(devices: Path = Path("/dev")) -> list[SerialPort]:
    """List the USB serial devices that are connected, by name; no message is sent to them.

    The folder `devices` is searched where pyserial is not installed.
    """
    try:
        from serial.tools import list_ports
    except ImportError:
        paths = sorted(path for pattern in _PATTERNS for path in devices.glob(pattern))
        return [SerialPort(str(path), "", _is_allowed(str(path))) for path in paths]
    ports = sorted(port for port in list_ports.comports() if port.vid is not None)
    return [SerialPort(port.device, port.product or "", _is_allowed(port.device)) for port in ports]


def _is_allowed(device: str) -> bool:
    """Return whether the user may read and write a device; systems without device files allow it."""
    return not Path(device).exists() or os.access(device, os.R_OK | os.W_OK)
