"""Run the code of a documentation page from top to bottom, and write or check what it prints.

`sh` and `python` blocks run one after the other in a temporary folder that holds a copy of `samples/`. A
`text` block right after one of them is what it prints. `console` blocks need something that is not there (a
cluster, a file of the reader's) and are not run. A picture `pictures/NAME.jpg` of the page is made from the
NAME.png that the commands write.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.DOTALL | re.MULTILINE)
PICTURE = re.compile(r"!\[[^]]*\]\(((?:\.\./)?pictures/(\w+)\.jpg)\)")
BASH = 'uavseg() { "$PYTHON" -m uavseg "$@"; }\n'
LONGEST_SIDE = 1000


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pages", type=Path, nargs="+")
    parser.add_argument("--check", action="store_true", help="write nothing; fail where the page is wrong")
    parser.add_argument(
        "--installed", action="store_true", help="run the program beside this Python, as a reader has it"
    )
    given = parser.parse_args()
    if given.installed:
        os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        os.environ.pop("PYTHONPATH", None)
    for page in given.pages:
        with tempfile.TemporaryDirectory() as folder:
            run_page(page, Path(folder), given.check, given.installed)


def run_page(page: Path, folder: Path, check: bool, installed: bool) -> None:
    """Run the blocks of a page in a folder; write what they print and draw into the page, or check it."""
    shutil.copytree(ROOT / "samples", folder / "samples")
    text = page.read_text(encoding="utf-8")
    written = BLOCK.sub(lambda block: with_output(block, folder, installed), text)
    if check and steady(written) != steady(text):
        sys.exit(f"{page}: the commands print something else; run `python docs/run.py {page}` and look at it")
    for link, name in PICTURE.findall(text):
        drawn = folder / f"{name}.png"
        if not drawn.exists():
            sys.exit(f"{page}: no command writes {drawn.name}, which {link} is made from")
        if not check:
            save_small(drawn, page.parent / link)
    if not check:
        page.write_text(written, encoding="utf-8")
    print(f"{page}: {len(BLOCK.findall(text))} blocks ran")


def with_output(block: re.Match[str], folder: Path, installed: bool) -> str:
    """A block of code, followed by what it prints where the page shows that."""
    language, code, shown = block.groups()
    program = [sys.executable, "-c", code]
    if language == "sh":
        program = ["bash", "-euo", "pipefail", "-c", code if installed else BASH + code]
    variables = {"PYTHON": sys.executable, "PYTHONUNBUFFERED": "1", "COLUMNS": "100"}
    variables |= {} if installed else {"PYTHONPATH": str(ROOT)}
    ran = subprocess.run(
        program,
        cwd=folder,
        env=os.environ | variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
    )
    if ran.returncode:
        sys.exit(f"this fails with exit code {ran.returncode}:\n{code}\n{ran.stdout}")
    head = f"```{language}\n{code}```\n"
    return head if shown is None else f"{head}\n```text\n{without_compilation(ran.stdout)}```\n"


def without_compilation(printed: str) -> str:
    """What was printed, without the note of the first run on a machine."""
    lines = [line.rstrip() for line in printed.splitlines() if not line.startswith("uavseg: compiling")]
    return "".join(f"{line}\n" for line in lines)


def steady(text: str) -> str:
    """A page without what differs from run to run: seconds."""
    text = re.sub(r"^( *seconds +)[\d.]+$", r"\1", text, flags=re.MULTILINE)
    return re.sub(r" in [\d.]+ s$", " in some s", text, flags=re.MULTILINE)


def save_small(picture: Path, path: Path) -> None:
    """Save a picture as a JPEG of moderate size."""
    from PIL import Image

    with Image.open(picture) as image:
        image.thumbnail((LONGEST_SIDE, LONGEST_SIDE))
        image.convert("RGB").save(path, quality=85, optimize=True)


if __name__ == "__main__":
    main()
