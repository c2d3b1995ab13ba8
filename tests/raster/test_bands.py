import numpy as np
import pytest

from uavseg.errors import ParameterError, RasterError
from uavseg.raster.spectral.bands import BandLayout, choose_bands


def layout(roles: str, dtype: str = "uint8") -> BandLayout:
    names = tuple(roles.split())
    return BandLayout((dtype,) * len(names), names, (np.dtype(dtype).itemsize * 8,) * len(names))


@pytest.mark.parametrize(
    ("roles", "bands"),
    [
        ("gray", (1,)),
        ("gray alpha", (1,)),
        ("alpha gray", (2,)),
        ("gray undefined", (1,)),
        ("red green blue", (1, 2, 3)),
        ("blue green red nir", (3, 2, 1)),
        ("alpha red green blue", (2, 3, 4)),
        ("gray undefined undefined undefined", (1, 2, 3)),
        ("gray alpha undefined undefined", (1, 3, 4)),
        ("gray undefined alpha", (1,)),
        ("Y Cb Cr", (1,)),
        ("alpha", (1,)),
    ],
)
def test_colours_become_luminance_and_alpha_is_left_out(roles, bands):
    assert choose_bands(layout(roles)).bands == bands


def test_the_choice_of_the_user_is_kept():
    assert choose_bands(layout("red green blue"), band=2).bands == (2,)
    assert choose_bands(layout("red green blue nir"), rgb=(4, 1, 2)).bands == (4, 1, 2)
    assert choose_bands(layout("palette"), palette=True).expanded
    assert not choose_bands(layout("palette"), band=1, palette=True).expanded


@pytest.mark.parametrize(
    ("named", "words"),
    [
        ({"band": 5}, "bands 1 to 3"),
        ({"band": 0}, "no band 0"),
        ({"rgb": (1, 2, 4)}, "no band 4"),
        ({"rgb": (1, 2)}, "three bands"),
        ({"band": 1, "rgb": (1, 2, 3)}, "not both"),
    ],
)
def test_missing_bands_are_refused(named, words):
    with pytest.raises(ParameterError, match=words):
        choose_bands(layout("red green blue"), **named)


def test_bands_that_cannot_be_intensity_are_refused():
    with pytest.raises(RasterError, match="complex"):
        choose_bands(layout("gray", "complex64"))
    with pytest.raises(RasterError, match="CMYK"):
        choose_bands(layout("cyan magenta yellow black"))
    with pytest.raises(RasterError, match="different types"):
        choose_bands(BandLayout(("uint8", "uint8", "float32"), ("red", "green", "blue"), (8, 8, 32)))


def test_the_choice_has_a_readable_name():
    assert choose_bands(layout("gray")).name == "band 1"
    assert choose_bands(layout("blue green red")).name == "luminance of bands 3,2,1"
    assert choose_bands(layout("palette"), palette=True).name == "luminance of the palette of band 1"
