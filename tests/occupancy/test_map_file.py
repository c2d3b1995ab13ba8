"""Maps of grids as files: trinary by the thresholds of Nav2's map_saver."""

from pathlib import Path

import numpy as np
import pytest

from uavseg.errors import OutputError, OutputExistsError
from uavseg.occupancy.map_file import check_map_path, trinary_states, write_map
from uavseg.occupancy.mapping.grid import OccupancyGrid
from uavseg.occupancy.ros.ros_map import read_ros_map
from uavseg.raster.grid.geobox import local_geobox


@pytest.mark.parametrize(
    ("p", "state"), [(0.0, 1), (0.25, 1), (0.2501, 2), (0.5, 2), (0.6499, 2), (0.6501, 3), (1.0, 3)]
)
def test_states_follow_the_thresholds(p: float, state: int) -> None:
    assert trinary_states(np.array([[p]], np.float32)).tolist() == [[state]]


def test_a_written_map_is_read_as_the_same_states_in_its_place(tmp_path: Path) -> None:
    p = np.random.default_rng(3).choice([0.05, 0.4, 0.5, 0.6, 0.95], (20, 30))
    place = local_geobox((20, 30), 0.05, (-1.5, 2.25))
    grid = OccupancyGrid.from_probabilities(p, place)
    write_map(tmp_path / "map.yaml", grid.probabilities, grid.geobox)
    found = read_ros_map(tmp_path / "map.yaml")
    assert np.array_equal(found.cells, np.where(p < 0.3, 0, np.where(p > 0.8, 100, -1)))
    np.testing.assert_allclose(tuple(found.geobox.transform)[:6], tuple(place.transform)[:6], atol=1e-12)
    with pytest.raises(OutputExistsError):
        write_map(tmp_path / "map.yaml", grid.probabilities, grid.geobox)


def test_other_extensions_are_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"map\.png: a map is written to \.yaml"):
        check_map_path(tmp_path / "map.png")
    assert check_map_path(tmp_path / "map.yml") == [str(tmp_path / "map.yml"), str(tmp_path / "map.pgm")]
