"""`info`: size, place, count, mean and deviation are those of numpy over rasterio's pixels."""

import json
from collections.abc import Iterator
from pathlib import Path
from random import Random

import numpy as np

from tests.honest import plain
from tests.honest.findings import command, differ, far
from tests.honest.picture import any_file, any_picture
from tests.hostile.judging import Finding


def case(rng: Random, folder: Path) -> Iterator[Finding]:
    """What `info` says of a file."""
    picture = any_picture(rng)
    path = folder / any_file(rng, folder, picture)
    truth = plain.read(path, (1, 2, 3) if len(picture.values) == 3 else (1,))
    if not truth.valid.any():
        return
    low, high = picture.span
    words = ["info", str(path), "--json", "--collar", "keep", f"--stretch={low!r},{high!r}", "--threads", "1"]
    said, about = json.loads(command(*words)), picture.by
    yield from differ("SIZE", about, (said["rows"], said["cols"]), truth.valid.shape)
    yield from differ("VALID", about, said["valid"], int(np.count_nonzero(truth.valid)))
    v = plain.v_of(truth.intensity[truth.valid], low, high)
    yield from far("MEAN", about, said["mean"], float(v.mean()), 0, 1.1 / 65535)
    yield from far("STD", about, said["std"], float(v.std()), 1e-4, 2e-5)
    yield from differ("HISTOGRAM", about, sum(said["histogram"]), said["valid"])
    corners = [
        truth.transform * (col, row) for col in (0, truth.valid.shape[1]) for row in (0, truth.valid.shape[0])
    ]
    x, y = np.array(corners).T
    bounds = [x.min(), y.min(), x.max(), y.max()]
    if not np.allclose(said["bounds"], bounds, rtol=1e-12, atol=1e-9):
        yield Finding("BOUNDS", about, f"{said['bounds']}, not {bounds}")
