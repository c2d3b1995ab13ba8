"""Serial devices to which an autopilot or a telemetry radio may be connected."""

import os
from dataclasses import dataclass
from pathlib import Path

_PATTERNS = ("ttyACM*", "ttyUSB*", "ttyAMA*", "cu.usb*")


@dataclass(frozen=True, slots=True)
class SerialPort:
    """A serial device.

    Parameters
    ----------
    device : str
        Such as /dev/ttyACM0 or COM3.
    description : str
        What the device says of itself; may be empty.
    is_allowed : bool
        Whether the user may read and write it.
    """

    device: str
    description: str
    is_allowed: bool

    def __str__(self) -> str:
        about = f" ({self.description})" if self.description else ""
        return f"{self.device}{about}"


def serial_ports(devices: Path = Path("/dev")) -> list[SerialPort]:
    """USB serial devices that are connected, by name; no message is sent to them.

    Parameters
    ----------
    devices : Path
        The folder of devices, which is searched where pyserial is not installed.
    """
    try:
        from serial.tools import list_ports
    except ImportError:
        paths = sorted(path for pattern in _PATTERNS for path in devices.glob(pattern))
        return [SerialPort(str(path), "", _is_allowed(str(path))) for path in paths]
    found = sorted(port for port in list_ports.comports() if port.vid is not None)
    return [SerialPort(port.device, port.product or "", _is_allowed(port.device)) for port in found]


def _is_allowed(device: str) -> bool:
    """Whether the user may read and write a device; systems without device files allow it."""
    return not Path(device).exists() or os.access(device, os.R_OK | os.W_OK)
