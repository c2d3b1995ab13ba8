"""`uavseg` as a program of its own, which is also `python -m uavseg`."""

import sys


def run() -> None:
    """Run the command line."""
    try:
        from uavseg.cli import main

        main(prog_name="uavseg")
    except KeyboardInterrupt:  # before the command began; afterwards it says itself what it wrote
        print("uavseg: interrupted; nothing was written", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    run()
