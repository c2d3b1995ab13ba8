"""Runs a command again and again, each time with a fault at the next system call that changes names.

A program of its own, which is forked for each run, so that the libraries are loaded once. It reads a
specification as JSON from standard input, and prints what it saw as JSON lines.
"""

import hashlib
import importlib
import json
import os
import shutil
import signal
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

CALLS = ("rename", "replace", "link", "unlink", "mkdir", "rmdir", "fsync")
FAILING = ("rename", "replace", "link", "mkdir", "fsync")  # what cleans up may fail and leave something


def snapshot(folder: Path) -> dict[str, str]:
    """Every file under a folder, hidden ones too, with a hash of its bytes; folders end in a slash."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()[:16]
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    } | {f"{path.relative_to(folder)}/": "" for path in sorted(folder.rglob("*")) if path.is_dir()}


def inject(fault: str, at: int, fired: Path) -> None:
    """Let the call with this number fail, or meet a signal before it, and make a file then."""
    count = 0

    def patched(name: str, call: Any) -> Any:
        def run(*arguments: Any, **more: Any) -> Any:
            nonlocal count
            count += 1
            if count == at:
                fired.touch()
                if fault == "error":
                    raise OSError(28, "No space left on device")
                os.kill(os.getpid(), getattr(signal, fault))
            return call(*arguments, **more)

        return run

    for name in FAILING if fault == "error" else CALLS:
        setattr(os, name, patched(name, getattr(os, name)))


def run(arguments: list[str], folder: Path, fault: tuple[str, int] | None = None) -> tuple[int, str]:
    """Exit code of the command in a process of its own, negative for a signal, and what it said."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.chdir(folder)
        os.dup2(writing, 2)
        os.dup2(writing, 1)
        from uavseg.cli import main

        if fault is not None and fault[0] == "size":
            import resource

            resource.setrlimit(resource.RLIMIT_FSIZE, (fault[1], fault[1]))
        elif fault is not None and fault[0] != "modules":
            inject(*fault, folder.with_name("fired"))
        code = 70
        try:
            main(arguments, prog_name="uavseg")
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 0
        finally:
            if fault is not None and fault[0] == "modules":
                folder.with_name("modules").write_text("\n".join(sys.modules))
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    os.close(writing)
    with os.fdopen(reading, errors="replace") as pipe:
        said = pipe.read()
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status), said


def fresh(source: Path, work: Path) -> Path:
    shutil.rmtree(work, ignore_errors=True)
    shutil.copytree(source, work)
    return work


def main() -> None:
    spec = json.load(sys.stdin)
    source, work = Path(spec["source"]), Path(spec["work"])
    arguments, numbers = spec["arguments"], spec["numbers"]
    code, said = run(arguments, fresh(source, work), ("modules", 0))
    assert code == 0, said
    for name in work.with_name("modules").read_text().split():
        with suppress(ImportError):  # some modules are no files
            importlib.import_module(name)
    print(json.dumps({"before": snapshot(source), "after": snapshot(work)}), flush=True)
    number = 0
    while numbers is None or number < len(numbers):
        number += 1
        at = number if numbers is None else numbers[number - 1]
        work.with_name("fired").unlink(missing_ok=True)
        code, said = run(arguments, fresh(source, work), (spec["fault"], at))
        seen = {"at": at, "code": code, "said": said, "found": snapshot(work)}
        if spec["fault"] == "SIGKILL":  # after the others, what was there before is there, or what comes
            seen |= {"again": run(arguments, work), "found_again": snapshot(work)}
        print(json.dumps(seen), flush=True)
        if numbers is None and not work.with_name("fired").exists():
            break


if __name__ == "__main__":
    main()
