"""Each case that an earlier campaign ended with is answered by a result or by one clear line."""

from collections.abc import Iterator

import pytest

from tests.hostile import campaign
from tests.hostile.judging import judge
from tests.hostile.known_cases import FOLDER, known_cases
from tests.hostile.sandbox import Sandbox

CASES = known_cases() if FOLDER.is_dir() else {}


@pytest.fixture(scope="module")
def sandbox() -> Iterator[Sandbox]:
    campaign.prepare()
    sandbox = Sandbox()
    yield sandbox
    sandbox.close()


@pytest.mark.skipif(not CASES, reason="the folder of known cases, ../shared/hostile, does not exist")
@pytest.mark.parametrize("name", CASES)
def test_a_known_case_ends_cleanly(name: str, sandbox: Sandbox) -> None:
    case = CASES[name]
    assert judge(case, sandbox.run(case)) == []
