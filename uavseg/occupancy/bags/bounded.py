"""Bounds on what a bag may unpack to: rosbags itself decompresses a chunk to whatever size it has."""

import bz2
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from uavseg.errors import BagError

MAX_CHUNK = 256 << 20  # bytes of a chunk, unpacked; recorders make chunks of up to a few MB
MAX_TOGETHER = 1 << 30  # bytes of chunks that are unpacked at once, because their times overlap


@contextmanager
def bounded_decompression() -> Iterator[None]:
    """A block in which rosbags unpacks chunks of at most 256 MB, whatever they claim."""
    from rosbags.rosbag1 import reader as rosbag1
    from rosbags.rosbag2 import storage_mcap as mcap

    before = dict(rosbag1.decompressors), dict(mcap.DECOMPRESSORS)
    rosbag1.decompressors.update(bz2=_bounded(bz2.BZ2Decompressor), lz4=_bounded(_lz4))
    zstd = _bounded(mcap.zstd.ZstdDecompressor)
    mcap.DECOMPRESSORS.update(lz4=_with_size(_bounded(_lz4)), zstd=_with_size(zstd))
    try:
        yield
    finally:
        rosbag1.decompressors.update(before[0])
        mcap.DECOMPRESSORS.update(before[1])


def check_overlap(chunks: list[Any], path: str) -> None:
    """Check how many bytes of an MCAP file are unpacked at once: messages are merged by time.

    Parameters
    ----------
    chunks : list of ChunkInfo
        Of rosbags' reader, which checks the unpacked size of each when it unpacks it.

    Raises
    ------
    BagError
        If they are too many: no recorder writes so many chunks of one time.
    """
    changes = [(chunk.message_start_time, chunk.uncompressed_size) for chunk in chunks]
    changes += [(chunk.message_end_time + 1, -chunk.uncompressed_size) for chunk in chunks]
    together = 0
    for _, size in sorted(changes):
        together += size
        if together > MAX_TOGETHER:
            raise BagError(
                f"{path} has chunks of more than {MAX_TOGETHER >> 20:,} MB that overlap in time; is it "
                "damaged? ros2 bag convert writes it anew"
            )


def _lz4() -> Any:
    import lz4.frame

    return lz4.frame.LZ4FrameDecompressor()


def _bounded(make: Callable[[], Any]) -> Callable[[bytes], bytes]:
    """A function that unpacks at most MAX_CHUNK bytes."""

    def unpack(packed: bytes) -> bytes:
        unpacker = make()
        unpacked: bytes = unpacker.decompress(packed, MAX_CHUNK)
        if not unpacker.eof:
            raise ValueError(f"a chunk is cut off, or has more than {MAX_CHUNK >> 20} MB")
        return unpacked

    return unpack


def _with_size(unpack: Callable[[bytes], bytes]) -> Callable[[bytes, int], bytes]:
    return lambda packed, _: unpack(packed)
