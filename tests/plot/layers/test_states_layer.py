"""Layer of states: colours, contours, refused inputs."""

from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.plot.layers.maps import LOCAL, MOST, beliefs, of_raster, rgb, states, write
from uavseg.errors import MapError, RasterError
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.plot.frame import Frame
from uavseg.plot.layers import states_layer
from uavseg.plot.preview import preview
from uavseg.raster.dataset import Dataset
from uavseg.raster.geobox import GeoBox


def test_states_have_their_colours_and_nothing_stays_grey(tmp_path: Path) -> None:
    grey = write(tmp_path / "map.tif", np.full((128, 192), 0.5, np.float32))
    out = preview(
        grey, tmp_path / "a.png", states=write(tmp_path / "s.tif", states(), nodata=0), width_px=600
    )
    free, unknown, occupied, nothing = (
        of_raster(out, *place) for place in ((0.3, 0.15), (0.3, 0.5), (0.3, 0.85), (0.85, 0.5))
    )
    assert free.argmax() == 1 and np.ptp(free) > 30
    assert occupied.argmax() == 0 and np.ptp(occupied) > 60
    assert np.ptp(unknown) < 12 and np.ptp(nothing) == 0
    assert (np.abs(nothing - 127) <= 1).all()  # 0.5 is never stretched
    line = rgb(out)[:, : rgb(out).shape[1] // 2]
    assert ((line == 255).all(axis=2).sum(axis=0) > 0.4 * len(line)).any()  # contours are white


def test_a_ros_map_of_states_is_drawn_like_the_raster(tmp_path: Path) -> None:
    whole = np.where(states() == 0, 2, states())
    raster = write(tmp_path / "map.tif", beliefs(), LOCAL)
    write_ros_map(tmp_path / "s.yaml", whole, LOCAL)
    write(tmp_path / "s.tif", whole, LOCAL)
    drawn = [preview(raster, tmp_path / f"{s[2:]}.png", states=tmp_path / s) for s in ("s.tif", "s.yaml")]
    assert np.array_equal(rgb(drawn[0]), rgb(drawn[1]))
    preview(tmp_path / "s.yaml", tmp_path / "ros.png")  # and is a raster itself
    assert of_raster(tmp_path / "ros.png", 0.3, 0.85).min() > 240


@settings(max_examples=40)
@given(st.integers(0, 2**32))
def test_contours_are_as_long_as_the_edges_of_segments(seed: int) -> None:
    field = np.random.default_rng(seed).integers(0, 4, (9, 14)).astype(np.uint8)
    box = GeoBox(field.shape, Affine(2, 0, 30, 0, -2, 70), None)
    layer = states_layer.StatesLayer.of(Dataset.of_values(field, box, "states"), Frame(box), MOST)
    framed = np.pad(field, 1)
    edges = sum(
        int(((one != other) * ((one > 0).astype(int) + (other > 0))).sum())
        for one, other in ((framed[1:], framed[:-1]), (framed[:, 1:], framed[:, :-1]))
    )
    assert sum(np.hypot(*np.diff(line, axis=0).T).sum() for line in layer.contours) == pytest.approx(
        2 * edges
    )
    assert np.array_equal(layer.states, field)


def test_rasters_without_states_are_refused(tmp_path: Path) -> None:
    raster = write(tmp_path / "a.tif", beliefs())
    for wrong, error in (
        (write(tmp_path / "b.tif", np.full((128, 192), 4, np.uint8)), MapError),
        (raster, MapError),
        (write(tmp_path / "c.tif", states(), LOCAL), RasterError),
    ):
        with pytest.raises(error):
            preview(raster, tmp_path / "out.png", states=wrong)
        assert not (tmp_path / "out.png").exists()
