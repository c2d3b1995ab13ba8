"""Mutators of content: by byte, by tag of a TIFF, by value of a JSON document, by word of a text."""

import copy
import json
import re
import struct
from random import Random
from typing import Any

INTEGERS = (0, 1, -1, 2, 7, 8, 63, 64, 127, 128, 255, 256, 32767, 32768, 65535, 65536, 2**24, 2**31 - 1)
LARGE = (2**31, 2**32 - 1, 2**32, 2**53, 2**63 - 1, 2**63, 2**64, 10**30)
WORDS = (
    *("0", "-1", "1e308", "-1e308", "1e-320", "nan", "inf", "-inf", "NaN", "", " ", "null", "true", "0x10"),
    *("1e400", "9" * 400, "9" * 5000, "a" * 5000, "\x01", "\x1b[31mred\x1b[0m", "\u202e", "%s%n", "../x.tif"),
    *(
        "1,2",
        "[]",
        "{}",
        "auto",
        "none",
        "~",
        "é",
        "\u2028",
        "-",
        "--",
        "/",
        "1px",
        "a\nb",
        "\r",
        "\x7f",
        "\x9b1m",
    ),
)
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 65, 1.5, -0.0, 1e308, -1e308, 1e-320, 2**31, 2**63, 2**64, 10**400),
    *(
        float("nan"),
        float("inf"),
        -float("inf"),
        "",
        "a",
        "a" * 3000,
        "\x01\x1b[2J",
        "a\nb",
        "\ud800",
        "nan",
        "1",
    ),
    *(
        [],
        [[]],
        [1],
        [1, 2],
        [None, None],
        ["a", "b"],
        {},
        {"a": 1},
        [0, 0, 0],
        [[0, 0], [0, 0]],
        "../a",
        "x.tif",
    ),
)
TIFF_TYPES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4, 16: 8}


def bytes_mutated(content: bytes, rng: Random, most: int = 6) -> bytes:
    """Content with one to `most` bytes or stretches of bytes changed, inserted, removed or moved."""
    data = bytearray(content)
    for _ in range(rng.randint(1, most)):
        at = rng.randrange(len(data) + 1)
        kind = rng.randrange(8)
        if kind == 0 and data:
            data[at % len(data)] ^= 1 << rng.randrange(8)
        elif kind == 1 and data:
            data[at % len(data)] = rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)))
        elif kind == 2:
            data[at:at] = rng.randbytes(rng.choice((1, 2, 4, 16)))
        elif kind == 3:
            del data[at : at + rng.choice((1, 2, 4, 16, 256))]
        elif kind == 4:
            size = rng.choice((1, 2, 4, 8))
            number = rng.choice(INTEGERS + LARGE) % (1 << 8 * size)
            data[at : at + size] = number.to_bytes(size, rng.choice(("little", "big")))
        elif kind == 5 and rng.random() < 0.3:
            del data[at:]
        elif kind == 6:
            source = rng.randrange(len(data) + 1)
            size = rng.choice((4, 16, 64))
            data[at : at + size] = data[source : source + size]
        else:
            size = rng.choice((4, 32, 128))
            data[at : at + size] = bytes([rng.choice((0, 255))]) * min(size, max(len(data) - at, 0))
    return bytes(data)


def tags_mutated(content: bytes, rng: Random) -> bytes:
    """A classic little-endian TIFF with one to three entries of its directories changed; else by byte."""
    places = list(_entries(content))
    if not places:
        return bytes_mutated(content, rng)
    data = bytearray(content)
    for _ in range(rng.randint(1, 3)):
        at = rng.choice(places)
        kind = rng.randrange(6)
        if kind == 0:
            struct.pack_into(
                "<H",
                data,
                at,
                rng.choice(
                    (254, 256, 257, 258, 259, 262, 277, 284, 322, 339, 33550, 33922, 34264, 34735, 42113)
                ),
            )
        elif kind == 1:
            struct.pack_into("<H", data, at + 2, rng.choice((*TIFF_TYPES, 0, 99)))
        elif kind == 2:
            struct.pack_into("<I", data, at + 4, rng.choice((*INTEGERS, *LARGE)) % 2**32)
        elif kind == 3:
            struct.pack_into("<I", data, at + 8, rng.choice((*INTEGERS, *LARGE)) % 2**32)
        elif kind == 4:
            other = rng.choice(places)
            data[at : at + 12] = data[other : other + 12]
        else:
            _change_values(data, at, rng)
    return bytes(data)


def _entries(content: bytes) -> list[int]:
    """Offsets of the entries of all directories."""
    if content[:4] != b"II*\0":
        return []
    found: list[int] = []
    (at,) = struct.unpack_from("<I", content, 4)
    while at and at + 2 <= len(content) and len(found) < 400:
        (count,) = struct.unpack_from("<H", content, at)
        found += [at + 2 + 12 * n for n in range(count)]
        end = at + 2 + 12 * count
        at = struct.unpack_from("<I", content, end)[0] if end + 4 <= len(content) else 0
    return [place for place in found if place + 12 <= len(content)]


def tag_bytes(content: bytes, tag: int) -> bytes:
    """The bytes that a tag of the first directory refers to."""
    at = _entry_of(content, tag)
    count, offset = struct.unpack_from("<II", content, at + 4)
    return content[offset : offset + count]


def with_tag_bytes(content: bytes, tag: int, value: bytes) -> bytes:
    """A TIFF in which a tag of the first directory refers to other bytes."""
    data = bytearray(content)
    struct.pack_into("<II", data, _entry_of(content, tag) + 4, len(value), len(content))
    return bytes(data) + value


def _entry_of(content: bytes, tag: int) -> int:
    return next(at for at in _entries(content) if struct.unpack_from("<H", content, at) == (tag,))


def _change_values(data: bytearray, at: int, rng: Random) -> None:
    """Change one value that an entry names, such as a number of the geotransform."""
    kind, count, offset = struct.unpack_from("<HII", data, at + 2)
    size = TIFF_TYPES.get(kind, 1)
    start = at + 8 if size * count <= 4 else offset
    place = start + size * rng.randrange(max(min(count, 64), 1))
    if place + size > len(data):
        return
    if kind == 12:
        numbers = (
            float("nan"),
            float("inf"),
            -float("inf"),
            0.0,
            -1.0,
            1e308,
            -1e308,
            1e-320,
            1e300,
            1e17,
            180.0,
        )
        struct.pack_into("<d", data, place, rng.choice(numbers))
    elif kind == 2:
        data[place] = rng.choice((0, 1, 10, 27, 0x3C, 0x80, 0xE9, 0xFF, 0x22))
    else:
        data[place : place + size] = (rng.choice((*INTEGERS, *LARGE)) % (1 << 8 * size)).to_bytes(
            size, "little"
        )


def json_mutated(content: bytes | str, rng: Random) -> bytes:
    """A JSON document with one to three values replaced, removed, repeated or wrapped."""
    document = json.loads(content)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        document = _json_changed(document, rng)
    text = json.dumps(document, ensure_ascii=rng.random() < 0.5)
    return text.encode("utf-8", "surrogatepass")


def _json_changed(document: Any, rng: Random) -> Any:
    places = list(_places(document))
    if not places:
        return copy.deepcopy(rng.choice(VALUES))
    holder, key = rng.choice(places)
    kind = rng.randrange(8)
    if kind == 0:
        del holder[key]
    elif kind == 1 and isinstance(holder, list):
        holder.append(copy.deepcopy(holder[key]))
    elif kind == 2:
        holder[key] = [holder[key]]
    elif kind == 3 and isinstance(holder[key], list) and holder[key]:
        holder[key] = holder[key][0]
    elif kind == 4 and isinstance(holder[key], int | float) and not isinstance(holder[key], bool):
        number = min(max(holder[key], -1e300), 1e300)  # integers may be too large for sums with floats
        holder[key] = rng.choice((number * 1e9, -holder[key], number + 0.5, str(holder[key]), 10**5))
    else:
        holder[key] = copy.deepcopy(rng.choice(VALUES))
    return document


def _places(node: Any) -> Any:
    """Every value of a document as its holder and its key there."""
    keys = list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
    for key in keys:
        yield node, key
        yield from _places(node[key])


def words_mutated(content: bytes, rng: Random) -> bytes:
    """A text with one to three of its words or numbers replaced, removed or repeated."""
    text = content.decode("utf-8", "surrogateescape")
    for _ in range(rng.randint(1, 3)):
        words = list(re.finditer(r"[\w.+-]+", text))
        if not words:
            break
        word = rng.choice(words)
        new = rng.choice((rng.choice(WORDS), "", word[0] * 2, rng.choice(words)[0]))
        text = text[: word.start()] + new + text[word.end() :]
    return text.encode("utf-8", "surrogateescape")
