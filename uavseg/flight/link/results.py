"""Kinds of lists that the mission protocol carries, and its results in words."""

from enum import IntEnum

from uavseg.errors import LinkError


class Kind(IntEnum):
    """What is transferred (MAV_MISSION_TYPE)."""

    MISSION = 0
    FENCE = 1
    RALLY = 2

    def __str__(self) -> str:
        return ("mission", "fence", "rally points")[self]


class Result(IntEnum):
    """Answer of a vehicle to a transfer (MAV_MISSION_RESULT)."""

    ACCEPTED = 0
    ERROR = 1
    UNSUPPORTED_FRAME = 2
    UNSUPPORTED = 3
    NO_SPACE = 4
    INVALID = 5
    INVALID_PARAM1 = 6
    INVALID_PARAM2 = 7
    INVALID_PARAM3 = 8
    INVALID_PARAM4 = 9
    INVALID_PARAM5_X = 10
    INVALID_PARAM6_Y = 11
    INVALID_PARAM7 = 12
    INVALID_SEQUENCE = 13
    DENIED = 14
    OPERATION_CANCELLED = 15

    @property
    def words(self) -> str:
        """The result for people, with its name."""
        return f"{_WORDS[self]} (MAV_MISSION_{self.name})"


_WORDS = {
    Result.ACCEPTED: "accepted",
    Result.ERROR: "an error, or busy with another transfer",
    Result.UNSUPPORTED_FRAME: "the frame is not supported",
    Result.UNSUPPORTED: "the command is not supported",
    Result.NO_SPACE: "there is no space for it",
    Result.INVALID: "a parameter is invalid",
    **{Result(5 + n): f"parameter {n} is invalid" for n in range(1, 5)},
    Result.INVALID_PARAM5_X: "the latitude (parameter 5) is invalid",
    Result.INVALID_PARAM6_Y: "the longitude (parameter 6) is invalid",
    Result.INVALID_PARAM7: "the altitude (parameter 7) is invalid",
    Result.INVALID_SEQUENCE: "the item was not expected",
    Result.DENIED: "denied, perhaps because another ground station transfers",
    Result.OPERATION_CANCELLED: "the transfer was cancelled",
}


def result_words(number: int) -> str:
    """A result for people, also one that is not known."""
    return Result(number).words if number in set(Result) else f"result {number}"


class TransferLostError(LinkError):
    """A transfer stopped before its end; it may be tried again."""


class RefusedError(LinkError):
    """A vehicle refuses to send a list."""
