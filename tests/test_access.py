"""What the content of a file names is opened beside it, in allowed folders, and from allowed addresses."""

from pathlib import Path

import pytest

from uavseg.access import AccessPolicy, allowing, current_policy, is_address
from uavseg.errors import AccessError, RasterReadError

STRICT = AccessPolicy()


@pytest.fixture
def owner(tmp_path: Path) -> Path:
    """A file in `in/`, with other files beside it, below it and elsewhere."""
    for name in ("in/owner", "in/beside", "in/below/deep", "out/secret"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    return tmp_path / "in" / "owner"


def test_files_beside_and_below_are_allowed(owner: Path) -> None:
    for name in ("beside", "below/deep", "below/../beside", "../in/beside"):
        STRICT.check_file(owner, owner.parent / name)
        assert STRICT.check_name(owner, name, owner.parent) == owner.parent / name


def test_files_elsewhere_are_refused_whatever_their_path_looks_like(owner: Path) -> None:
    (owner.parent / "link").symlink_to("../out/secret")
    (owner.parent / "folder").symlink_to("../out")
    for name in ("../out/secret", "link", "folder/secret", str(owner.parent.parent / "out" / "secret")):
        with pytest.raises(AccessError, match=r"owner names .*--allow-path .*out"):
            STRICT.check_name(owner, name, owner.parent)
        allowed = AccessPolicy((str(owner.parent.parent / "out"),))
        assert allowed.check_name(owner, name, owner.parent) == owner.parent / name


def test_a_folder_whose_name_begins_alike_is_another_folder(owner: Path) -> None:
    (owner.parent.parent / "in2").mkdir()
    (owner.parent.parent / "in2" / "a").touch()
    with pytest.raises(AccessError):
        STRICT.check_file(owner, owner.parent.parent / "in2" / "a")


def test_a_file_that_is_missing_or_no_file_is_not_opened(owner: Path) -> None:
    for name in ("none", "below"):
        with pytest.raises(RasterReadError, match="names a file that cannot be read"):
            STRICT.check_name(owner, name, owner.parent)


@pytest.mark.parametrize(
    "address",
    [
        "http://example.org/a",
        "HTTPS://example.org/a",
        "ftp://a/b",
        "s3://b/k",
        "/vsicurl/http://a/b",
        "/vsicurl?url=http://a",
        "/vsicurl_streaming/http://a",
        "/vsis3/bucket/key",
        "/vsigs/b/k",
        "/vsiaz/b/k",
        "/vsihdfs/a",
    ],
)
def test_addresses_need_the_network_to_be_allowed(owner: Path, address: str) -> None:
    assert is_address(address)
    with pytest.raises(AccessError, match="--allow-network"):
        STRICT.check_name(owner, address, owner.parent)
    assert AccessPolicy(allow_network=True).check_name(owner, address, owner.parent) is None


@pytest.mark.parametrize(
    "name",
    [
        "",
        "<VRTDataset/>",
        "/vsizip/a.zip/b",
        "/vsimem/a",
        "vrt:///etc/passwd",
        'NETCDF:"a":b',
        "{}",
        "file:///etc/passwd",
    ],
)
def test_names_of_other_kinds_are_refused_even_where_all_is_allowed(owner: Path, name: str) -> None:
    with pytest.raises(AccessError, match="neither a file nor an address"):
        AccessPolicy(("/",), allow_network=True).check_name(owner, name, owner.parent)


def test_a_policy_holds_in_its_block(tmp_path: Path) -> None:
    with allowing(tmp_path, allow_network=True):
        assert current_policy() == AccessPolicy((str(tmp_path),), True)
        with allowing([tmp_path, str(tmp_path)]):
            assert current_policy() == AccessPolicy((str(tmp_path), str(tmp_path)))
        assert current_policy().allow_network
    assert current_policy() == STRICT
    with pytest.raises(AccessError, match="is not a folder"), allowing(tmp_path / "none"):
        pass
