"""`uavseg plan`: a file of regions becomes a mission file."""

from __future__ import annotations

from typing import Any

import click

from uavseg.cli._mission import mission_options, mission_params, planned, report
from uavseg.errors import RegionError


@click.command("plan")
@click.argument("regions", metavar="REGIONS")
@click.option("-o", "--output", required=True, metavar="PATH", help="The mission: .plan or .waypoints.")
@mission_options
@click.option("--ids", metavar="N,N,...", help="Only the regions with these ids.")
@click.option("--largest", type=click.IntRange(min=1), metavar="N", help="Only the N largest.")
@click.option(
    "--where",
    metavar="CONDITION",
    help='Only regions that fulfil it, as in "mean > 0.7 and area_m2 > 500". A comparison with a missing '
    "number is neither true nor false, so != and not do not select it either.",
)
@click.option("--layer", metavar="NAME", help="The layer of a file that has several.")
@click.option("--overwrite", is_flag=True, help="Replace a mission that is there.")
@click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
def command(
    regions: str,
    output: str,
    ids: str | None,
    largest: int | None,
    where: str | None,
    layer: str | None,
    overwrite: bool,
    quiet: bool,
    **flight: Any,
) -> None:
    """Plan a flight over REGIONS, a file of polygons (- is GeoJSON from standard input).

    Take off at home, fly to or over the chosen regions in a short order, return. The file is for
    QGroundControl (.plan) or for Mission Planner (.waypoints).
    """
    from uavseg.atomic import check_target
    from uavseg.flight import files
    from uavseg.regions.formats.read import read_regions
    from uavseg.regions.select.choose import select_regions

    files.check_format(output)
    check_target(output, overwrite)
    params = mission_params(**flight)
    source = click.open_file("-", "rb").read() if regions == "-" else regions
    chosen = select_regions(read_regions(source, layer), parse_ids(ids), largest, where)
    mission = planned(chosen, list(chosen.polygons), params, flight["home"])
    files.write(mission, output, overwrite)
    if not quiet:
        report(mission, len(chosen), output)


def parse_ids(text: str | None) -> list[int] | None:
    """Whole numbers between commas."""
    if text is None:
        return None
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise RegionError(f"--ids is whole numbers between commas, as in 1,4,7, not {text!r}") from None
