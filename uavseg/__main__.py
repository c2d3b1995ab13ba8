"""`uavseg` as a program of its own, which is also `python -m uavseg`."""

import atexit
import gc
import sys


def run() -> None:
    """Run the command line."""
    gc.set_threshold(500_000)  # imports and polygons are many objects and few cycles
    atexit.register(gc.freeze)  # else the end searches all objects for cycles, for 70 ms of a short command
    try:
        from uavseg.cli import main

        main(prog_name="uavseg")
    except KeyboardInterrupt:  # before the command began; afterwards it says itself what it wrote
        print("uavseg: interrupted; nothing was written", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    run()
