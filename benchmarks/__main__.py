"""Run the benchmarks, print tables, and write them to benchmarks/README.md and docs/quality.md."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks import table
from benchmarks.accuracy import accuracy
from benchmarks.competitors import COMPETITORS, Competitor, select_competitors
from benchmarks.decode import decoding_s
from benchmarks.kernels import speeds
from benchmarks.match import measure_matches, table_by_family
from benchmarks.measure import run_competitors
from benchmarks.obstacles import obstacles
from benchmarks.paths import searches
from benchmarks.phases import phases
from benchmarks.polygon_stats import polygon_stats
from benchmarks.robot import steps
from benchmarks.scale import commands, pixel_types, reuse, scaling, thread_scaling
from benchmarks.scenes import KINDS, PROJECT, Scene, ensure_raster
from benchmarks.smallmap import tasks
from benchmarks.startup import starts
from benchmarks.vectors import vectorised


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line: run the selected sections."""
    options = _parser().parse_args(arguments)
    sections = options.sections or list(_SECTIONS)
    if options.only is not None:
        sections = ["processes"]
    for section in sections:
        text = _SECTIONS[section](options)
        print(f"\n## {section}\n\n{text}", flush=True)
        if options.write and options.only is None and options.families is None:
            table.write_section(section, text, _DOCUMENTS.get(section, options.readme))


def _processes(options: argparse.Namespace) -> str:
    starts(runs=1)  # compiles the kernels
    results = []
    for kind in options.pixels:
        for side in options.sizes:
            scene = Scene(side, kind)
            results += run_competitors(
                scene,
                ensure_raster(scene),
                options.only or list(COMPETITORS),
                options.rounds,
                polygon_stats,
                _report,
            )
    return table.processes(results, options.rounds)


def _startup(options: argparse.Namespace) -> str:
    return table.starting(*starts())


def _kernels(options: argparse.Namespace) -> str:
    return table.kernels(speeds())


def _phases(options: argparse.Namespace) -> str:
    scene = Scene(max(options.sizes))
    raster = ensure_raster(scene)
    return table.phases(scene, phases(raster), decoding_s(raster, 1))


def _scaling(options: argparse.Namespace) -> str:
    sides = [side for side in _SIDES if side <= options.largest]
    return table.scaling(scaling(sides, options.rounds, _report), options.rounds)


def _pixel_types(options: argparse.Namespace) -> str:
    return table.pixel_types(
        pixel_types(max(options.sizes), list(KINDS), options.rounds, _report), options.rounds
    )


def _reuse(options: argparse.Namespace) -> str:
    side = max(options.sizes)
    return table.reuse(side, reuse(side, options.rounds, _report), options.rounds)


def _commands(options: argparse.Namespace) -> str:
    sides = [side for side in _COMMAND_SIDES if side <= max(options.sizes)]
    found = {
        kind: commands({side: ensure_raster(Scene(side, kind)) for side in sides}, options.rounds, _report)
        for kind in ("grey8", "rgb8")
    }
    return table.commands(found, options.rounds)


def _threads(options: argparse.Namespace) -> str:
    side = min(8192, max(options.sizes))
    return table.threads(side, thread_scaling(side, options.rounds), options.rounds)


def _vectors(options: argparse.Namespace) -> str:
    return table.vectors(vectorised(min(8192, max(options.sizes)), options.rounds), options.rounds)


def _paths(options: argparse.Namespace) -> str:
    return table.paths(searches())


def _accuracy(options: argparse.Namespace) -> str:
    return table.accuracy(*accuracy())


def _obstacles(options: argparse.Namespace) -> str:
    return table.obstacles(obstacles())


def _quality(options: argparse.Namespace) -> str:
    from benchmarks.quality.section import quality  # imports scipy and scikit-image

    return quality(options.seeds, options.refine, options.families, _report)


def _smallmap(options: argparse.Namespace) -> str:
    return table.small_maps(tasks())


def _robot(options: argparse.Namespace) -> str:
    return table.robot(steps())


def _match(options: argparse.Namespace) -> str:
    return table_by_family(measure_matches())


def _flights(options: argparse.Namespace) -> str:
    from benchmarks.flight.section import fields, flights_table, flown

    return flights_table(list(flown(fields(), _report)))


def _orders(options: argparse.Namespace) -> str:
    from benchmarks.flight.fields import many
    from benchmarks.flight.order import tours
    from benchmarks.flight.orders_section import orders_table
    from benchmarks.flight.plans import plans

    return orders_table(list(tours(field=many(200, 40))), plans())


def _angles(options: argparse.Namespace) -> str:
    from benchmarks.flight.angles import angle_rows, angles_table, shapes

    return angles_table(list(angle_rows(shapes(), _report)))


def _patterns(options: argparse.Namespace) -> str:
    from benchmarks.flight.cases import cases, fly_cases, survey_lengths
    from benchmarks.flight.patterns_section import patterns_table

    return patterns_table(list(fly_cases(cases(), _report)), survey_lengths())


_COMMAND_SIDES = (512, 2048, 8192, 16384)
_SIDES = (2048, 8192, 16384, 32768, 65536)
_SECTIONS = {
    "processes": _processes,
    "phases": _phases,
    "scaling": _scaling,
    "pixel-types": _pixel_types,
    "reuse": _reuse,
    "commands": _commands,
    "threads": _threads,
    "vectors": _vectors,
    "startup": _startup,
    "kernels": _kernels,
    "paths": _paths,
    "smallmap": _smallmap,
    "accuracy": _accuracy,
    "obstacles": _obstacles,
    "robot": _robot,
    "quality": _quality,
    "match": _match,
    "flights": _flights,
    "patterns": _patterns,
    "orders": _orders,
    "angles": _angles,
}
_DOCUMENTS = {"quality": PROJECT / "docs" / "quality.md"}


def _report(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "--sizes",
        type=_split_numbers,
        default=[2048, 8192, 16384],
        help="sides of the scenes, comma-separated",
    )
    parser.add_argument(
        "--pixels",
        type=_split_pixel_types,
        default=["grey8"],
        help=f"pixel types for whole processes, comma-separated: {', '.join(KINDS)}",
    )
    parser.add_argument(
        "--largest", type=int, default=65536, help="side of the largest raster of the section scaling"
    )
    parser.add_argument(
        "--rounds", type=int, default=5, help="number of runs of each competitor; results are medians"
    )
    parser.add_argument(
        "--only",
        type=_split_competitors,
        help="run only these competitors, comma-separated; the table is printed, not written",
    )
    parser.add_argument("--seeds", type=int, default=3, help="number of scenes per family, section quality")
    parser.add_argument(
        "--families",
        type=_split_families,
        help="prefixes of families of the section quality, comma-separated; the table is only printed",
    )
    parser.add_argument(
        "--refine",
        type=_split_refinements,
        default=[],
        help="additional refinements of uavseg for the section quality, comma-separated",
    )
    for section in _SECTIONS:
        parser.add_argument(
            f"--{section}", dest="sections", action="append_const", const=section, help="this section only"
        )
    parser.add_argument(
        "--no-write", dest="write", action="store_false", help="print only, do not change the documents"
    )
    parser.add_argument("--readme", type=Path, default=table.README, help=argparse.SUPPRESS)
    return parser


def _split_families(text: str) -> list[str]:
    from benchmarks.quality.section import select_families

    try:
        return select_families(_split_names(text))
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _split_refinements(text: str) -> list[str]:
    from benchmarks.quality.ours import settings

    try:
        settings(_split_names(text))
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return _split_names(text)


def _split_names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",")]


def _split_numbers(text: str) -> list[int]:
    return [int(number) for number in text.split(",")]


def _split_pixel_types(text: str) -> list[str]:
    return [Scene(1, kind).kind for kind in text.split(",")]


def _split_competitors(text: str) -> list[Competitor]:
    try:
        return select_competitors(text.split(","))
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


if __name__ == "__main__":
    main()
