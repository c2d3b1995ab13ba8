"""`uavseg` as a program of its own, which is also `python -m uavseg`."""


def run() -> None:
    """Run the command line."""
    from uavseg import _lazy_pandas

    _lazy_pandas.install()
    from uavseg.cli import main

    main(prog_name="uavseg")


if __name__ == "__main__":
    run()
