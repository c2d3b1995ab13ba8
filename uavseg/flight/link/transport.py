"""Transports: UDP, TCP and serial lines that carry bytes to and from a vehicle and never block for long."""

import socket
import threading
import time
from typing import Any, Protocol

from uavseg.errors import LinkError
from uavseg.flight.link.address import Address
from uavseg.plain_text import shown

SEND_S = 2.0  # a peer that takes no bytes for this long is lost
_BYTES = 65535

Source = Any
"""Where bytes came from: an address of UDP; None where there is only one peer."""


class Transport(Protocol):
    """Carries bytes.

    `is_datagram` says whether each piece that arrives holds whole messages; `trouble` is what the system
    reported last, such as a refused connection, or empty.
    """

    is_datagram: bool
    trouble: str

    def send(self, data: bytes) -> None:
        """Send bytes; may lose them."""

    def receive(self, timeout_s: float) -> tuple[bytes, Source] | None:
        """The next piece, or None if none comes in time."""

    def answer(self, source: Source) -> None:
        """Send to this source from now on."""

    def close(self) -> None:
        """Release the port."""


def open_transport(address: Address, timeout_s: float) -> Transport:
    """Open the way to a vehicle.

    Raises
    ------
    LinkError
        If the host is not known, the port is taken, the connection refused, or the device not there.
    """
    if address.kind == "serial":
        return SerialLine(address)
    try:
        family, where = _resolve(address, timeout_s)
        if address.kind == "tcp":
            return TcpStream(address, family, where, timeout_s)
        return UdpSocket(address, family, where)
    except OSError as error:
        if isinstance(error, LinkError):
            raise
        raise LinkError(f"cannot open {address}: {reason(error)}") from error


class UdpSocket:
    """Datagrams: `udpout` sends to one address, `udpin` listens and answers who spoke."""

    is_datagram = True

    def __init__(self, address: Address, family: int, where: Any) -> None:
        self.trouble = ""
        self._listens = address.kind == "udpin"
        self._peer: Source = None
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            if self._listens:
                self._socket.bind(where)
            else:
                self._socket.connect(where)
        except OSError:
            self._socket.close()
            raise

    def send(self, data: bytes) -> None:
        """Send a datagram; a listening socket has none to send to before somebody spoke."""
        try:
            if not self._listens:
                self._socket.send(data)
            elif self._peer is not None:
                self._socket.sendto(data, self._peer)
        except OSError as error:  # a datagram may get lost in any case; the transfer repeats it
            self.trouble = reason(error)

    def receive(self, timeout_s: float) -> tuple[bytes, Source] | None:
        """The next datagram and its sender."""
        self._socket.settimeout(max(timeout_s, 0.001))
        try:
            data, source = self._socket.recvfrom(_BYTES)
        except TimeoutError:
            return None
        except OSError as error:  # such as a port on which nobody listens yet
            self.trouble = reason(error)
            time.sleep(min(timeout_s, 0.01))
            return None
        if self._peer is None:
            self._peer = source
        return data, source

    def answer(self, source: Source) -> None:
        """Send to this address from now on."""
        self._peer = source

    def close(self) -> None:
        """Release the port."""
        self._socket.close()


class TcpStream:
    """One TCP connection."""

    is_datagram = False
    trouble = ""

    def __init__(self, address: Address, family: int, where: Any, timeout_s: float) -> None:
        self._address = address
        self._socket = socket.socket(family, socket.SOCK_STREAM)
        try:
            self._socket.settimeout(timeout_s)
            self._socket.connect(where)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except OSError:
            self._socket.close()
            raise

    def send(self, data: bytes) -> None:
        """Send bytes."""
        try:
            self._socket.settimeout(SEND_S)
            self._socket.sendall(data)
        except OSError as error:
            raise LinkError(f"the connection to {self._address} is lost: {reason(error)}") from error

    def receive(self, timeout_s: float) -> tuple[bytes, Source] | None:
        """The bytes that arrived."""
        try:
            self._socket.settimeout(max(timeout_s, 0.001))
            data = self._socket.recv(_BYTES)
        except TimeoutError:
            return None
        except OSError as error:
            raise LinkError(f"the connection to {self._address} is lost: {reason(error)}") from error
        if not data:
            raise LinkError(f"the connection to {self._address} was closed by the other side")
        return data, None

    def answer(self, source: Source) -> None:
        """There is one peer only."""

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


class SerialLine:
    """A serial device, through pyserial."""

    is_datagram = False
    trouble = ""

    def __init__(self, address: Address) -> None:
        try:
            import serial
        except ImportError as error:
            raise LinkError('serial lines need pyserial: pip install "uavseg[serial]"') from error
        self._address = address
        try:
            self._port = serial.Serial(address.place, address.number, timeout=0, write_timeout=SEND_S)
        except (OSError, ValueError) as error:  # SerialException is an OSError
            raise LinkError(f"cannot open {address}: {error}") from error

    def send(self, data: bytes) -> None:
        """Send bytes."""
        try:
            self._port.write(data)
        except OSError as error:
            raise LinkError(f"the serial line {self._address} is lost: {error}") from error

    def receive(self, timeout_s: float) -> tuple[bytes, Source] | None:
        """The bytes that arrived."""
        try:
            self._port.timeout = max(timeout_s, 0.001)
            data = self._port.read(1)
            data += self._port.read(self._port.in_waiting)
        except OSError as error:
            raise LinkError(f"the serial line {self._address} is lost: {error}") from error
        return (data, None) if data else None

    def answer(self, source: Source) -> None:
        """There is one peer only."""

    def close(self) -> None:
        """Close the device."""
        self._port.close()


def reason(error: OSError) -> str:
    """What the system says, without its number."""
    return (error.strerror or str(error) or type(error).__name__).lower()


def _resolve(address: Address, timeout_s: float) -> tuple[int, Any]:
    """Family and socket address of a host, in a thread: a resolver may hang and cannot be interrupted."""
    found: list[Any] = []
    kind = socket.SOCK_STREAM if address.kind == "tcp" else socket.SOCK_DGRAM
    flags = socket.AI_PASSIVE if address.kind == "udpin" else 0

    def resolve() -> None:
        try:
            found.extend(socket.getaddrinfo(address.place or None, address.number, type=kind, flags=flags))
        except (OSError, UnicodeError) as error:
            found.append(error)

    thread = threading.Thread(target=resolve, daemon=True)
    thread.start()
    thread.join(timeout_s)
    if not found or isinstance(found[0], Exception):
        why = found[0] if found else f"no answer within {timeout_s:g} s"
        raise LinkError(f"cannot open {address}: the host {shown(address.place)} is not known ({why})")
    return found[0][0], found[0][4]
