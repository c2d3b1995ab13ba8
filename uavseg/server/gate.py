"""Which requests a local server answers: host, origin, token, method and size are checked before anything."""

import hmac
import re
from collections.abc import Mapping
from dataclasses import dataclass

MAX_BODY = 1 << 20
MAX_TARGET = 500
JSON = "application/json"
_LENGTH = re.compile(r"[0-9]{1,9}")


@dataclass(frozen=True, slots=True)
class Refusal:
    """An answer that refuses a request.

    Parameters
    ----------
    status : int
    words : str
    """

    status: int
    words: str


@dataclass(frozen=True, slots=True)
class Gate:
    """What a request must say to be answered.

    A page of another site can make a browser send requests to 127.0.0.1, also under a name of its own (DNS
    rebinding). It knows neither the token, nor can it choose the headers Host and Origin.

    Parameters
    ----------
    port : int
    token : str
    """

    port: int
    token: str

    @property
    def hosts(self) -> tuple[str, str]:
        """Names of the server itself."""
        return f"127.0.0.1:{self.port}", f"localhost:{self.port}"

    def path_of(self, method: str, target: str, headers: Mapping[str, list[str]]) -> str | Refusal:
        """The path behind the token of a request that is allowed, such as "jobs/1".

        Parameters
        ----------
        method, target : str
            Of the first line of the request.
        headers : mapping of str to list of str
            All values of each header, by its name in lower case.
        """
        if method not in {"GET", "POST"}:
            return Refusal(405, "only GET and POST are known here")
        if headers.get("host", []) not in [[host] for host in self.hosts]:
            return Refusal(421, "this server answers to 127.0.0.1 alone")
        origins = [[f"http://{host}"] for host in self.hosts]
        if "origin" in headers and headers["origin"] not in origins:
            return Refusal(403, "requests of other sites are refused")
        if headers.get("sec-fetch-site", ["none"]) not in [["none"], ["same-origin"]]:
            return Refusal(403, "requests of other sites are refused")
        if len(target) > MAX_TARGET or not target.isascii():
            return Refusal(414, "the address is too long, or not plain")
        parts = target.split("/", 2)
        given = parts[1] if len(parts) == 3 and not parts[0] else ""
        if not hmac.compare_digest(given.encode(), self.token.encode()):
            return Refusal(404, "there is nothing here; open the address that uavseg serve printed")
        return parts[2]

    @staticmethod
    def body_length(headers: Mapping[str, list[str]]) -> int | Refusal:
        """The length of the body of a POST."""
        if "transfer-encoding" in headers:
            return Refusal(411, "a body has a Content-Length")
        lengths = headers.get("content-length", [])
        if len(lengths) != 1 or not _LENGTH.fullmatch(lengths[0]):
            return Refusal(411, "a body has a Content-Length")
        if int(lengths[0]) > MAX_BODY:
            return Refusal(413, f"a body has at most {MAX_BODY} bytes")
        if headers.get("content-type") != [JSON]:
            return Refusal(415, f"a body is {JSON}")
        return int(lengths[0])
