"""Bands by name: names of files and of users, and which band a name stands for."""

import pytest
from hypothesis import given, strategies as st

from uavseg.errors import BandError, ParameterError, UavsegError
from uavseg.raster.spectral.band_names import common_names, find_band, listed, names_of, renamed
from uavseg.raster.spectral.bands import BandLayout

SENTINEL_2 = ["B1", "B2", "B3", "B4", "B5", "B6", "B7", "B8", "B8A", "B9", "B11", "B12"]


def layout(
    descriptions: list[str], roles: list[str] | None = None, micrometres: tuple[float | None, ...] = ()
) -> BandLayout:
    count = len(descriptions)
    return BandLayout(
        ("uint16",) * count,
        tuple(roles or ["undefined"] * count),
        (16,) * count,
        tuple(descriptions),
        micrometres,
    )


def test_a_band_is_found_by_each_of_its_names_in_any_case() -> None:
    bands = layout(["Band 4 - Red", "Band 8 - NIR", "sr_swir 1"])
    for name in ("B4", "b4", "red", "RED", "Band 4 - red", "band_4_red", "1"):
        assert find_band(bands, name) == 1
    assert [find_band(bands, name) for name in ("nir", "B8", "swir1", "SWIR16", "swir")] == [2, 2, 3, 3, 3]


@given(st.permutations(SENTINEL_2), st.data())
def test_names_follow_their_bands_in_any_order(order: list[str], data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(order))
    assert find_band(layout(order), name) == order.index(name) + 1
    assert find_band(layout(order), "nir") == order.index("B8") + 1
    assert find_band(layout(order), "swir2") == order.index("B12") + 1


@pytest.mark.parametrize(
    ("descriptions", "expected"),
    [
        (["B4", "B8", "B8A"], ["red", "nir", "nir08"]),  # B8A has no other satellite
        (["B02", "B03", "B04", "B12"], ["blue", "green", "red", "swir2"]),
        (["B2", "B3", "B4", "B8"], ["", "", "", ""]),  # of Sentinel-2, or of Landsat
        (["SR_B4", "SR_B5", "SR_B6"], ["red", "nir", "swir1"]),  # only Landsat 8 and 9 have SR_B6
        (["SR_B3", "SR_B4", "SR_B5"], ["", "", ""]),
        (["SR_B3", "SR_B4", "ST_B6"], ["red", "nir", "lwir"]),
        (["B4, central wavelength 665 nm", "B8, central wavelength 842 nm"], ["red", "nir"]),
        (["Near Infrared", "Red Edge", "Green (560 nm)"], ["nir", "rededge", "green"]),
        (["Red Edge 1", "Red edge 740", "Coastal aerosol"], ["rededge1", "rededge", "coastal"]),
        (["blue-green", "reduced", "infrared", "NDVI"], ["", "", "", ""]),
        (["Thermal Infrared", "Panchromatic", "LWIR"], ["lwir", "pan", "lwir"]),
    ],
)
def test_common_names_follow_from_descriptions_where_they_are_clear(
    descriptions: list[str], expected: list[str]
) -> None:
    count = len(descriptions)
    assert list(common_names(["undefined"] * count, descriptions, [None] * count)) == expected


def test_words_come_before_colours_and_colours_before_wavelengths() -> None:
    assert common_names(["red", "nir", "undefined"], ["blue", "", ""], [0.56, 0.56, 0.56]) == (
        "blue",
        "nir",
        "green",
    )


def test_an_unknown_or_ambiguous_name_lists_the_bands() -> None:
    bands = layout(SENTINEL_2)
    with pytest.raises(BandError, match=r"no band is named 'ner'; the bands are 1: B1, coastal; 2: B2, blue"):
        find_band(bands, "ner")
    with pytest.raises(BandError, match="'rededge' may be bands 5 and 6 and 7"):
        find_band(bands, "rededge")
    with pytest.raises(BandError, match="bands 1 and 2"):
        find_band(layout(["red", "red"]), "red")
    with pytest.raises(BandError, match="1 to 4, without names; to name them give --band-names"):
        find_band(layout(["", "", "", ""]), "nir")


def test_a_family_counts_only_where_no_band_has_the_name_itself() -> None:
    assert find_band(layout(["B8A", "B8", "B12"]), "nir") == 2
    assert find_band(layout(["B4", "B8A", "B12"]), "nir") == 2
    assert find_band(layout(["red", "red edge"]), "rededge1") == 2


def test_names_that_the_user_gives_take_the_place_of_those_of_the_file() -> None:
    bands = layout([""] * 4, ["red", "green", "blue", "alpha"])
    named = renamed(bands, "nir,red,green,RedEdge")
    assert [find_band(named, name) for name in ("nir", "red", "green", "rededge")] == [1, 2, 3, 4]
    assert named.roles == ("nir", "red", "green", "rededge") and named.alpha is None
    assert renamed(bands, ",,,nir").roles == ("red", "green", "blue", "nir")
    swapped = renamed(bands, "red=3")
    assert find_band(swapped, "red") == 3 and swapped.roles == ("undefined", "green", "red", "alpha")
    assert find_band(renamed(layout(SENTINEL_2), "water=10"), "water") == 10
    assert renamed(bands, None) is bands


@pytest.mark.parametrize(
    ("given_names", "words"),
    [
        ("red,green", "4 bands, and 2 names"),
        ("", "4 bands, and 1 names"),
        (",,,", "named once"),
        ("red,red,blue,nir", "named once"),
        ("swir1,swir16,blue,nir", "named once"),
        ("red,green,blue,n r", "word of letters"),
        ("red,green,blue,4", "word of letters"),
        ("nir=5", "no band 5"),
        ("nir=0", "no band 0"),
        ("nir=4,red", "nir=4,red=1"),
        ("nir=four", "nir=4,red=1"),
        ("nir=4,red=4", "named once"),
        ("a" * 41 + "=1", "word of letters"),
    ],
)
def test_wrong_names_are_refused(given_names: str, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        renamed(layout([""] * 4), given_names)


@pytest.mark.slow
@given(st.lists(st.text(max_size=30), min_size=1, max_size=6), st.text(max_size=20))
def test_whatever_a_file_says_messages_are_one_line(descriptions: list[str], name: str) -> None:
    bands = layout(descriptions)
    assert listed(bands).isprintable()
    try:
        assert find_band(bands, name) >= 1 or name.strip().isdigit()
    except UavsegError as error:
        assert str(error).isprintable()


def test_a_layout_without_descriptions_has_names_by_its_colours() -> None:
    bands = BandLayout(("uint8",) * 4, ("red", "green", "blue", "nir"), (8,) * 4)
    assert [band.common for band in names_of(bands)] == ["red", "green", "blue", "nir"]
