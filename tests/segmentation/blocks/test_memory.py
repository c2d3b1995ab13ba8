"""Memory of a block map: refused before it is allocated, whatever the machine has."""

import pytest

from uavseg.errors import RasterError
from uavseg.segmentation.blocks import block_map
from uavseg.segmentation.blocks.block_map import BlockMap


def test_a_block_map_larger_than_the_memory_is_refused_and_one_that_fits_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(block_map, "_physical_memory", lambda: 10**9)
    with pytest.raises(RasterError, match=r"has a block map of \d+ GB, and this machine has 1 GB"):
        BlockMap.empty((1_000_000, 1_000_000))
    block_map.check_memory((10_000, 10_000))
    monkeypatch.setattr(block_map, "_physical_memory", lambda: None)  # where the system does not say
    block_map.check_memory((1_000_000, 1_000_000))


def test_the_memory_is_at_most_what_the_process_may_have(monkeypatch: pytest.MonkeyPatch) -> None:
    resource = pytest.importorskip("resource")
    monkeypatch.setattr(resource, "getrlimit", lambda _kind: (10**6, 10**6))
    with pytest.raises(RasterError, match="and this machine has 0 GB"):
        block_map.check_memory((10_000, 10_000))
