"""Fixtures that several folders of tests share."""

import importlib.util
import inspect
import os
import signal
from functools import partialmethod
from pathlib import Path
from types import ModuleType

import pytest
from click.testing import CliRunner, Result
from hypothesis import settings

HERE = Path(__file__).resolve().parent

# No test fails because a machine is busy. With CI set, each version of hypothesis draws the same examples
# each time. `--hypothesis-profile thorough` draws four times as many where a test does not say how many.
settings.register_profile(
    "uavseg", settings(), deadline=None, derandomize=bool(os.environ.get("CI")), max_examples=50
)
settings.register_profile("thorough", settings.get_profile("uavseg"), max_examples=200)
settings.load_profile("uavseg")

# In the background of a script interruptions are ignored, and commands would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

if "mix_stderr" in inspect.signature(CliRunner).parameters:  # click < 8.2: as in later versions
    CliRunner.__init__ = partialmethod(CliRunner.__init__, mix_stderr=False)  # type: ignore[assignment]
    Result.output = property(lambda result: result.stdout + result.stderr)  # type: ignore[assignment]


@pytest.fixture(scope="session")
def reference() -> ModuleType:
    """Slow, independent reference implementation of the algorithm: `tests/reference.py`."""
    return _loaded("reference")


@pytest.fixture(scope="session")
def plain_variation() -> ModuleType:
    """Slow reference implementation of total-variation refinement: `tests/plain_variation.py`."""
    return _loaded("plain_variation")


def _loaded(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"uavseg_{name}", HERE / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real rasters next to the checkout; it is not part of the project."""
    folder = HERE.parents[1] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the folder of real rasters, ../shared/data, does not exist")
    return folder
