"""Command lines that work, one for each way of using a command, and what options may be added to them."""

from collections.abc import Iterator
from functools import cache

import click

from uavseg.cli import main

Words = tuple[str, ...]

FLIGHT = "--altitude 50 --home auto --speed 5 --tolerance 1"
DIVISION = "--threshold 1.2 --intensity-step 0.05"
RUN = "--threads 1 --tile 64"
LINES = tuple(
    line.split()
    for line in (
        f"extract x.tif --range 0.5,1 -o out.geojson {DIVISION} {RUN} --min-area 5 --fill-holes 5px --simplify 1",
        f"extract x.tif --range 0.5,1 -o out.geojson --flatten 40px {RUN}",
        f"extract rgb.tif --range 0.5,1 -o out.gpkg --stats bands --band-names red,green,blue {RUN}",
        f"levels x.tif --width 0.3 -o out.shp --stats bands {RUN}",
        f"extract x.tif --range 0.5,1 -o out.gpkg --thin-lines --flatten 40px {RUN}",
        f"divide x.tif -o out.tif --flatten 60 {RUN}",
        f"extract x.tif --range 0.5,1 -o out.gpkg --crs EPSG:3857 {RUN}",
        f"extract x.tif --range 0.5,1 -o out.geojson --bounds 500020,4499900,500090,4499980 --aoi hand.geojson {RUN}",
        f"divide x.tif -o out.tif --aoi hand.geojson --bounds 500010,4499900,500090,4499990 {RUN}",
        f"extract x.tif w.tif --warp --range 0.5,1 -o out.geojson {RUN}",
        f"divide w.tif x.tif --warp --bounds 15,40.6498,15.0012,40.6508 -o out.tif {RUN}",
        "preview w.tif x.tif --warp -o out.png --width 300",
        "preview rgb.tif -o out.png --width 300 --bounds 500020,4499900,500090,4499980",
        f"extract x.tif --range 0.5,1 -o out.geojson --detail 4px --min-confidence 0.5 {RUN}",
        f"extract x.tif --range 0.5,1 -o out.shp --smooth-outline 0.4 --band 1 --nodata 0 --stretch 0,255 {RUN}",
        f"extract x.tif --range 0.5,1 -o out.gpkg --regularize 3 --simplify 1 {RUN}",
        f"levels x.tif --width 0.3 -o out.geojson --regularize 2 {RUN}",
        f"extract x.tif --range 0.5,1 -o out.gpkg --connectivity 8 --refine pixels --min-area 3px {RUN}",
        f"levels x.tif --width 0.3 -o out.kml --connectivity 8 --min-area 3px {RUN}",
        f"extract x.tif --range 0.5,1 -o out.geojson --expr b1/2+sqrt(b1) --band-names b1 {RUN}",
        f"extract rgb.tif --range 0.5,1 -o out.geojson --index ngrdi --band-names red,green,blue {RUN}",
        f"extract x.tif --range 0.5,1 -o out.kml --labels out.vrt --refine tv --resume done {RUN}",
        f"extract x.tif --range 0.5,1 -o out.gpkg --mission out.plan {FLIGHT} --spacing 10 --angle 20 --threads 1",
        f"extract x.tif --values 20,200 -o out.geojson {RUN}",
        f"extract x.tif --percentile 90,100 -o out.gpkg --stretch minmax {RUN}",
        f"extract rgb.tif --band red --band-names red,green,blue --values 9,99 -o out.shp --style qml {RUN}",
        f"extract x.tif --range 0.5,1 -o out.gpkg --style sld --collar keep {RUN}",
        f"extract x.tif --classes c.csv -o out.geojson --style qml --mission out.plan --mission-class bright {FLIGHT} --allow-edge",
        f"extract x.tif --classes c.yaml -o out.gpkg --mission out.plan --mission-class bright --avoid-class dark {FLIGHT} --allow-edge {RUN}",
        f"levels x.tif --width 0.3 -o out.gpkg --style qml --collar auto {RUN}",
        f"suggest rgb.tif --index exg --band-names red,green,blue --collar keep --json {RUN}",
        f"suggest rgb.tif --like 500048,4499952,20 --unlike 500100,4499900,9 --bands red,green --band-names red,green,blue --json {RUN}",
        "info rgb.tif --expr (red-blue)/(red+blue) --band-names red,green,blue --collar auto --threads 1",
        *(f"info {name} --json" for name in ("r.geojson", "lv.geojson", "r.gpkg", "r.kml", "r.parquet")),
        "info r.fgb --threads 1",
        f"extract rgb.tif --rgb 1,2,3 --range 0.5,1 -o out.parquet --method paper {RUN}",
        f"extract x.tif --class a=0,0.4 --class b=0.4,1 -o out.gpkg --labels out.tif --min-area 9 {RUN}",
        f"extract x.tif --range 0.5,1 --range 0,0.4 -o out.fgb --mission out.plan --mission-class 0,0.4 {FLIGHT} --allow-edge",
        f"levels x.tif --breaks 0.3,0.6 -o out.fgb --refine tv --detail 9 --min-confidence 0.5 {RUN}",
        f"levels x.tif --breaks otsu:3 -o out.fgb --refine none {RUN}",
        f"extract x.tif --range 0.5,1 -o - --sequence --rs --projected {RUN}",
        f"extract x.tif --range 0.5,1 -o - --geographic --progress plain -v {RUN}",
        f"extract x.tif --range 0.5,1 --output out.geojson --scheduler tcp://127.0.0.1:9 --allow-path there {RUN}",
        f"extract x.tif --each --range 0.5,1 -o out.{{stem}}.gpkg --report out.csv --overwrite {RUN}",
        f"levels x.tif --each --width 0.3 -o out.{{stem}}.fgb --labels out.{{stem}}.tif --skip-existing {RUN}",
        f"levels x.tif --width 0.3 -o out.geojson --min-area 9 --small merge --simplify 1 {RUN}",
        f"levels x.tif --width 0.3 -o out.fgb --labels out.tif --stretch percentile:1,99 --co COMPRESS=LZW --co PREDICTOR=2 {DIVISION} {RUN}",
        f"match x.tif --like 500048,4499952,34 -o out.geojson --window 32 --similarity 0.9 --intensity 1 --bands 1 {RUN}",
        f"match x.tif --like 500048,4499952,20 -o out.fgb --unlike 500100,4499900,9 --by color --answer 2 --png out.png --labels out.tif --fill-holes 9px --min-area 9 --min-confidence 0.3 --detail 3px {RUN}",
        f"match rgb.tif --like 500048,4499952,20 -o out.gpkg --by color --ask --overwrite {RUN}",
        f"match x.tif --classes cl.geojson -o out.geojson --refine none --flatten 40px {RUN}",
        f"suggest x.tif --classes 3 -o out.png {DIVISION} {RUN}",
        f"classify x.tif -o out.tif --stretch 0,255 --free-below 0.4 --occupied-above 0.6 --min-area 4 {RUN}",
        f"classify m.tif -o out.tif --objects out.geojson {RUN}",
        f"classify m.tif -o out.yaml --mode scale {DIVISION} --threads 1",
        "classify m.pgm -o out.tif --free-is-white --method paper --allow-lost-obstacles --threads 1",
        f"describe r.gpkg -o out.gpkg --layer r --raster x.tif --band 1 --nodata 3 --stretch 0,255 {RUN}",
        f"describe m.tif -o out.geojson --gap 2 --min-area 4px {RUN}",
        f"recognise r.gpkg -o out.gpkg --library r.gpkg --raster x.tif --min-probability 0.3 {RUN}",
        f"recognise m.pgm --free-is-white --library out.gpkg --learn disc --ids 1 {RUN}",
        f"path x.tif --range 0,0.9 --start 500005,4499920 --goal 500030,4499930 --clearance 1 -o out.geojson {RUN}",
        f"path x.tif --range 0,0.9 --start 500005,4499920 --goal 500030,4499930 -o out.plan {FLIGHT[:-14]} {RUN}",
        f"next-view m.yaml --pose 1,1,90 --range 2 --fov 90 --clearance 0.1 --count 3 -o out.geojson {RUN}",
        "explore m.yaml --range 2 --start 1,1 --step 3 -o out.geojson --table out.csv --map out.tif --animation out.gif",
        f"original x.tif -o out.tif --threshold 1.2 --merge-stop 2 --untested 0.1 --radius 2 --sweeps 1 {RUN}",
        f"divide x.tif -o out.tif --co COMPRESS=ZSTD --co ZSTD_LEVEL=3 --co BIGTIFF=YES {DIVISION} --bidx 1 --nodata 5 {RUN}",
        "info x.tif --json --band 1 --nodata 3 --stretch minmax --threads 1",
        f"plan r.geojson -o out.plan {FLIGHT} --pattern survey --spacing 20 --angle 45 --autopilot px4",
        f"plan r.geojson -o out.plan {FLIGHT} --spacing 20 --margin 5 --turnaround 10 --crosshatch",
        f"plan r.geojson -o out.plan {FLIGHT} --sensor 13x9 --image 5200x3600 --focal 9 --trigger hover --shutter 1/500",
        f"plan r.gpkg --layer r --output out.plan {FLIGHT} --sensor 13x9 --image 5200x3600 --focal 9 --overlap 70,60 --min-interval 2 -q",
        f"plan r.geojson -o out.plan {FLIGHT} --pattern perimeter --offset 3 --min-leg 4 --holes fly",
        f"plan r.geojson -o out.plan {FLIGHT} --pattern orbit --margin 9",
        f"plan r.geojson -o out.waypoints {FLIGHT} --ids 1 --largest 2 --where area_m2>5",
        f"plan r.geojson -o out.plan {FLIGHT} --vehicle v.json --json --footprints",
        f"plan r.geojson -o out.plan {FLIGHT} --dem g.tif --terrain absolute --terrain-tolerance 2 --climb 3",
        f"plan r.geojson -o out.waypoints {FLIGHT} --dem g.tif --dem g.tif --terrain relative --descent 0.5",
        f"plan r.geojson -o out.kmz {FLIGHT} --spacing 12 --dji-model m30t --lens wide,ir --turn through",
        f"plan r.geojson -o out.plan {FLIGHT} --spacing 12 --editable --autopilot generic",
        f"plan r.geojson -o out.plan {FLIGHT} --ids 1 --avoid z.geojson --avoid-margin 5 --zone-width 4 --zone-height 7 --fence none",
        f"plan r.geojson -o out.plan {FLIGHT} --avoid 0.2,0.3 --raster x.tif --allow-edge --avoid-margin 0.1",
        f"plan r.geojson -o out.plan {FLIGHT} --spacing 3 --endurance 2.5 --reserve 20 --max-items 60 --wind 3,200",
        f"plan r.geojson -o out.csv {FLIGHT} --spacing 3 --max-waypoints 60 --flights 2",
        f"plan r.geojson -o out.plan {FLIGHT} --spacing 3 --vehicles 2",
        f"plan r.geojson -o out.plan {FLIGHT} --rally 40.6504,15.0004,30 --fence 40 --max-distance 3e3 --max-altitude 90",
        f"plan r.geojson -o out.csv {FLIGHT[14:]} --camera Altum --gsd 2 --overlap 70,60 --gimbal-pitch -90,-80",
        f"plan r.geojson -o out.kml {FLIGHT} --pattern corridor --spacing 9 --width 20",
        f"plan r.geojson -o out.geojson {FLIGHT} --pattern visit --hold 3",
        "check a.plan --autopilot px4 --json",
        "check a.waypoints --avoid z.geojson --avoid-margin 3 --zone-width 2 --zone-height 9 --max-altitude 90 --max-distance 2000 --dem g.tif",
        "resume a.plan --from 3.5 -o out.plan",
        "resume a.waypoints --from 40.65,15.0 -o out.kmz --dji-model m30t --lens wide --turn through -q",
        "resume a.plan --from x.tif -o out.plan --overwrite",
        "cameras mavic 3",
        "check a.plan --photos p.jpg --gaps out.gpkg --regions r.geojson --home 40.6500,15.0000,100 --json",
        "check a.plan --photos p.jpg --photos p.tif --gaps out.geojson --camera Sequoia --dem g.tif --overwrite",
        "footprints p.jpg -o out.gpkg --home 40.6500,15.0000,100 --camera Sequoia",
        "footprints p.jpg p.tif -o out.geojson --dem g.tif --progress plain",
        "georeference p.jpg 0.jpg -o out.tif --resolution 200 --home 40.6500,15.0000,100 --overwrite",
        "georeference p.jpg -o out.tif --dem g.tif --camera Sequoia --progress plain",
        "warm-up -q --processes 1",
        "doctor --json",
        "upload a.plan --connect tcp:127.0.0.1:9 --timeout 1",
        "download --connect tcp:127.0.0.1:9 --timeout 1 -o out.plan",
        "simulate s.json -o out.tif --seed 1 --truth out_truth.tif --sigma 0.05 --max-range 2 --fov 60 --step 2 --poses 1 --png out.png",
        "build-map a.bag -o out.yaml --scan /scan --odom /odom --resolution 0.1 --sigma 0.05 --max-range 2",
        "build-map a.db3 -o out.tif --scan /scan --tf --resolution 0.1 --co PREDICTOR=3 --co ZLEVEL=9",
        "build-map a.db3 -o out.yaml --heights 0.1,1.8 --no-return range_max --beam-order angles --mode raw",
        f"compare x.tif x.tif --range 0.5,1 -o out.gpkg --png out.png --min-area 9px --refine pixels {RUN}",
        f"compare rgb.tif x.tif --classes c.csv -o out.geojson --band 1 {RUN}",
        "compare m.yaml m.yaml -o out.gpkg --threads 1",
        "merge-maps m.yaml m.yaml -o out.yaml --crop --unrotate --resolution 0.2 --mode scale --allow-path .",
        "mask hand.geojson --map x.tif -o out.yaml --speed 40 --overwrite",
        "mask r.gpkg --map m.tif -o out.yaml --layer regions",
        "preview x.tif -o out.png --width 300 --regions r.geojson --mission a.plan --stretch dtype",
        "map x.tif -o out.html --size 100 --mission a.waypoints --camera Altum --band 1 --stretch dtype",
        "map x.tif -o out.html --size 64 --regions r.geojson --mission a.plan --threshold 1.3",
        f"map x.tif -o out.html --size 64 --allow-path . --progress none --quiet {RUN}",
        f"serve x.tif --size 64 --port 0 --band 1 --stretch dtype {DIVISION} {RUN}",
        f"serve rgb.tif --size 100 --expr b1-b2 --collar keep --nodata 3 --resume done {RUN}",
        "serve x.tif --size 64 --photos p.jpg --photos p.tif --mission a.plan --threads 1",
        "preview x.tif -o out.png --width 300 --states b.tif --labels b.tif",
        "preview a.plan a.waypoints -o out.png --width 300 --dem g.tif",
        "preview x.tif -o out.png --width 300 --leaves b.tif --levels lv.geojson --path p.geojson",
    )
)
EXCLUDED = {"--help", "--allow-network"}  # the second allows what a campaign must not see


@cache
def added_to(command: str) -> tuple[Words, ...]:
    """Options of a command with the values that they have in any of the lines."""
    options = _options(command)
    given = {words for line in LINES for words in _given(line) if words[0] in options}
    alone = {(name,) for name, option in options.items() if _length(option) == 0}
    return tuple(sorted(given | alone))


def _given(line: list[str]) -> Iterator[Words]:
    """Options of a line, each with its values."""
    options = _options(line[0])
    for at, word in enumerate(line):
        if word in options:
            yield tuple(line[at : at + 1 + _length(options[word])])


@cache
def _options(command: str) -> dict[str, click.Option]:
    """Options of a command by each of their names."""
    found = main.get_command(click.Context(main), command)
    assert found is not None
    return {
        name: option
        for option in found.params
        if isinstance(option, click.Option) and not EXCLUDED & set(option.opts)
        for name in (*option.opts, *option.secondary_opts)
    }


def _length(option: click.Option) -> int:
    return 0 if option.is_flag or option.count else option.nargs
