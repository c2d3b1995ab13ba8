"""`python -m tests.honest 3000 --processes 2`: a campaign; `--case files:12 FOLDER` runs one of its cases."""

import argparse
import sys
import time
from pathlib import Path

from tests.honest import campaign
from tests.hostile.campaign import report


def main() -> int:
    """Run a campaign; 1 where it found something."""
    known = campaign.KINDS
    parser = argparse.ArgumentParser(prog="python -m tests.honest", description=__doc__)
    parser.add_argument("cases", nargs="?", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no case after so many")
    parser.add_argument("--kinds", nargs="+", choices=known, default=list(campaign.KINDS))
    parser.add_argument(
        "--case", nargs=2, metavar=("KIND:NUMBER", "FOLDER"), help="run one case, and keep its files"
    )
    given = parser.parse_args()
    start = time.monotonic()
    if given.case is not None:
        kind, _, number = given.case[0].partition(":")
        findings = campaign.one(kind, given.seed, int(number), Path(given.case[1]).resolve())
        print(*(f"{finding.kind} {finding.signature}\n{finding.detail}" for finding in findings), sep="\n")
        return int(bool(findings))
    classes = {kind: known[kind] for kind in given.kinds}
    count, found = campaign.run(given.cases, given.seed, given.processes, classes, given.seconds)
    print(report(count, found, time.monotonic() - start))
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
