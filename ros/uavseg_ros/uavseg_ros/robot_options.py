"""Options that the programs over maps and regions share: the robot, its map and the regions."""

from __future__ import annotations

from collections.abc import Sequence

from uavseg.errors import PathError
from uavseg.options import reading, running, texts
from uavseg.options.option import Options, argument, group, option
from uavseg_ros.free_space import FreeSpace, MapRegion, read_free_space, read_map_regions, why_unreachable

_BASIC = {"basic": True}


class RobotOptions(Options):
    """Robot and map."""

    regions: str = argument("REGIONS", required=True)
    map: str = option("The map on which the robot drives.", required=True, metavar="MAP", basic=True)
    radius: float = option(
        "From the robot's centre to everything that is not free.", required=True, metavar="M", basic=True
    )
    passable_below: float = option(
        "Free are cells up to this probability.", default=0.45, metavar="V", basic=True
    )
    layer: str | None = option("The layer of REGIONS, if the file has several.", metavar="NAME", basic=True)
    ids: Sequence[int] | None = option("Which regions.", metavar="N,N,...", parse=texts.ids, basic=True)
    allow_unreachable: bool = option(
        "Leave out regions that the robot cannot reach, instead of refusing.", default=False, basic=True
    )

    def read(self) -> tuple[FreeSpace, list[MapRegion], list[str]]:
        """Read the map and the regions, with notes on these."""
        space = read_free_space(self.map, self.radius, self.passable_below)
        return (space, *read_map_regions(self.regions, space, self.layer, self.ids))

    def split_reachable(
        self, space: FreeSpace, regions: Sequence[MapRegion], part: int
    ) -> tuple[list[MapRegion], list[str]]:
        """Return the regions that have cells of a part, and of each other why it cannot be reached.

        Raises
        ------
        PathError
            If there are others, and that is not allowed, or if there are only others.
        """
        reached = [one for one in regions if part and (one.values(space.parts) == part).any()]
        refused = [why_unreachable(space, one, part) for one in regions if one not in reached]
        if refused and not (self.allow_unreachable and reached):
            more = f"; {len(refused) - 1} more cannot be reached either" if len(refused) > 1 else ""
            hint = "; leave it out (--ids, --allow-unreachable)" if reached else ""
            raise PathError(f"{refused[0]}{more}{hint}")
        return reached, refused


class ProgramOptions(Options):
    """What both programs have in common, listed after their own options."""

    files: running.OverwriteOptions = group(running.OverwriteOptions)
    messages: running.VerbosityOptions = group(running.VerbosityOptions, "verbose", quiet=_BASIC)
    access: reading.AccessOptions = group(reading.AccessOptions, allow_path=_BASIC, allow_network=_BASIC)
