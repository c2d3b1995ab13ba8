"""Photographs read from files: poses come back for all makers; what is doubtful is refused or named."""

import math
import os
import warnings
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from tests.photographs.make import MAKERS, draw_photograph, insert_xmp
from uavseg.errors import PhotographError
from uavseg.flight.camera.camera import camera_named
from uavseg.photographs.read import Photograph, read_photographs

PHOTO = Photograph(
    path="a.jpg",
    lon=-121.5,
    lat=44.6,
    relative_m=60,
    altitude_m=800,
    yaw_deg=30,
    pitch_deg=-80,
    roll_deg=3,
    image_px=(120, 80),
    focal_px=100.0,
    taken_s=1_700_000_000.25,
)
POSED = tuple(maker for maker in MAKERS if maker not in ("ardupilot", "geotag"))
POSES = {
    "nadir": {"pitch_deg": -90.0, "roll_deg": 0.0},
    "oblique": {"pitch_deg": -45.0, "roll_deg": 0.0},
    "rolled": {"pitch_deg": -60.0, "roll_deg": 10.0},
    "backwards": {"pitch_deg": -60.0, "roll_deg": 179.0},
    "south west": {"lat": -33.9, "lon": -70.5, "yaw_deg": 250.0},
    "antimeridian": {"lon": -180.0, "lat": -16.5, "yaw_deg": -90.0},
}


def read(path: Path, **how: Any) -> Photograph:
    [photograph] = read_photographs([path], **how).photographs
    return photograph


def refused(path: Path, **how: Any) -> str:
    with pytest.raises(PhotographError) as caught:
        read_photographs([path], **how)
    return str(caught.value)


def assert_same_pose(found: Photograph, expected: Photograph, pixels: float = 0.05) -> None:
    """Assert that places are seen within some pixels of where they should be, and the rest is the same."""
    rays = expected.rays(expected.border(3))
    assert np.abs(found.pixels(rays.T) - expected.pixels(rays.T)).max() < pixels
    assert found.lat == pytest.approx(expected.lat, abs=1e-8)
    assert abs(math.remainder(found.lon - expected.lon, 360)) < 1e-8
    assert found.image_px == expected.image_px
    assert found.focal_px == pytest.approx(expected.focal_px, rel=1e-6)
    for name in ("relative_m", "altitude_m", "taken_s", "exposure_s"):
        wanted = getattr(expected, name)
        assert getattr(found, name) == (wanted if wanted is None else pytest.approx(wanted, abs=1e-3)), name


@pytest.mark.parametrize("suffix", [".jpg", ".tif"])
@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("maker", POSED)
def test_poses_come_back_from_the_tags_of_all_makers(
    maker: str, pose: str, suffix: str, tmp_path: Path
) -> None:
    photograph = replace(PHOTO, **POSES[pose], exposure_s=1 / 800)
    found = read(draw_photograph(tmp_path / f"a{suffix}", photograph, maker=maker))
    assert_same_pose(found, photograph)
    assert not found.is_ellipsoidal


@given(
    maker=st.sampled_from(POSED),
    yaw=st.floats(-180, 180),
    pitch=st.floats(-90, 20),
    roll=st.floats(-179, 179),
    lat=st.floats(-89, 89),
    lon=st.floats(-180, 180),
)
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_pose_comes_back(
    maker: str, yaw: float, pitch: float, roll: float, lat: float, lon: float, tmp_path: Path
) -> None:
    photograph = replace(PHOTO, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll, lat=lat, lon=lon)
    if (round(lat, 9), round(lon, 9)) != (0, 0):  # as it is written
        found = read(draw_photograph(tmp_path / "a.jpg", photograph, maker=maker))
        assert_same_pose(found, photograph)


@pytest.mark.parametrize("maker", ["dji", "skydio"])
def test_altitudes_above_the_ellipsoid_are_told_by_the_tags(maker: str, tmp_path: Path) -> None:
    photograph = replace(PHOTO, is_ellipsoidal=True)
    assert read(draw_photograph(tmp_path / "a.jpg", photograph, maker=maker)).is_ellipsoidal


@pytest.mark.parametrize(
    ("xmp", "ellipsoidal"),
    [
        ({"drone-dji:AltitudeType": "RtkAlt"}, True),
        ({"drone-dji:AltitudeType": "PressureAlt", "drone-dji:RtkFlag": "0"}, False),
        ({"drone-dji:RtkFlag": "50"}, True),
        ({"drone-dji:RtkFlag": "34"}, True),
        ({"drone-dji:RtkFlag": "0"}, False),
        ({"Camera:VertCS": "EPSG:4979"}, True),
        ({"Camera:VertCS": "EPSG:5773"}, False),
    ],
)
def test_what_altitudes_are_above(xmp: dict[str, str], ellipsoidal: bool, tmp_path: Path) -> None:
    assert read(draw_photograph(tmp_path / "a.jpg", PHOTO, xmp=xmp)).is_ellipsoidal is ellipsoidal


@pytest.mark.parametrize(
    ("ref", "altitude", "ellipsoidal"), [(0, 800, False), (1, -800, False), (2, 800, True), (3, -800, True)]
)
def test_references_of_altitudes_in_exif(
    ref: int, altitude: float, ellipsoidal: bool, tmp_path: Path
) -> None:
    path = draw_photograph(tmp_path / "a.jpg", PHOTO, maker="ardupilot", gps={5: bytes([ref])})
    found = read(path)
    assert (found.altitude_m, found.is_ellipsoidal) == (altitude, ellipsoidal)


def test_speed_and_error_of_the_position_are_read(tmp_path: Path) -> None:
    photograph = replace(PHOTO, speed_m_s=7.5, position_error_m=0.02)
    found = read(draw_photograph(tmp_path / "a.jpg", photograph))
    assert found.speed_m_s == pytest.approx(7.5) and found.position_error_m == pytest.approx(0.02, abs=1e-4)
    path = draw_photograph(
        tmp_path / "b.jpg", photograph, maker="pix4d", gps={12: "K", 13: IFDRational(36, 1)}
    )
    assert read(path).speed_m_s == pytest.approx(10) and read(path).position_error_m == pytest.approx(0.02)


# ---- what the makers publish


def published(path: Path, size: tuple[int, int], xmp: str, exif: dict[int, Any], gps: dict[int, Any]) -> Path:
    """Write a JPEG with tags of a source that is named beside them."""
    tags = Image.Exif()
    for tag, value in exif.items():
        if tag < 0x8000:
            tags[tag] = value
    tags.get_ifd(0x8769).update({tag: value for tag, value in exif.items() if tag >= 0x8000})
    tags.get_ifd(0x8825).update(gps)
    Image.new("L", size).save(path, "JPEG", exif=tags)
    packet = (
        '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF '
        f'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">{xmp}</rdf:RDF></x:xmpmeta>'
    )
    return insert_xmp(path, packet.encode())


DJI = 'xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/"'


def test_tags_of_dji_as_elements(tmp_path: Path) -> None:
    """Values of https://github.com/domlysz/BlenderGIS/issues/378."""
    xmp = f"""<rdf:Description rdf:about="DJI Meta Data" {DJI}>
        <drone-dji:GpsLatitude>+44.5135795</drone-dji:GpsLatitude>
        <drone-dji:GpsLongitude>-64.3007844</drone-dji:GpsLongitude>
        <drone-dji:AbsoluteAltitude>+46.00</drone-dji:AbsoluteAltitude>
        <drone-dji:RelativeAltitude>+46.00</drone-dji:RelativeAltitude>
        <drone-dji:GimbalRollDegree>+0.00</drone-dji:GimbalRollDegree>
        <drone-dji:GimbalYawDegree>+84.20</drone-dji:GimbalYawDegree>
        <drone-dji:GimbalPitchDegree>-44.50</drone-dji:GimbalPitchDegree>
        <drone-dji:FlightRollDegree>+10.90</drone-dji:FlightRollDegree>
        <drone-dji:FlightYawDegree>+111.00</drone-dji:FlightYawDegree>
        <drone-dji:FlightPitchDegree>-7.80</drone-dji:FlightPitchDegree>
        <drone-dji:CamReverse>0</drone-dji:CamReverse>
        <drone-dji:GimbalReverse>0</drone-dji:GimbalReverse>
        <drone-dji:SelfData/></rdf:Description>"""
    found = read(published(tmp_path / "a.jpg", (400, 300), xmp, {0xA405: 24}, {}))
    assert (found.lat, found.lon, found.relative_m, found.altitude_m) == (44.5135795, -64.3007844, 46, 46)
    assert (found.yaw_deg, found.pitch_deg, found.roll_deg) == (84.2, -44.5, 0)
    assert found.focal_px == pytest.approx(24 * 500 / 43.27)


def test_tags_of_dji_below_the_sea(tmp_path: Path) -> None:
    """Values of https://github.com/drewnoakes/metadata-extractor-dotnet/pull/298; the place is made up."""
    xmp = f"""<rdf:Description {DJI} drone-dji:AbsoluteAltitude="-30.037239"
        drone-dji:RelativeAltitude="19.700001" drone-dji:GimbalRollDegree="0.000000"
        drone-dji:GimbalYawDegree="69.400002" drone-dji:GimbalPitchDegree="-60.000000"
        drone-dji:FlightRollDegree="-2.100000" drone-dji:FlightYawDegree="69.699997"
        drone-dji:FlightPitchDegree="-0.500000" drone-dji:CamReverse="0" drone-dji:GimbalReverse="0"/>"""
    place = {1: "N", 2: (IFDRational(52), IFDRational(30), IFDRational(0)), 3: "E", 4: (5.0, 30.0, 0.0)}
    found = read(published(tmp_path / "a.jpg", (400, 300), xmp, {0xA405: 24}, place))
    assert (found.lat, found.lon, found.relative_m) == (52.5, 5.5, 19.700001)
    assert found.altitude_m == -30.037239
    assert (found.yaw_deg, found.pitch_deg) == (69.400002, -60)


def test_tags_of_parrot_say_the_same_in_two_conventions(tmp_path: Path) -> None:
    """Values of https://developer.parrot.com/docs/groundsdk-tools/photo-metadata.html, of one file."""
    camera = """<Camera:Roll>-0.041258</Camera:Roll><Camera:Pitch>38.011101</Camera:Pitch>
        <Camera:Yaw>146.781036</Camera:Yaw><Camera:AboveGroundAltitude>11485529/262144</Camera:AboveGroundAltitude>
        <Camera:GPSXYAccuracy>845389/2097152</Camera:GPSXYAccuracy>"""
    parrot = """<drone-parrot:CameraRollDegree>-0.052789</drone-parrot:CameraRollDegree>
        <drone-parrot:CameraPitchDegree>-51.988888</drone-parrot:CameraPitchDegree>
        <drone-parrot:CameraYawDegree>146.848038</drone-parrot:CameraYawDegree>"""
    spaces = (
        'xmlns:Camera="http://pix4d.com/camera/1.0/" '
        'xmlns:drone-parrot="http://www.parrot.com/drone-parrot/1.0/"'
    )
    minute = IFDRational(21.1367729995753), IFDRational(49.15540455031244)
    place = {
        1: "N",
        2: (48.0, minute[0], 0.0),
        3: "E",
        4: (2.0, minute[1], 0.0),
        6: IFDRational(4971569, 65536),
    }
    both, one = (
        read(
            published(
                tmp_path / f"{len(inside)}.jpg",
                (400, 300),
                f"<rdf:Description {spaces}>{inside}</rdf:Description>",
                {0xA405: 24},
                place,
            )
        )
        for inside in (camera + parrot, camera)
    )
    assert (both.yaw_deg, both.pitch_deg, both.roll_deg) == (146.848038, -51.988888, -0.052789)
    for name in ("yaw_deg", "pitch_deg", "roll_deg"):
        assert getattr(one, name) == pytest.approx(getattr(both, name), abs=0.15)
    assert both.lat == pytest.approx(48 + 21.1367729995753 / 60, abs=1e-6)
    assert both.lon == pytest.approx(2 + 49.15540455031244 / 60, abs=1e-6)
    assert both.altitude_m == pytest.approx(4971569 / 65536)
    assert both.relative_m == float(Fraction(11485529, 262144))
    assert both.position_error_m == 845389 / 2097152


def test_tags_of_skydio_in_their_structures(tmp_path: Path) -> None:
    """Pose of the tests of github.com/Theta-Limited/OpenAthenaIOS; focal length of support.skydio.com."""
    xmp = """<rdf:Description xmlns:drone-skydio="https://www.skydio.com/drone-skydio/1.0/"
        drone-skydio:Latitude="32.2" drone-skydio:Longitude="-110.924547"
        drone-skydio:AbsoluteAltitude="1034.441910">
        <drone-skydio:CameraOrientationNED drone-skydio:Roll="0.186841" drone-skydio:Pitch="-7.468572"
            drone-skydio:Yaw="127.444323"/>
        <drone-skydio:CameraOrientationFLU drone-skydio:Roll="1" drone-skydio:Pitch="2" drone-skydio:Yaw="3"/>
        <drone-skydio:CalibratedFocalLength drone-skydio:X="2376.5625" drone-skydio:Y="2376.5625"/>
        </rdf:Description>"""
    found = read(
        published(tmp_path / "a.jpg", (4056, 3040), xmp, {0x010F: "Skydio", 0x0110: "2", 0xA405: 21}, {})
    )
    assert (found.yaw_deg, found.pitch_deg, found.roll_deg) == (127.444323, -7.468572, 0.186841)
    assert (found.lon, found.altitude_m, found.focal_px) == (-110.924547, 1034.44191, 2376.5625)
    assert not found.is_ellipsoidal


@pytest.mark.parametrize(
    ("space", "known"),
    [("http://www.dji.com/drone-dji/1.0/", True), ("http://skydio.com/1.0", True), ("http://a.org/", False)],
)
def test_tags_count_in_the_namespaces_of_drones_alone(space: str, known: bool, tmp_path: Path) -> None:
    xmp = f"""<rdf:Description xmlns:x="{space}" x:GimbalPitchDegree="-50" x:GimbalYawDegree="9"/>"""
    place = {1: "N", 2: (52.0, 30.0, 0.0), 3: "E", 4: (5.0, 30.0, 0.0), 16: "T", 17: IFDRational(70)}
    found = read(published(tmp_path / "a.jpg", (400, 300), xmp, {0xA405: 24}, place))
    assert (found.yaw_deg, found.pitch_deg) == ((9, -50) if known else (70, -90))


def test_altitudes_of_the_skydio_x10_are_above_the_ellipsoid(tmp_path: Path) -> None:
    """As of support.skydio.com/hc/en-us/articles/32887502774171: GPSAltitudeRef is 0 all the same."""
    xmp = {"Camera:VertCS": None}
    assert read(draw_photograph(tmp_path / "a.jpg", PHOTO, maker="skydio", xmp=xmp)).is_ellipsoidal
    assert not read(draw_photograph(tmp_path / "b.jpg", PHOTO, maker="old skydio")).is_ellipsoidal


# ---- positions


@pytest.mark.parametrize("maker", ["dji", "ardupilot"])
def test_a_photograph_without_a_position_is_refused(maker: str, tmp_path: Path) -> None:
    nowhere = dict.fromkeys((1, 2, 3, 4)), {"drone-dji:GpsLatitude": None, "drone-dji:GpsLongtitude": None}
    path = draw_photograph(tmp_path / "a.jpg", PHOTO, maker=maker, gps=nowhere[0], xmp=nowhere[1])
    assert refused(path) == "no photograph can be placed; a.jpg: left out, as it has no position"


@pytest.mark.parametrize("maker", ["dji", "ardupilot"])
def test_zero_zero_is_no_position(maker: str, tmp_path: Path) -> None:
    path = draw_photograph(tmp_path / "a.jpg", replace(PHOTO, lat=0, lon=0), maker=maker)
    assert "it has no position" in refused(path)


def test_a_position_of_zero_in_xmp_leaves_that_of_exif(tmp_path: Path) -> None:
    zero = {"drone-dji:GpsLatitude": "0.0", "drone-dji:GpsLongtitude": "0.0"}
    found = read(draw_photograph(tmp_path / "a.jpg", PHOTO, xmp=zero))
    assert (found.lat, found.lon) == (pytest.approx(44.6), pytest.approx(-121.5))


@pytest.mark.parametrize(
    ("lat", "lon"), [("-44.600000000", None), (None, "121.500000000"), ("-44.600000000", "121.500000000")]
)
def test_swapped_signs_are_refused(lat: str | None, lon: str | None, tmp_path: Path) -> None:
    given = {"drone-dji:GpsLatitude": lat, "drone-dji:GpsLongtitude": lon}
    xmp: Any = {name: text for name, text in given.items() if text is not None}
    assert "more than 100 m apart" in refused(draw_photograph(tmp_path / "a.jpg", PHOTO, xmp=xmp))


def test_positions_that_differ_are_refused(tmp_path: Path) -> None:
    near = draw_photograph(tmp_path / "a.jpg", PHOTO, xmp={"drone-dji:GpsLatitude": "44.6008"})  # 89 m
    taken = read_photographs([near])
    assert taken.photographs[0].lat == 44.6008 and taken.notes == ()
    far = draw_photograph(tmp_path / "b.jpg", PHOTO, xmp={"drone-dji:GpsLatitude": "44.6010"})  # 111 m
    says = "its positions in XMP and EXIF are more than 100 m apart: correct one"
    assert refused(far) == f"no photograph can be placed; b.jpg: left out, as {says}"


@pytest.mark.parametrize("missing", [1, 3])
def test_references_that_are_missing(missing: int, tmp_path: Path) -> None:
    alone = draw_photograph(tmp_path / "a.jpg", PHOTO, maker="ardupilot", gps={missing: None})
    assert "lacks the references" in refused(alone)
    swapped = draw_photograph(tmp_path / "b.jpg", PHOTO, maker="ardupilot", gps={1: "W", 3: "N"})
    assert "lacks the references" in refused(swapped)
    with_xmp = draw_photograph(tmp_path / "c.jpg", PHOTO, gps={missing: None})
    assert "lacks the references" in refused(with_xmp)


# ---- yaw that nothing says


def test_geotags_look_straight_down_along_the_track(tmp_path: Path) -> None:
    step = 1e-4
    places = [(44.6, -121.5), (44.6 + step, -121.5), (44.6 + step, -121.5 - step), (44.6, -121.5 - step)]
    for number, (lat, lon) in enumerate(places):
        photograph = replace(PHOTO, lat=lat, lon=lon, taken_s=1.7e9 + number)
        draw_photograph(tmp_path / f"{9 - number}.jpg", photograph, maker="geotag")
    taken = read_photographs([tmp_path])
    assert [Path(one.path).name for one in taken.photographs] == ["9.jpg", "8.jpg", "7.jpg", "6.jpg"]
    yaws = [one.yaw_deg for one in taken.photographs]
    np.testing.assert_allclose(np.cos(np.radians(np.subtract(yaws, [0, -90, 180, 180]))), 1, atol=1e-6)
    assert {one.pitch_deg for one in taken.photographs} == {-90}
    assert taken.notes == (
        "9.jpg, 8.jpg, 7.jpg and 1 more: no angles of the camera: it is taken to look straight down",
        "9.jpg, 8.jpg, 7.jpg and 1 more: no yaw: the direction to the next photograph is taken",
    )


def test_the_track_goes_over_the_antimeridian(tmp_path: Path) -> None:
    for number, lon in enumerate((179.9999, -179.9999)):
        photograph = replace(PHOTO, lon=lon, taken_s=1.7e9 + number)
        draw_photograph(tmp_path / f"{number}.jpg", photograph, maker="geotag")
    assert [one.yaw_deg for one in read_photographs([tmp_path]).photographs] == pytest.approx([90, 90])


def test_photographs_at_one_place_have_no_direction(tmp_path: Path) -> None:
    for number in range(2):
        draw_photograph(tmp_path / f"{number}.jpg", replace(PHOTO, taken_s=1.7e9 + number), maker="geotag")
    assert "0.jpg, 1.jpg: left out, as nothing says where its top is" in refused(tmp_path)


def test_the_direction_of_the_image_is_its_yaw(tmp_path: Path) -> None:
    path = draw_photograph(tmp_path / "a.jpg", PHOTO, maker="ardupilot")
    taken = read_photographs([path])
    assert taken.photographs[0].yaw_deg == 30
    assert taken.notes[1] == "a.jpg: yaw is that of the direction of the image in EXIF"
    path = draw_photograph(tmp_path / "b.jpg", PHOTO, maker="ardupilot", gps={16: "M"})
    assert "nothing says where its top is" in refused(path)  # a magnetic direction


def test_the_yaw_of_the_vehicle_stands_in_for_that_of_the_gimbal(tmp_path: Path) -> None:
    taken = read_photographs(
        [draw_photograph(tmp_path / "a.jpg", PHOTO, xmp={"drone-dji:GimbalYawDegree": None})]
    )
    assert taken.photographs[0].yaw_deg == 77
    assert taken.notes == ("a.jpg: no yaw of the camera: that of the vehicle is taken",)


# ---- lenses and images


@pytest.mark.parametrize(
    ("exif", "focal"),
    [
        ({0xA404: IFDRational(2, 1)}, 200),  # digital zoom
        ({0xA404: IFDRational(0, 1)}, 100),  # none
        ({0xA404: IFDRational(0, 0)}, 100),
        ({0xA002: 240, 0xA003: 160}, 50),  # reduced after it was taken; 100 pixels are those of 240 x 160
    ],
)
@pytest.mark.parametrize("maker", ["dji", "pix4d"])
def test_the_focal_length_is_that_of_the_image(
    maker: str, exif: dict[int, Any], focal: float, tmp_path: Path
) -> None:
    assert read(draw_photograph(tmp_path / "a.jpg", PHOTO, maker=maker, exif=exif)).focal_px == focal


def test_a_camera_of_the_catalogue_is_known_by_its_name(tmp_path: Path) -> None:
    shot = replace(PHOTO, image_px=(96, 72))
    none: dict[int, Any] = {0xA20E: None, 0x920A: None}
    found = read(draw_photograph(tmp_path / "a.jpg", shot, maker="pix4d", exif=none))
    assert found.camera == "Parrot Sequoia"
    assert found.focal_px == pytest.approx(3.98 / 4.8 * 96)
    other = draw_photograph(tmp_path / "b.jpg", PHOTO, maker="pix4d", exif=none)  # of another shape: 3:2
    assert "name its camera with --camera" in refused(other)
    assert read(other, camera=camera_named("DJI Phantom 4 Pro")).focal_px == pytest.approx(80.0)


def test_a_camera_of_another_shape_is_refused(tmp_path: Path) -> None:
    path = draw_photograph(tmp_path / "a.jpg", PHOTO)
    assert "another shape than the 4000 x 3000" in refused(path, camera=camera_named("DJI Mavic Pro"))


def test_a_turned_image_is_read_as_it_is_stored(tmp_path: Path) -> None:
    found = read(draw_photograph(tmp_path / "a.jpg", PHOTO, exif={0x0112: 3}))
    rays = PHOTO.rays(PHOTO.border(2))
    np.testing.assert_allclose(
        found.pixels(rays.T).T, np.array(PHOTO.image_px) - PHOTO.pixels(rays.T).T, atol=1e-6
    )
    for orientation in (2, 4, 5, 6, 7, 8, 9):
        path = draw_photograph(tmp_path / "b.jpg", PHOTO, exif={0x0112: orientation})
        assert f"orientation tag is {orientation}" in refused(path)


def test_the_preview_of_a_raw_image_is_refused(tmp_path: Path) -> None:
    path = draw_photograph(tmp_path / "a.tif", PHOTO, exif={0x00FE: 1, 0xA002: 480, 0xA003: 320})
    raw = path.rename(tmp_path / "a.dng")
    assert "the preview of a raw one: name the JPEG of the camera" in refused(raw)
    draw_photograph(tmp_path / "a.jpg", PHOTO)
    taken = read_photographs([tmp_path])
    assert [Path(one.path).name for one in taken.photographs] == ["a.jpg"]
    assert taken.notes == ("1 other files in folders are not photographs",)


def test_cameras_of_several_kinds_are_read_side_by_side(tmp_path: Path) -> None:
    first = draw_photograph(tmp_path / "a.jpg", PHOTO)
    second = draw_photograph(
        tmp_path / "b.jpg", replace(PHOTO, image_px=(64, 48), focal_px=60.0), maker="parrot"
    )
    found = {Path(one.path).name: one for one in read_photographs([first, second]).photographs}
    assert (found["a.jpg"].image_px, found["a.jpg"].camera) == ((120, 80), "DJI FC6310R")
    assert (found["b.jpg"].image_px, found["b.jpg"].camera) == ((64, 48), "Parrot Anafi")


# ---- files and folders


def test_folders_are_read_with_their_subfolders(tmp_path: Path) -> None:
    (tmp_path / "b" / "c").mkdir(parents=True)
    (tmp_path / ".hidden").mkdir()
    for place in ("a.JPG", "b/b.jpeg", "b/c/c.tif", ".hidden/d.jpg", ".e.jpg"):
        drawn = draw_photograph(tmp_path / "x.tif" if place.endswith("tif") else tmp_path / "x.jpg", PHOTO)
        drawn.rename(tmp_path / place)
    (tmp_path / "notes.txt").write_text("x")
    taken = read_photographs([tmp_path, tmp_path / "a.JPG"])
    assert sorted(Path(one.path).name for one in taken.photographs) == ["a.JPG", "b.jpeg", "c.tif"]
    assert taken.notes == ("2 other files in folders are not photographs",)
    assert len(read_photographs([tmp_path, tmp_path / "b"]).photographs) == 3


def test_a_pitch_without_a_yaw_is_refused(tmp_path: Path) -> None:
    for number in range(2):  # a track, which says the yaw of those without angles
        photograph = replace(PHOTO, lat=PHOTO.lat + number / 1000, taken_s=1.7e9 + number)
        draw_photograph(tmp_path / f"{number}.jpg", photograph, maker="pix4d", xmp={"Camera:Yaw": None})
    assert "it has a pitch of the camera, but no yaw" in refused(tmp_path)


def test_folders_behind_links_are_not_entered(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    draw_photograph(tmp_path / "in" / "a.jpg", PHOTO)
    (tmp_path / "in" / "loop").symlink_to(tmp_path, target_is_directory=True)
    (tmp_path / "in" / "gone.jpg").symlink_to(tmp_path / "nothing.jpg")
    assert len(read_photographs([tmp_path / "in"]).photographs) == 1


@pytest.mark.parametrize("what", ["missing", "empty", "pipe"])
def test_what_is_no_photograph_is_one_clear_error(what: str, tmp_path: Path) -> None:
    path = tmp_path / what
    if what == "empty":
        path.mkdir()
    if what == "pipe":
        os.mkfifo(path)
    says = {"missing": "there is no file", "empty": "has no photographs", "pipe": "is a named pipe"}
    assert says[what] in refused(path)
    with pytest.raises(PhotographError, match="name files or folders"):
        read_photographs([])


def test_those_that_cannot_be_placed_are_left_out_by_reason(tmp_path: Path) -> None:
    draw_photograph(tmp_path / "good.jpg", PHOTO)
    for number in range(5):
        draw_photograph(tmp_path / f"{number}.jpg", PHOTO, maker="geotag", gps=dict.fromkeys((1, 2, 3, 4)))
    for number in range(2):
        (tmp_path / f"z{number}.jpg").write_bytes(b"no image")
    taken = read_photographs([tmp_path])
    assert len(taken.photographs) == 1
    assert taken.notes == (
        "0.jpg, 1.jpg, 2.jpg and 2 more: left out, as it has no position",
        "z0.jpg, z1.jpg: left out, as it cannot be read as a JPEG or TIFF image",
    )


def test_order_and_progress(tmp_path: Path) -> None:
    for name, taken_s in (("c", 1.7e9), ("b", None), ("a", 1.7e9), ("d", 1.6e9)):
        draw_photograph(tmp_path / f"{name}.jpg", replace(PHOTO, taken_s=taken_s))
    seen: list[tuple[int, int]] = []
    taken = read_photographs([tmp_path], lambda done, total: seen.append((done, total)))
    assert [Path(one.path).stem for one in taken.photographs] == ["d", "a", "c", "b"]
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]


# ---- hostile files


@pytest.mark.parametrize("suffix", [".jpg", ".tif"])
def test_files_that_end_early_are_left_out_or_read(suffix: str, tmp_path: Path) -> None:
    whole = draw_photograph(tmp_path / f"whole{suffix}", PHOTO).read_bytes()
    path = tmp_path / f"cut{suffix}"
    for end in range(0, len(whole), max(len(whole) // 60, 1)):
        path.write_bytes(whole[:end])
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                found = read(path)
            except PhotographError as error:
                assert "\n" not in str(error)
                continue
        if found.notes:  # the time is the only tag that may be missing
            assert found.notes == ("some tags are cut short, and not read",)
            found = replace(found, taken_s=PHOTO.taken_s)
        assert_same_pose(found, PHOTO)


@pytest.mark.slow
@given(st.data())
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_files_are_read_or_refused(tmp_path: Path, data: st.DataObject) -> None:
    suffix = data.draw(st.sampled_from([".jpg", ".tif"]))
    whole = tmp_path / f"whole{suffix}"
    content = bytearray((whole if whole.exists() else draw_photograph(whole, PHOTO)).read_bytes())
    places = st.integers(0, min(len(content), 2600) - 1)
    for place in data.draw(st.lists(places, min_size=1, max_size=8)):
        content[place] = data.draw(st.integers(0, 255))
    path = tmp_path / f"damaged{suffix}"
    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = read(path)
        except PhotographError:
            return
    assert math.isfinite(found.lon + found.lat + found.yaw_deg + found.pitch_deg + found.roll_deg)
    assert found.focal_px > 0 and min(found.image_px) > 0


ENTITIES = (
    '<!DOCTYPE x [<!ENTITY a "{}"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]><x>&b;</x>',
    '<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/hostname">]><x>&a;</x>',
    "<x>",
    "\xff\xfe",
    "<a>" * 5000,
    '<rdf:Description drone-dji:GimbalPitchDegree="-90"/>',  # no namespaces
)


@pytest.mark.parametrize("xmp", ENTITIES)
def test_xmp_that_cannot_be_trusted_is_refused(xmp: str, tmp_path: Path) -> None:
    path = draw_photograph(tmp_path / "a.jpg", PHOTO, maker="ardupilot")
    assert "its XMP tags cannot be read" in refused(insert_xmp(path, xmp.encode()))


@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "1e999", "361", "north", "1/0", "0x10", "9" * 400])
@pytest.mark.parametrize(
    "tag",
    [
        *("GpsLatitude", "GpsLongtitude", "GimbalPitchDegree", "GimbalYawDegree", "GimbalRollDegree"),
        *("RelativeAltitude", "AbsoluteAltitude"),
    ],
)
def test_numbers_of_a_pose_that_are_none_are_refused(tag: str, text: str, tmp_path: Path) -> None:
    if tag.endswith("Altitude") and text == "361":
        text = "20001"
    path = draw_photograph(tmp_path / "a.jpg", PHOTO, xmp={f"drone-dji:{tag}": text})
    assert f"its tag drone:{tag} is" in refused(path)


@pytest.mark.parametrize("text", ["nan", "inf", "-1", "0", "x", "1e300"])
def test_a_focal_length_that_is_none_leaves_the_other(text: str, tmp_path: Path) -> None:
    path = draw_photograph(tmp_path / "a.jpg", PHOTO, xmp={"drone-dji:CalibratedFocalLength": text})
    assert read(path).focal_px == pytest.approx(100)


@pytest.mark.parametrize(
    ("tag", "value", "says"),
    [
        (2, (IFDRational(44, 0), IFDRational(0, 1), IFDRational(0, 1)), "its GPS tag 2 is (nan"),
        (2, (IFDRational(4_000_000_000, 1), IFDRational(0, 1), IFDRational(0, 1)), "its GPS tag 2 is (4"),
        (4, (IFDRational(0, 0), IFDRational(0, 0), IFDRational(0, 0)), "its GPS tag 4 is (nan"),
        (2, (), "it has no position"),
    ],
)
def test_rationals_that_are_no_place_are_refused(tag: int, value: Any, says: str, tmp_path: Path) -> None:
    path = draw_photograph(tmp_path / "a.jpg", PHOTO, maker="ardupilot", gps={tag: value})
    assert says in refused(path)


@pytest.mark.parametrize("value", [IFDRational(4_000_000_000, 1), IFDRational(1, 0)])
def test_altitudes_that_are_none_are_refused(value: Any, tmp_path: Path) -> None:
    path = draw_photograph(tmp_path / "a.jpg", PHOTO, maker="ardupilot", gps={6: value})
    assert "its GPS tag 6 is" in refused(path)


def test_headers_of_any_length_are_not_held(tmp_path: Path) -> None:
    content = draw_photograph(tmp_path / "a.jpg", PHOTO).read_bytes()
    segment = b"\xff\xe3" + (65535).to_bytes(2, "big") + bytes(65533)
    path = tmp_path / "long.jpg"
    path.write_bytes(content[:2] + segment * 600 + content[2:])
    assert "header is longer" in refused(path)
    path.write_bytes(content[:2] + segment * 100 + content[2:])  # temperatures of a thermal image
    assert_same_pose(read(path), PHOTO)


@pytest.mark.slow
def test_a_thousand_photographs_are_read(tmp_path: Path) -> None:
    content = draw_photograph(tmp_path / "0000.jpg", PHOTO).read_bytes()
    for number in range(1, 1000):
        (tmp_path / f"{number:04d}.jpg").write_bytes(content)
    assert len(read_photographs([tmp_path]).photographs) == 1000
