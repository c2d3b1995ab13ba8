"""Filters of warnings: one thread at a time."""

import threading
import traceback
import warnings
from pathlib import Path
from typing import Any

import geopandas as geopandas  # what it changes when it is first imported is not looked at
import numpy as np
import pytest
import rasterio
from affine import Affine

import uavseg
from uavseg import warning_filters
from uavseg.warning_filters import changing_filters


def test_a_second_thread_waits_for_the_first() -> None:
    order: list[str] = []
    begun = threading.Event()

    def other() -> None:
        begun.set()
        with changing_filters():
            order.append("other")

    thread = threading.Thread(target=other)
    with changing_filters():
        thread.start()
        begun.wait()
        thread.join(0.05)
        order.append("this")
    thread.join()
    assert order == ["this", "other"]


def test_warnings_are_recorded_and_filters_put_back() -> None:
    before = list(warnings.filters)
    with changing_filters(record=True) as caught, changing_filters():
        warnings.simplefilter("always")
        warnings.warn("known", stacklevel=1)
    assert [str(one.message) for one in caught] == ["known"]
    assert warnings.filters == before
    with pytest.warns(UserWarning, match="seen"), changing_filters() as nothing:
        warnings.warn("seen", stacklevel=1)
    assert nothing == []


JOBS: list[Any] = [
    (uavseg.extract, {"range": (0.5, 1), "min_area": 9.0}),
    (uavseg.extract, {"classes": {"dark": (0, 0.5), "bright": (0.5, 1)}}),
    (uavseg.levels, {"width": 0.3}),
    (uavseg.match, {"like": (4e5 + 128, 5e6 - 128, 90), "window": 16}),
    pytest.param(uavseg.match, {"like": (4e5 + 128, 5e6 - 128, 40), "by": "color"}, marks=pytest.mark.slow),
]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*color hardly parts")
@pytest.mark.parametrize(("job", "words"), JOBS)
@pytest.mark.parametrize("suffix", ["gpkg", "parquet"])
def test_threads_change_filters_only_while_no_other_does(
    job: Any, words: dict[str, Any], suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Libraries change filters too: where they do, the lock is held."""
    size = {"width": 128, "height": 128, "count": 1, "dtype": "uint8", "crs": "EPSG:32618"}
    place = Affine(2, 0, 4e5, 0, -2, 5e6)
    for k in range(3):
        with rasterio.open(tmp_path / f"{k}.tif", "w", transform=place, **size) as file:
            file.write(np.random.default_rng(k).integers(0, 255, (16, 16)).repeat(8, 0).repeat(8, 1), 1)
    places, enter = [], warnings.catch_warnings.__enter__

    def watched(context: Any) -> Any:
        is_main = threading.current_thread() is threading.main_thread()
        if not (is_main or warning_filters._lock._is_owned()):  # type: ignore[attr-defined]
            places.append(traceback.format_stack(limit=4))
        return enter(context)

    monkeypatch.setattr(warnings.catch_warnings, "__enter__", watched)
    uavseg.each(job, str(tmp_path), str(tmp_path / f"{{stem}}.{suffix}"), threads=3, **words)
    assert places == []
