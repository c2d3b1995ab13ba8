"""``python -m benchmarks``: measure, print tables, and keep them in README.md and docs/quality.md."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks import table
from benchmarks.accuracy import accuracy
from benchmarks.answers import answer
from benchmarks.competitors import COMPETITORS, Competitor, chosen
from benchmarks.decode import decoding_s
from benchmarks.kernels import speeds
from benchmarks.match import matches, table_of
from benchmarks.measure import outcomes
from benchmarks.paths import searches
from benchmarks.phases import phases
from benchmarks.robot import steps
from benchmarks.scale import again, growing, kinds, threading
from benchmarks.scenes import KINDS, PROJECT, Scene, ready
from benchmarks.smallmap import tasks
from benchmarks.startup import starts
from benchmarks.vectors import vectorised


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what the options ask for."""
    options = _parser().parse_args(arguments)
    sections = options.sections or list(_SECTIONS)
    if options.only is not None:
        sections = ["processes"]
    for section in sections:
        text = _SECTIONS[section](options)
        print(f"\n## {section}\n\n{text}", flush=True)
        if options.keep and options.only is None and options.families is None:
            table.keep(section, text, _KEPT_IN.get(section, options.readme))


def _processes(options: argparse.Namespace) -> str:
    starts(runs=1)  # what is compiled once for a machine is compiled now
    found = []
    for kind in options.pixels:
        for side in options.sizes:
            scene = Scene(side, kind)
            found += outcomes(
                scene, ready(scene), options.only or list(COMPETITORS), options.rounds, answer, _tell
            )
    return table.processes(found, options.rounds)


def _startup(options: argparse.Namespace) -> str:
    return table.starting(starts())


def _kernels(options: argparse.Namespace) -> str:
    return table.kernels(speeds())


def _phases(options: argparse.Namespace) -> str:
    scene = Scene(max(options.sizes))
    raster = ready(scene)
    return table.phases(scene, phases(raster), decoding_s(raster, 1))


def _growing(options: argparse.Namespace) -> str:
    sides = [side for side in _GROWING if side <= options.largest]
    return table.growing(growing(sides, options.rounds, _tell), options.rounds)


def _kinds(options: argparse.Namespace) -> str:
    return table.kinds(kinds(max(options.sizes), list(KINDS), options.rounds, _tell), options.rounds)


def _again(options: argparse.Namespace) -> str:
    side = max(options.sizes)
    return table.again(side, again(side, options.rounds, _tell), options.rounds)


def _threads(options: argparse.Namespace) -> str:
    side = min(8192, max(options.sizes))
    return table.threads(side, threading(side, options.rounds), options.rounds)


def _vectors(options: argparse.Namespace) -> str:
    return table.vectors(vectorised(min(8192, max(options.sizes)), options.rounds), options.rounds)


def _paths(options: argparse.Namespace) -> str:
    return table.paths(searches())


def _accuracy(options: argparse.Namespace) -> str:
    return table.accuracy(*accuracy())


def _quality(options: argparse.Namespace) -> str:
    from benchmarks.quality.section import quality  # scipy and scikit-image, which others do not need

    return quality(options.seeds, options.refine, options.families, _tell)


def _smallmap(options: argparse.Namespace) -> str:
    return table.small_maps(tasks())


def _robot(options: argparse.Namespace) -> str:
    return table.robot(steps())


def _match(options: argparse.Namespace) -> str:
    return table_of(matches())


_GROWING = (2048, 8192, 16384, 32768, 65536)
_SECTIONS = {
    "processes": _processes,
    "phases": _phases,
    "growing": _growing,
    "kinds": _kinds,
    "again": _again,
    "threads": _threads,
    "vectors": _vectors,
    "startup": _startup,
    "kernels": _kernels,
    "paths": _paths,
    "smallmap": _smallmap,
    "accuracy": _accuracy,
    "robot": _robot,
    "quality": _quality,
    "match": _match,
}
_KEPT_IN = {"quality": PROJECT / "docs" / "quality.md"}


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "--sizes", type=_numbers, default=[2048, 8192, 16384], help="sides of the scenes, with commas"
    )
    parser.add_argument(
        "--pixels",
        type=_known_kinds,
        default=["grey8"],
        help=f"kinds of pixels of whole processes, with commas: {', '.join(KINDS)}",
    )
    parser.add_argument(
        "--largest", type=int, default=65536, help="side of the largest raster of the section growing"
    )
    parser.add_argument(
        "--rounds", type=int, default=5, help="how often everybody runs; the numbers are medians"
    )
    parser.add_argument(
        "--only", type=_competitors, help="names with commas; such a table is printed, not kept"
    )
    parser.add_argument("--seeds", type=int, default=3, help="scenes of each family of the section quality")
    parser.add_argument(
        "--families",
        type=_families,
        help="how families of the section quality begin, with commas; such a table is printed, not kept",
    )
    parser.add_argument(
        "--refine",
        type=_refinements,
        default=[],
        help="further refinements of uavseg that the section quality measures, with commas",
    )
    for section in _SECTIONS:
        parser.add_argument(
            f"--{section}", dest="sections", action="append_const", const=section, help="this section only"
        )
    parser.add_argument(
        "--no-keep", dest="keep", action="store_false", help="leave the documents as they are"
    )
    parser.add_argument("--readme", type=Path, default=table.README, help=argparse.SUPPRESS)
    return parser


def _families(text: str) -> list[str]:
    from benchmarks.quality.section import meant

    try:
        return meant(_names(text))
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _refinements(text: str) -> list[str]:
    from benchmarks.quality.ours import settings

    try:
        settings(_names(text))
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return _names(text)


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",")]


def _numbers(text: str) -> list[int]:
    return [int(number) for number in text.split(",")]


def _known_kinds(text: str) -> list[str]:
    return [Scene(1, kind).kind for kind in text.split(",")]


def _competitors(text: str) -> list[Competitor]:
    try:
        return chosen(text.split(","))
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


if __name__ == "__main__":
    main()
