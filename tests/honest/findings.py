"""What an answer must fulfil, and how it is asked for."""

import re
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from click.testing import CliRunner
from numpy.typing import NDArray

from tests.hostile.judging import Finding
from uavseg.errors import UavsegError

Case = Callable[[Random, Path], Iterator[Finding]]


class RefusedError(Exception):
    """An honest input that is refused."""


def command(*words: Any) -> str:
    """Run a command in this process; what it prints.

    Raises
    ------
    RefusedError
        If it fails.
    """
    from uavseg.cli import main

    done = CliRunner().invoke(main, [*map(str, words)], catch_exceptions=False)
    if done.exit_code:
        raise RefusedError(done.stderr.strip().splitlines()[-1])
    return done.stdout


def no_constant(text: str) -> None:
    """Refuse NaN and Infinity, which are no JSON."""
    raise ValueError(f"{text} is no JSON")


def findings_of(case: Case, rng: Random, folder: Path) -> list[Finding]:
    """All that is wrong with the answers of a case."""
    found: list[Finding] = []
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            for finding in case(rng, folder):
                found.append(finding)
        except (UavsegError, RefusedError) as error:
            found.append(Finding("REFUSED", digest(str(error)), str(error)))
        except Exception as error:
            frame = traceback.extract_tb(error.__traceback__)[-1]
            where = f"{Path(frame.filename).name}:{frame.name}"
            found.append(Finding("RAW", f"{type(error).__name__} {where}", traceback.format_exc()[-900:]))
    raw = [warning for warning in said if issubclass(warning.category, RuntimeWarning)]
    return found + [Finding("PYWARN", digest(str(warning.message)), str(warning)) for warning in raw]


def digest(text: str) -> str:
    """A message without numbers and names, which differ from case to case."""
    text = text.removeprefix("uavseg: error: ")
    text = re.sub(r"'[^']*'|\"[^\"]*\"|\S+\.(tif|vrt|plan|gpkg|geojson)\b", "..", text)
    return re.sub(r"[-+]?\d[\d.,e+-]*|\bnan\b|\binf\b", "#", text)[:140]


def differ(law: str, about: str, found: Any, expected: Any) -> Iterator[Finding]:
    """A finding where two values are not equal."""
    if found != expected:
        yield Finding(law, about, f"{found}, not {expected}")


def far(
    law: str, about: str, found: float, expected: float, relative: float, least: float = 0.0
) -> Iterator[Finding]:
    """A finding where two numbers are not close."""
    if not abs(found - expected) <= max(relative * abs(expected), least):
        yield Finding(law, about, f"{found!r}, not {expected!r}")


def unlike(law: str, about: str, found: NDArray[Any], expected: NDArray[Any]) -> Iterator[Finding]:
    """A finding where two pictures differ in a pixel."""
    if found.shape != expected.shape:
        yield Finding(law, about, f"shape {found.shape}, not {expected.shape}")
        return
    wrong = np.argwhere(found != expected)
    if len(wrong):
        at = tuple(wrong[0].tolist())
        yield Finding(
            law,
            about,
            f"{len(wrong)} of {found.size} pixels differ, the first at {at}: {found[at]}, not {expected[at]}",
        )
