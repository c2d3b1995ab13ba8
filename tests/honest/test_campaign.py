"""The campaign itself: it finds faults that are planted, is repeatable, and finds nothing else."""

from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
import shapely

import uavseg
from tests.honest import arrays, campaign, picture
from tests.honest.findings import findings_of
from tests.hostile.campaign import report
from uavseg.errors import RasterError
from uavseg.raster.tiff import damaged_blocks

FILE = 8  # a case of `files` that finds nothing


def moved(regions: Any) -> Any:
    """Regions a pixel to the east."""
    west, _, east, _ = regions.total_bounds
    regions.geometry = [
        shapely.transform(one, lambda xy: xy + np.array([(east - west) / 4, 0])) for one in regions.geometry
    ]
    return regions


def refuse(regions: Any) -> Any:
    raise RasterError("the stream of the block at 0, 0 goes on beyond its end")


def break_off(regions: Any) -> Any:
    raise IndexError("list index out of range")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "kind"),
    [
        (moved, "PLACE"),
        (lambda regions: regions.assign(pixels=regions["pixels"] + 1), "VALID"),
        (lambda regions: regions.assign(area_m2=regions["area_m2"] * 1.00001), "AREA"),
        (lambda regions: regions.assign(mean=regions["mean"] + 3e-5), "MEAN"),
        (refuse, "REFUSED"),
        (break_off, "RAW"),
    ],
)
def test_a_fault_of_each_kind_is_a_finding(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, fault: Callable[[Any], Any], kind: str
) -> None:
    assert campaign.one("files", 0, FILE, tmp_path / "case") == []
    right = uavseg.extract
    monkeypatch.setattr(uavseg, "extract", lambda *given, **how: fault(right(*given, **how)))
    assert [found.kind for found in campaign.one("files", 0, FILE, tmp_path / "case")] == [kind]


@pytest.mark.slow
def test_a_tile_as_wide_as_the_raster_that_is_taken_for_a_strip_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    blocks = damaged_blocks._DeflateBlocks
    right = blocks.__init__

    def by_width(self: Any, name: str, path: Path, source: Any, *more: Any, **how: Any) -> None:
        right(self, name, path, source, *more, **how)
        self._is_tiled = self._shape[1] != source.width

    monkeypatch.setattr(blocks, "__init__", by_width)
    _, found = campaign.batch(0, 100, 0, {"files": 1}, float("inf"))
    assert {finding.kind for finding, _ in found} == {"REFUSED"}
    assert all("goes on beyond its end" in finding.detail for finding, _ in found)


@pytest.mark.slow
@pytest.mark.parametrize("kind", campaign.KINDS)
def test_a_case_is_always_the_same(tmp_path: Path, kind: str) -> None:
    made = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        campaign.one(kind, 3, 5, folder)
        made.append({path.name: path.read_bytes() for path in folder.rglob("*.tif")})
    assert made[0] == made[1]


@pytest.mark.slow
def test_every_form_of_an_array_is_another_answer_or_the_same_array() -> None:
    values = np.arange(40 * 30, dtype=np.uint8).reshape(1, 40, 30)
    with picture.quiet():
        array = arrays.of_values(values)
        for name, form in arrays.FORMS.items():
            truth = arrays.truth_of(form(array, Random(0)), picture.Picture(values, values[0] >= 0, (0, 255)))
            assert truth is None or truth.valid.all(), name


@pytest.mark.slow
def test_a_hundred_cases_find_nothing() -> None:
    count, found = campaign.run_here(100, seed=1)
    assert count.total() == 100 and set(count) == set(campaign.KINDS)
    assert not found, report(count, found, 0)


def test_an_error_in_a_case_names_its_place(tmp_path: Path) -> None:
    def case(rng: Random, folder: Path) -> Any:
        yield from ()
        raise ValueError("wrong")

    [found] = findings_of(case, Random(0), tmp_path)
    assert (found.kind, found.signature) == ("RAW", "ValueError test_campaign.py:case")
