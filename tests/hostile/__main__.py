"""`python -m tests.hostile 7000 --processes 2`: a campaign; `--case vectors:12 FOLDER` makes one of its cases."""

import argparse
import sys
import time
from pathlib import Path

from tests.hostile import campaign
from tests.hostile.judging import judge


def main() -> int:
    """Run a campaign; 1 where it found something."""
    parser = argparse.ArgumentParser(prog="python -m tests.hostile", description=__doc__)
    parser.add_argument("cases", nargs="?", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no batch after so many")
    parser.add_argument("--kinds", nargs="+", choices=campaign.KINDS, default=list(campaign.KINDS))
    parser.add_argument(
        "--case", nargs=2, metavar=("KIND:NUMBER", "FOLDER"), help="make one case, and run it"
    )
    given = parser.parse_args()
    if given.case is not None:
        return one(given.case[0], Path(given.case[1]), given.seed)
    start = time.monotonic()
    classes = {kind: campaign.KINDS[kind] for kind in given.kinds}
    count, found = campaign.run(given.cases, given.seed, given.processes, classes, given.seconds)
    print(campaign.report(count, found, time.monotonic() - start))
    return int(bool(found))


def one(name: str, folder: Path, seed: int) -> int:
    """Make one case in a folder, run it, and say what it did."""
    case = campaign.save(folder, name, seed)
    with campaign.started_with_seeds() as pool:
        outcomes = pool.submit(campaign.outcomes_of, case).result()
    for outcome in outcomes:
        print(outcome.err.decode("utf-8", "backslashreplace"), file=sys.stderr)
    found = judge(case, outcomes)
    print(*found, sep="\n")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
