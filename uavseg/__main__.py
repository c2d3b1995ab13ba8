"""`python -m uavseg` is `uavseg`."""

from uavseg.cli import main

main(prog_name="uavseg")
