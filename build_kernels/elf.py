"""Link object files into an ELF shared library for x86-64: a machine that builds may have no linker.

It links what LLVM makes of loop nests, and refuses the rest: position-independent code of the small code
model with constants, one exported function in each object file, calls of functions of the C library, no
variables. The library has three segments, each on pages of its own: tables and constants, code, and
addresses that the loader fills in and then makes read-only. Imported names have no version, so that any
version of glibc fits. See the System V ABI and its AMD64 supplement.
"""

import struct
from collections.abc import Callable, Mapping

from uavseg.dataclass import dataclass

_PAGE = 4096
_LIBRARY = "libm.so.6"  # which brings the C library
_HEADER, _SEGMENT, _SECTION = "<16sHHIQQQIHHHHHH", "<IIQQQQQQ", "<IIQQQQIIQQ"
_SYMBOL, _RELOCATION, _ENTRY = "<IBBHQQ", "<QQq", "<qQ"
_MAGIC = b"\x7fELF\x02\x01\x01".ljust(16, b"\0")
_WRITTEN, _ALLOCATED, _EXECUTED = 1, 2, 4  # flags of sections
_PROGBITS, _RELOCATIONS = 1, 4  # types of sections
_ABSOLUTE, _RELATIVE_TO_PLACE, _CALL, _FILL_ADDRESS, _ADD_BASE = 1, 2, 4, 6, 8  # types of relocations
_GLOBAL_FUNCTION = 0x12
_STUB = 8  # bytes of a jump to an imported function, with padding
# Tags of the dynamic table.
_NEEDED, _HASH, _STRTAB, _SYMTAB, _RELA, _RELASZ, _RELAENT, _STRSZ, _SYMENT = 1, 4, 5, 6, 7, 8, 9, 10, 11
_FLAGS, _BIND_NOW = 30, 8


@dataclass(frozen=True)
class _Part:
    """A section of an object file that is loaded, and its relocations: offset, type, symbol, addend."""

    content: bytes
    alignment: int
    flags: int
    relocations: list[tuple[int, int, int, int]]


@dataclass(frozen=True)
class _Object:
    """What is linked of an object file."""

    parts: dict[int, _Part]  # by number of section
    symbols: list[tuple[str, int, int]]  # name, number of section (0: of another library), offset


class _Segment:
    """Bytes that are loaded with one protection."""

    def __init__(self, address: int) -> None:
        self.address = address
        self.content = bytearray()

    def append(self, content: bytes, alignment: int = 8) -> int:
        """Append a content, aligned; its address."""
        self.content += bytes(-len(self.content) % alignment)
        self.content += content
        return self.end - len(content)

    def write(self, address: int, content: bytes) -> None:
        offset = address - self.address
        self.content[offset : offset + len(content)] = content

    @property
    def end(self) -> int:
        return self.address + len(self.content)


def shared_library(functions: Mapping[str, bytes], entry: str) -> bytes:
    """Link object files.

    `functions` are the names of exported functions with the object files that have them, in which each is
    called `entry`; their order makes no difference. A ValueError says that an object file holds what is not
    linked here.
    """
    names = sorted(functions)
    objects = [_read(functions[name]) for name in names]
    relocations = [
        (one, *found) for one in objects for part in one.parts.values() for found in part.relocations
    ]
    imported = sorted({one.symbols[k][0] for one, _, _, k, _ in relocations if not one.symbols[k][1]})
    absolute = sum(kind == _ABSOLUTE for _, _, kind, _, _ in relocations)
    strings = b"\0" + b"".join(name.encode() + b"\0" for name in (*imported, *names, _LIBRARY))

    head = _Segment(0)
    head.append(bytes(struct.calcsize(_HEADER) + 6 * struct.calcsize(_SEGMENT)))
    hash_at = head.append(_hash_table(["", *imported, *names]))
    symbols_at = head.append(bytes((1 + len(imported) + len(names)) * struct.calcsize(_SYMBOL)))
    strings_at = head.append(strings, 1)
    relocations_at = head.append(bytes((len(imported) + absolute) * struct.calcsize(_RELOCATION)))
    places: dict[tuple[int, int], int] = {}  # addresses of parts
    _place(objects, places, head, lambda flags: not flags & (_EXECUTED | _WRITTEN))
    code = _Segment(-(-head.end // _PAGE) * _PAGE)
    _place(objects, places, code, lambda flags: bool(flags & _EXECUTED))
    stubs = {name: code.append(bytes(_STUB)) for name in imported}
    data = _Segment(-(-code.end // _PAGE) * _PAGE)
    dynamic = [
        *((_NEEDED, strings.index(_LIBRARY.encode())), (_HASH, hash_at), (_STRTAB, strings_at)),
        *((_SYMTAB, symbols_at), (_STRSZ, len(strings)), (_SYMENT, struct.calcsize(_SYMBOL))),
        *((_RELA, relocations_at), (_RELASZ, (len(imported) + absolute) * struct.calcsize(_RELOCATION))),
        *((_RELAENT, struct.calcsize(_RELOCATION)), (_FLAGS, _BIND_NOW), (0, 0)),
    ]
    dynamic_at = data.append(b"".join(struct.pack(_ENTRY, *entry) for entry in dynamic))
    slots = {name: data.append(bytes(8)) for name in imported}
    _place(objects, places, data, lambda flags: bool(flags & _WRITTEN))
    data.append(bytes(-len(data.content) % _PAGE), 1)

    for name, stub in stubs.items():
        code.write(stub, b"\xff\x25" + struct.pack("<i", slots[name] - (stub + 6)) + b"\xcc\xcc")
    filled = [(slots[name], (1 + k) << 32 | _FILL_ADDRESS, 0) for k, name in enumerate(imported)]
    for number, one in enumerate(objects):
        for section, part in one.parts.items():
            place = places[number, section]
            segment = data if part.flags & _WRITTEN else code if part.flags & _EXECUTED else head
            for offset, kind, symbol, addend in part.relocations:
                name, owner, value = one.symbols[symbol]
                target = (places[number, owner] + value if owner else stubs[name]) + addend
                if kind == _ABSOLUTE and owner and segment is data:
                    filled.append((place + offset, _ADD_BASE, target))
                elif kind == _CALL or (kind == _RELATIVE_TO_PLACE and owner):
                    segment.write(place + offset, struct.pack("<i", target - (place + offset)))
                else:
                    raise ValueError(f"relocation of type {kind} against {name or 'a section'}")
    head.write(relocations_at, b"".join(struct.pack(_RELOCATION, *entry) for entry in filled))

    table = [(0, 0, 0, 0, 0, 0)]
    table += [
        (strings.index(b"\0" + name.encode() + b"\0") + 1, _GLOBAL_FUNCTION, 0, 0, 0, 0) for name in imported
    ]
    for number, (name, one) in enumerate(zip(names, objects, strict=True)):
        [(owner, value)] = [found[1:] for found in one.symbols if found[0] == entry]
        at = strings.index(b"\0" + name.encode() + b"\0") + 1
        size = len(one.parts[owner].content) - value
        table.append((at, _GLOBAL_FUNCTION, 0, 2, places[number, owner] + value, size))
    head.write(symbols_at, b"".join(struct.pack(_SYMBOL, *entry) for entry in table))

    segments = [
        *((1, 4, head.address, len(head.content), _PAGE), (1, 5, code.address, len(code.content), _PAGE)),
        *((1, 6, data.address, len(data.content), _PAGE), (2, 6, dynamic_at, len(dynamic) * 16, 8)),
        (0x6474E551, 6, 0, 0, 16),  # the stack is not executable
        (0x6474E552, 4, data.address, len(data.content), 1),  # read-only, once the addresses are filled in
    ]
    # The loader needs no sections; with these, disassemblers and `nm` show the functions.
    section_names = b"\0.dynsym\0.text\0.dynstr\0"
    sections = [
        (0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
        (1, 11, _ALLOCATED, symbols_at, symbols_at, len(table) * 24, 3, 1, 8, 24),
        (9, _PROGBITS, _ALLOCATED | _EXECUTED, code.address, code.address, len(code.content), 0, 0, 64, 0),
        (15, 3, _ALLOCATED, strings_at, strings_at, len(strings), 0, 0, 1, 0),
        (0, 3, 0, 0, data.end, len(section_names), 0, 0, 1, 0),
    ]
    sections_at = data.end + len(section_names)
    sizes = 64, 56, len(segments), 64, len(sections), len(sections) - 1
    head.write(0, struct.pack(_HEADER, _MAGIC, 3, 62, 1, 0, 64, sections_at, 0, *sizes))
    described = [
        struct.pack(_SEGMENT, kind, flags, at, at, at, size, size, step)
        for kind, flags, at, size, step in segments
    ]
    head.write(64, b"".join(described))
    loaded = b"".join(
        bytes(one.content).ljust(-(-len(one.content) // _PAGE) * _PAGE, b"\0") for one in (head, code, data)
    )
    return loaded + section_names + b"".join(struct.pack(_SECTION, *section) for section in sections)


def _place(
    objects: list[_Object],
    places: dict[tuple[int, int], int],
    segment: _Segment,
    belongs: Callable[[int], bool],
) -> None:
    """Append the parts of all objects that belong to a segment, and keep their addresses."""
    for number, one in enumerate(objects):
        for section, part in one.parts.items():
            if belongs(part.flags):
                places[number, section] = segment.append(part.content, part.alignment)


def _read(content: bytes) -> _Object:
    """Read an object file: its sections that are loaded, their relocations and all symbols."""
    start, size, count = (*struct.unpack_from("<Q", content, 40), *struct.unpack_from("<HH", content, 58))
    sections = [struct.unpack_from(_SECTION, content, start + k * size) for k in range(count)]
    parts, symbols = {}, []
    for k, (_, kind, flags, _, at, length, _, _, alignment, _) in enumerate(sections):
        if kind == 2:  # the table of symbols
            texts = sections[sections[k][6]][4]
            for offset in range(at, at + length, struct.calcsize(_SYMBOL)):
                name, _, _, owner, value, _ = struct.unpack_from(_SYMBOL, content, offset)
                text = content[texts + name : content.index(b"\0", texts + name)].decode()
                symbols.append((text, owner, value))
        elif flags & _ALLOCATED and length and kind == _PROGBITS:
            parts[k] = _Part(content[at : at + length], max(alignment, 1), flags, [])
        elif flags & _ALLOCATED and length and kind != 0x70000001:  # tables for unwinding are left out
            raise ValueError(f"section of type {kind}")
    for _, kind, _, _, at, length, _, target, _, _ in sections:
        if kind == _RELOCATIONS and target in parts:
            for offset in range(at, at + length, struct.calcsize(_RELOCATION)):
                place, info, addend = struct.unpack_from(_RELOCATION, content, offset)
                parts[target].relocations.append((place, info & 0xFFFFFFFF, info >> 32, addend))
    return _Object(parts, symbols)


def _hash_table(names: list[str]) -> bytes:
    """Return the table by which the loader finds symbols: chains of those with the same hash."""
    buckets, chains = [0] * len(names), [0] * len(names)
    for k, name in enumerate(names):
        if k:
            bucket = _hash(name.encode()) % len(buckets)
            chains[k], buckets[bucket] = buckets[bucket], k
    return struct.pack(f"<{2 + 2 * len(names)}I", len(buckets), len(chains), *buckets, *chains)


def _hash(name: bytes) -> int:
    value = 0
    for byte in name:
        value = (value << 4) + byte
        value = (value ^ ((value & 0xF0000000) >> 24)) & 0x0FFFFFFF
    return value
