"""Regions selected by id, condition and size."""

import numpy as np
import pytest
import shapely

from uavseg.errors import RegionError
from uavseg.regions.select.choose import of_classes, select_regions
from uavseg.regions.table import Regions

AREA = np.array([50.0, 900.0, 100.0, 900.0, 400.0])
REGIONS = Regions(
    {"id": np.array([1, 2, 3, 5, 7]), "area_m2": AREA, "mean": np.array([0.1, 0.2, 0.3, 0.4, 0.5])},
    np.array([shapely.box(n, 0, n + 1, 1) for n in range(5)], dtype=object),
    "EPSG:4326",
)


def ids(**choice: object) -> list[int]:
    return select_regions(REGIONS, **choice).columns["id"].tolist()  # type: ignore[arg-type]


def test_without_criteria_all_regions_are_selected() -> None:
    assert ids() == [1, 2, 3, 5, 7]


def test_criteria_are_combined_and_the_order_stays() -> None:
    assert ids(ids=[7, 1, 5]) == [1, 5, 7]
    assert ids(condition="mean > 0.15") == [2, 3, 5, 7]
    assert ids(largest=3) == [2, 5, 7]
    assert ids(largest=1) == [2]
    assert ids(largest=99) == [1, 2, 3, 5, 7]
    assert ids(ids=[1, 3, 7], condition="mean < 0.4", largest=1) == [3]


def test_polygons_go_with_their_columns() -> None:
    assert select_regions(REGIONS, ids=[5]).polygons[0] == REGIONS.polygons[3]


@pytest.mark.parametrize(
    ("choice", "words"),
    [
        ({"ids": [2, 4, 99]}, "no region 4, 99; there are 1, 2, 3, 5, 7"),
        ({"condition": "mean > 9"}, "none of the 5 regions"),
        ({"largest": 0}, "at least 1"),
        ({"ids": []}, "none of the 5 regions"),
    ],
)
def test_a_criterion_that_cannot_be_met_is_refused(choice: dict[str, object], words: str) -> None:
    with pytest.raises(RegionError, match=words):
        ids(**choice)


def test_no_class_is_no_choice() -> None:
    with pytest.raises(RegionError, match="no class is named"):
        of_classes(REGIONS, ())


def test_a_long_list_of_ids_is_shortened() -> None:
    many = Regions({"id": np.arange(1, 2001)}, np.array([None] * 2000), None)
    with pytest.raises(RegionError, match=r"there are 1, 2, .*, 10, \.\.\. 2000 \(2000 in all\)$"):
        select_regions(many, ids=[0])
