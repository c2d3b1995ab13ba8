"""``python -m benchmarks``: measure, print one table, and keep it in README.md."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks import table
from benchmarks.answers import answer
from benchmarks.competitors import COMPETITORS, Competitor, chosen
from benchmarks.kernels import speeds
from benchmarks.measure import outcomes
from benchmarks.robot import steps
from benchmarks.scenes import KINDS, Scene, ready
from benchmarks.startup import starts


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what the options ask for."""
    options = _parser().parse_args(arguments)
    sections = options.sections or ["processes", "startup", "kernels", "robot"]
    if options.only is not None:
        sections = ["processes"]
    for section in sections:
        text = _SECTIONS[section](options)
        print(f"\n## {section}\n\n{text}", flush=True)
        if options.keep and options.only is None:
            table.keep(section, text, options.readme)


def _processes(options: argparse.Namespace) -> str:
    starts(runs=1)  # what is compiled once for a machine is compiled now
    found = []
    for kind in options.kinds:
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


def _robot(options: argparse.Namespace) -> str:
    return table.robot(steps())


_SECTIONS = {"processes": _processes, "startup": _startup, "kernels": _kernels, "robot": _robot}


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "--sizes", type=_numbers, default=[2048, 8192, 16384], help="sides of the scenes, with commas"
    )
    parser.add_argument("--kinds", type=_kinds, default=["grey8"], help=f"with commas: {', '.join(KINDS)}")
    parser.add_argument(
        "--rounds", type=int, default=3, help="how often everybody runs; the numbers are medians"
    )
    parser.add_argument(
        "--only", type=_competitors, help="names with commas; such a table is printed, not kept"
    )
    for section in _SECTIONS:
        parser.add_argument(
            f"--{section}", dest="sections", action="append_const", const=section, help="this section only"
        )
    parser.add_argument("--no-keep", dest="keep", action="store_false", help="leave README.md as it is")
    parser.add_argument("--readme", type=Path, default=table.README, help=argparse.SUPPRESS)
    return parser


def _numbers(text: str) -> list[int]:
    return [int(number) for number in text.split(",")]


def _kinds(text: str) -> list[str]:
    return [Scene(1, kind).kind for kind in text.split(",")]


def _competitors(text: str) -> list[Competitor]:
    try:
        return chosen(text.split(","))
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


if __name__ == "__main__":
    main()
