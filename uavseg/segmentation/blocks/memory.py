"""Memory of a block map, checked before it is allocated."""

import os
from types import ModuleType

from uavseg.errors import RasterError
from uavseg.segmentation.blocks.division import RATIOS
from uavseg.units import CELLS

resource: ModuleType | None
try:
    import resource
except ImportError:  # Windows
    resource = None


def check_memory(shape: tuple[int, int]) -> None:
    """Check that the block map of an image fits into the memory of this machine; nothing is allocated.

    Raises
    ------
    RasterError
        If it does not.
    """
    rows, cols = shape
    blocks = -(-rows // (8 * CELLS)) * -(-cols // (8 * CELLS))
    size, memory = blocks * (CELLS * CELLS * 5 + RATIOS * 8), _physical_memory()
    if memory is not None and size > memory:
        raise RasterError(
            f"a raster of {cols:,} x {rows:,} pixels has a block map of {size / 1e9:,.0f} GB, and this "
            f"machine has {memory / 1e9:,.0f} GB of memory; cut out the part that holds data "
            "(gdal_translate -srcwin), or take a coarser copy (gdal_translate -outsize)"
        )


def _physical_memory() -> int | None:
    """Bytes of memory of this machine that a process may have; None where the system does not say."""
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None
    if resource is None:
        return memory
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return memory if limit == resource.RLIM_INFINITY else min(memory, limit)
