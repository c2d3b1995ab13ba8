"""Layer of states: colours, contours, refused inputs."""

from pathlib import Path

import numpy as np
import pytest

from tests.plot.layers.maps import LOCAL, beliefs, of_raster, rgb, states, write
from uavseg.errors import MapError, RasterError
from uavseg.occupancy.ros.ros_map import write_ros_map
from uavseg.plot.preview import preview


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


@pytest.mark.slow
def test_a_ros_map_of_states_is_drawn_like_the_raster(tmp_path: Path) -> None:
    whole = np.where(states() == 0, 2, states())
    raster = write(tmp_path / "map.tif", beliefs(), LOCAL)
    write_ros_map(tmp_path / "s.yaml", whole, LOCAL)
    write(tmp_path / "s.tif", whole, LOCAL)
    drawn = [preview(raster, tmp_path / f"{s[2:]}.png", states=tmp_path / s) for s in ("s.tif", "s.yaml")]
    assert np.array_equal(rgb(drawn[0]), rgb(drawn[1]))
    preview(tmp_path / "s.yaml", tmp_path / "ros.png")  # and is a raster itself
    assert of_raster(tmp_path / "ros.png", 0.3, 0.85).min() > 240


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
