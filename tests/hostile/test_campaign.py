"""The campaign itself: what it finds, that it is repeatable, and a short one."""

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import pytest
from click import Context, Option

from tests.hostile import campaign
from tests.hostile.case import Case
from tests.hostile.command_lines import EXCLUDED, added_to
from tests.hostile.judging import judge
from tests.hostile.mutate import bytes_mutated, json_mutated, tag_bytes, tags_mutated, with_tag_bytes
from tests.hostile.sandbox import Outcome, Sandbox
from uavseg.cli import main

CASE = Case({"x.tif": b"abc"}, (("info", "x.tif"),))


@pytest.fixture(scope="module")
def sandbox() -> Iterator[Sandbox]:
    campaign.prepare()
    sandbox = Sandbox()
    yield sandbox
    sandbox.close()


def say(text: str, code: int = 1) -> None:
    print(text, file=sys.stderr)
    sys.exit(code)


def read_outside() -> None:
    (Path.cwd().parent / "outside" / "secret.bin").read_bytes()


def call_out() -> None:
    import socket

    port = int((Path.cwd() / "port").read_text())
    socket.create_connection(("127.0.0.1", port)).close()


@pytest.mark.parametrize(
    ("body", "kinds"),
    [
        (lambda: say("uavseg: error: it is damaged"), []),
        (lambda: say("uavseg: warning: it is odd\n  regions  3", 0), []),
        (lambda: [][0], ["TRACEBACK"]),
        (lambda: say("", 1), ["MSG", "STRAY"]),
        (lambda: say("uavseg: error: a\nuavseg: error: b"), ["MSG"]),
        (lambda: say("uavseg: error: \x1b[31m"), ["CTRLMSG"]),
        (lambda: say("uavseg: error: " + "a" * 700), ["LONGMSG"]),
        (lambda: say("uavseg: error: 'int' object is not iterable"), ["RAWMSG"]),
        (lambda: say("x.py:3: RuntimeWarning: overflow", 0), ["PYWARN"]),
        (lambda: say("Cannot find proj.db", 0), ["STRAY"]),
        (lambda: (Path("out.tif").touch(), say("uavseg: error: no"))[0], ["LEFTOVER"]),
        (lambda: Path("x.tif").write_bytes(b""), ["BESIDE"]),
        (lambda: Path("x.tif.aux.xml").touch(), ["BESIDE"]),
        (lambda: print("\x1b[2J"), ["CTRLOUT"]),
        (lambda: sys.exit(7), ["CODE", "MSG"]),
        (read_outside, ["OUTSIDE"]),
        (call_out, ["OUTSIDE"]),
    ],
)
def test_each_kind_of_fault_is_a_finding(
    sandbox: Sandbox, monkeypatch: pytest.MonkeyPatch, body: Callable[[], None], kinds: list[str]
) -> None:
    monkeypatch.setattr("tests.hostile.sandbox._command", lambda _: body())
    port = sandbox.address.rpartition(":")[2].encode()
    case = Case({"x.tif": b"abc", "port": port}, CASE.commands)
    assert sorted({found.kind for found in judge(case, sandbox.run(case))}) == sorted(kinds)


@pytest.mark.slow
def test_what_hangs_or_eats_memory_is_stopped(sandbox: Sandbox, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.hostile.sandbox.PATIENCE_S", 0.5)
    monkeypatch.setattr("tests.hostile.judging.PATIENCE_S", 0.5)
    monkeypatch.setattr("tests.hostile.sandbox._command", lambda _: time.sleep(60))
    assert [found.kind for found in judge(CASE, sandbox.run(CASE))] == ["HANG"]
    monkeypatch.setattr("tests.hostile.sandbox.PATIENCE_S", 20)
    monkeypatch.setattr("tests.hostile.judging.PATIENCE_S", 20)
    monkeypatch.setattr("tests.hostile.sandbox.MEMORY", 1 << 26)
    monkeypatch.setattr("tests.hostile.judging.MEMORY", 1 << 26)
    monkeypatch.setattr("tests.hostile.sandbox._command", lambda _: [b"a" * (1 << 28), time.sleep(60)])
    assert [found.kind for found in judge(CASE, sandbox.run(CASE))] == ["MEM"]


@pytest.mark.parametrize("name", main.list_commands(Context(main)))
def test_each_option_of_each_command_is_given_in_some_case(name: str) -> None:
    command = main.get_command(Context(main), name)
    assert command is not None
    given = {words[0] for words in added_to(name)}
    for option in command.params:
        if isinstance(option, Option) and not EXCLUDED & set(option.opts):
            assert given & set(option.opts), option.opts


@pytest.mark.slow
@pytest.mark.parametrize("kind", campaign.KINDS)
def test_a_case_is_always_the_same(kind: str) -> None:
    assert campaign.make(kind, 3, 5) == campaign.make(kind, 3, 5)


def test_mutators_change_and_never_fail() -> None:
    content = b"II*\0" + bytes(range(256))
    for seed in range(300):
        bytes_mutated(content, Random(seed))
        tags_mutated(content, Random(seed))
        json_mutated('{"a": [1, {"b": null}], "c": "d"}', Random(seed))
    assert bytes_mutated(content, Random(0)) != content


@pytest.mark.slow
def test_the_bytes_of_a_tag_are_replaced() -> None:
    from tests.hostile import seeds
    from tests.hostile.block_maps import METADATA, description, with_description

    block_map = seeds.block_map()["b.tif"]
    assert tag_bytes(with_tag_bytes(block_map, METADATA, b"<a/>\0"), METADATA) == b"<a/>\0"
    assert description(with_description(block_map, '{"rows": "<&\\""}')) == '{"rows": "<&\\""}'


@pytest.mark.thorough
def test_a_short_campaign_finds_nothing() -> None:
    count, found = campaign.run(120, seed=7)
    assert count.total() == 120
    assert not found, campaign.report(count, found, 0)


@pytest.mark.parametrize(
    ("options", "printed", "kinds"),
    [
        (("--rs",), '\x1e{"a": 1}\n\x1e{}\n', []),
        (("--rs",), '{"a": "\x1e"}\n', ["CTRLOUT"]),
        (("--rs",), "\x1b{}\n", ["CTRLOUT"]),
        ((), '\x1e{"a": 1}\n', ["CTRLOUT"]),
    ],
)
def test_record_separators_are_allowed_where_they_are_asked_for(
    options: tuple[str, ...], printed: str, kinds: list[str]
) -> None:
    case = Case({}, (("extract", "x.tif", *options),))
    outcome = Outcome(0, printed.encode(), b"", 0.1, 0.1, 0)
    assert [found.kind for found in judge(case, [outcome])] == kinds
