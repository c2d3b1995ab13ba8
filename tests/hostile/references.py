"""Cases of files that name other files or addresses: none is read, none is called."""

import json
from random import Random

from tests.hostile import seeds
from tests.hostile.block_maps import description, with_description
from tests.hostile.case import Case, chosen
from tests.hostile.mutate import json_mutated, words_mutated

VRT = """<VRTDataset rasterXSize="8" rasterYSize="8"><VRTRasterBand dataType="Byte" band="1"{raw}>
<{source}><SourceFilename relativeToVRT="0">{name}</SourceFilename><SourceBand>1</SourceBand>
<ImageOffset>0</ImageOffset><PixelOffset>1</PixelOffset><LineOffset>8</LineOffset></{source}></VRTRasterBand></VRTDataset>"""
WMS = """<GDAL_WMS><Service name="TMS"><ServerUrl>{name}/${{z}}/${{x}}/${{y}}.png</ServerUrl></Service><DataWindow>
<UpperLeftX>0</UpperLeftX><UpperLeftY>1</UpperLeftY><LowerRightX>1</LowerRightX><LowerRightY>0</LowerRightY>
<TileLevel>1</TileLevel><SizeX>8</SizeX><SizeY>8</SizeY></DataWindow><BandsCount>1</BandsCount></GDAL_WMS>"""
OGR_VRT = """<OGRVRTDataSource><OGRVRTLayer name="r"><SrcDataSource>{name}</SrcDataSource></OGRVRTLayer></OGRVRTDataSource>"""
RASTER_COMMANDS = (
    ("info", "x.tif", "--threads", "1"),
    ("preview", "x.tif", "-o", "out.png", "--width", "300"),
    ("classify", "x.tif", "-o", "out.tif", "--threads", "1"),
    ("extract", "x.tif", "--range", "0,1", "-o", "out.geojson", "--threads", "1"),
    ("match", "x.tif", "--like", "4,4,3", "-o", "out.geojson", "--threads", "1"),
    ("divide", "x.tif", "-o", "out.tif", "--threads", "1"),
    ("map", "x.tif", "-o", "out.html", "--size", "64", "--threads", "1"),
    ("serve", "x.tif", "--size", "64", "--threads", "1"),
    ("plan", "r.geojson", "-o", "out.plan", "--altitude", "50", "--home", "auto", "--dem", "x.tif"),
)
SHAPE_COMMANDS = (
    ("plan", "r.geojson", "-o", "out.plan", "--altitude", "50", "--home", "auto"),
    ("preview", "x.tif", "--regions", "r.geojson", "-o", "out.png", "--width", "300"),
    ("match", "x.tif", "--like", "r.geojson", "-o", "out.geojson", "--threads", "1"),
    ("match", "x.tif", "--classes", "r.geojson", "-o", "out.geojson", "--threads", "1"),
    ("map", "x.tif", "--regions", "r.geojson", "-o", "out.html", "--size", "64", "--threads", "1"),
    ("info", "r.geojson"),
)


def case(rng: Random, address: str) -> Case:
    """A file that names a file outside of its folder, or an address that listens."""
    name = rng.choice(
        (
            *("../outside/secret.bin", "../outside/secret.pgm", "/proc/self/maps", f"http://{address}/a.tif"),
            *(
                f"/vsicurl/http://{address}/a.tif",
                f"/vsicurl_streaming/http://{address}/a",
                f"WMS:http://{address}/",
            ),
            "VRT://../outside/secret.pgm?bands=1",
            "/vsisubfile/0_64,../outside/secret.bin",
        )
    )
    kind = rng.randrange(8)
    if kind < 3:
        raw = chosen(rng, 0.5)
        source = "SimpleSource" if not raw else ""
        text = VRT if source else VRT.replace("<{source}>", "").replace("</{source}>", "")
        text = text.format(name=name, source=source, raw=' subClass="VRTRawRasterBand"' if raw else "")
        if kind == 2:
            text = WMS.format(name=name)
        content = text.encode() if chosen(rng, 0.8) else words_mutated(text.encode(), rng)
        regions = {"r.geojson": seeds.vectors()["r.geojson"]}
        return Case({"x.tif": content, **regions}, (rng.choice(RASTER_COMMANDS),))
    if kind == 3:
        described = seeds.ros_maps()["m.yaml"].replace(b"m.pgm", name.encode())
        return Case({"m.yaml": described}, (("classify", "m.yaml", "-o", "out.tif", "--threads", "1"),))
    if kind == 4:
        known = seeds.block_map()
        header = json.loads(description(known["b.tif"])) | {"rasters": [name]}
        content = with_description(known["b.tif"], json.dumps(header))
        return Case(
            {"b.tif": content},
            (("extract", "b.tif", "--range", "0,1", "-o", "out.geojson", "--threads", "1"),),
        )
    x = seeds.vectors()["x.tif"]
    if kind == 7:
        assets = {"a": {"href": rng.choice((name, "x.tif"))}, "b": {"href": name, "type": "image/tiff"}}
        item = json.dumps({"type": "Feature", "stac_version": "1.0.0", "assets": assets}).encode()
        content = rng.choice((json_mutated, words_mutated, lambda item, _: item))(item, rng)
        source = rng.choice(("item.json#a", "item.json#a", "item.json#b", "item.json#c", "item.json"))
        words = tuple(source if word == "x.tif" else word for word in rng.choice(RASTER_COMMANDS))
        return Case({"item.json": content, "x.tif": x, "r.geojson": seeds.vectors()["r.geojson"]}, (words,))
    if kind == 5:
        link = {"crs": {"type": "link", "properties": {"href": name, "type": "proj4"}}}
        content = json.dumps(json.loads(seeds.vectors()["hand.geojson"]) | link).encode()
    else:
        content = OGR_VRT.format(name=name).encode()
    return Case({"r.geojson": content, "x.tif": x}, (rng.choice(SHAPE_COMMANDS),))
