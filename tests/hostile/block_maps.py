"""Cases of block maps: by byte, by tag of the TIFF, and by value of the JSON in one of them."""

import html
import re
from random import Random

from tests.hostile import seeds
from tests.hostile.case import Arguments, Case, chosen
from tests.hostile.mutate import bytes_mutated, json_mutated, tag_bytes, tags_mutated, with_tag_bytes

TAG = "UAVSEG_BLOCK_MAP"
ITEM = rf'<Item name="{TAG}">(.*?)</Item>'
METADATA = 42112  # tag in which GDAL keeps texts
ONE = ("--threads", "1")
COMMANDS: tuple[Arguments, ...] = (
    ("info", "b.tif", *ONE),
    ("extract", "b.tif", "--range", "0.4,1", "-o", "out.geojson", *ONE),
    ("extract", "b.tif", "--range", "0.4,1", "--refine", "none", "-o", "out.geojson", *ONE),
    ("levels", "b.tif", "--width", "0.3", "-o", "out.geojson", *ONE),
    ("suggest", "b.tif", *ONE),
    ("suggest", "b.tif", "-o", "out.png", *ONE),
    ("classify", "b.tif", "-o", "out.tif", *ONE),
    (
        "path",
        "b.tif",
        "--range",
        "0,0.9",
        "--start",
        "500005,4499920",
        "--goal",
        "500030,4499930",
        "-o",
        "out.geojson",
        *ONE,
    ),
    ("divide", "b.tif", "-o", "out.tif", *ONE),
    ("preview", "b.tif", "-o", "out.png", "--width", "300"),
    ("preview", "x.tif", "--leaves", "b.tif", "-o", "out.png", "--width", "300"),
)


def case(rng: Random) -> Case:
    """A block map changed, and a command that reads it."""
    known = seeds.block_map()
    kind = rng.randrange(4)
    if kind == 0:
        content = bytes_mutated(known["b.tif"], rng)
    elif kind == 1:
        content = tags_mutated(known["b.tif"], rng)
    else:
        content = _described(known["b.tif"], rng)
    files = {"b.tif": content, "x.tif": known["x.tif"]}
    command = rng.choice(COMMANDS)
    if "x.tif" not in command and chosen(rng, 0.3):
        del files["x.tif"]
    return Case(files, (command,))


def _described(content: bytes, rng: Random) -> bytes:
    """The file with its description changed."""
    header = json_mutated(description(content), rng).decode("utf-8", "replace")
    return with_description(content, header)


def description(content: bytes) -> str:
    """The JSON that a block map says of itself."""
    found = re.search(ITEM, tag_bytes(content, METADATA).decode())
    assert found is not None
    return html.unescape(html.unescape(found[1]))  # GDAL escapes the text of an item twice


def with_description(content: bytes, header: str) -> bytes:
    """A block map that says other JSON of itself."""
    item = f'<Item name="{TAG}">{html.escape(html.escape(header))}</Item>'
    text = re.sub(ITEM, lambda _: item, tag_bytes(content, METADATA).decode())
    return with_tag_bytes(content, METADATA, text.replace("\0", "").encode("utf-8", "replace") + b"\0")
