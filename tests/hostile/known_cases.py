"""Cases that earlier campaigns ended with, beside the checkout: their files and their commands."""

import re
from pathlib import Path

from tests.hostile.case import Case

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "hostile"
KINDS = ("TRACEBACK", "MSG", "PYWARN", "RAWMSG", "CTRLMSG", "LONGMSG", "DIFF-LIST", "LEFTOVER")
OUTPUTS = ("-o", "--objects", "--labels", "--png", "--truth")
MISSING = {  # values of options at which the list of commands was cut off
    "-o": "o.geojson",
    "--tile": "128",
    "--width": "300",
    "--altitude": "50",
    "--home": "auto",
    "--pattern": "perimeter",
    "--threads": "1",
    "--simplify": "1",
    "--levels": "lv.geojson",
    "--stretch": "dtype",
}


def known_cases() -> dict[str, Case]:
    """Cases of the kinds that concern messages, by name."""
    table = (FOLDER / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([\w-]+) \| `uavseg (.*?)` \|", table, re.MULTILINE)
    return {name: _case(name, text) for name, text in rows if re.search(rf"-({'|'.join(KINDS)})-", name)}


def _case(name: str, text: str) -> Case:
    command = _words(text)
    written = [command[n + 1] for n, word in enumerate(command) if word in OUTPUTS]
    files = {
        path.name: path.read_bytes()
        for path in (FOLDER / name).iterdir()
        if path.name not in written and path.name not in ("a.geojson", "b.geojson")
    }
    for output in written:
        files.pop(Path(output).with_suffix(".pgm").name if output.endswith(".yaml") else output, None)
    stdin = files.get("r.geojson", b"") if "-" in command else b""
    if "DIFF-LIST" in name:
        at = command.index("--tile") if "--tile" in command else len(command)
        plain, rest = (*command[:at],), (*command[at + 2 :],)
        if "-skip-" in name:
            plain = (*plain, "--skip-bad-tiles")
        tiles = ("64", "128") if command[0] != "info" else ()
        commands = tuple((*plain, *rest, "--tile", tile) for tile in tiles) or (command,)
        return Case(files, _apart(commands), same=len(commands) > 1, targets=("n0", "n1"))
    return Case(files, (command,), (*written, "m", "o"), stdin=stdin)


def _apart(commands: tuple[tuple[str, ...], ...]) -> tuple[tuple[str, ...], ...]:
    """The commands with outputs of their own."""

    def named(command: tuple[str, ...], n: int) -> tuple[str, ...]:
        outputs = {command[at + 1] for at, word in enumerate(command) if word in OUTPUTS}
        return tuple(f"n{n}{word}" if word in outputs else word for word in command)

    return tuple(named(command, n) for n, command in enumerate(commands))


def _words(text: str) -> tuple[str, ...]:
    """The words of a command, of which the end may be cut off."""
    command, arrow, _ = text.partition(" -> ")
    words = [word.encode().decode("unicode_escape") for word in re.findall(r"'([^']*)'", command)]
    if not arrow:
        cut = re.sub(r"'[^']*'", "", command).strip().lstrip("'")
        if cut.startswith("aaa"):
            words.append("a" * 5000)
        elif words[-1] in MISSING:
            words.append(MISSING[words[-1]])
    if words[0] in ("extract", "levels", "match", "divide") and "-o" not in words:
        words += ["-o", "o.geojson" if words[0] != "divide" else "o.tif"]
    return tuple(words)
