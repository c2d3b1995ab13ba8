"""Options of mission files: what some formats need besides the mission."""

import csv
from importlib import resources

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.plain_text import shown

TURN_STOP, TURN_THROUGH = "stop", "through"
TURNS = (TURN_STOP, TURN_THROUGH)


@dataclass(frozen=True, slots=True)
class DjiModel:
    """DJI aircraft with its camera, by the numbers of DJI's product support page, or of files of DJI Fly."""

    name: str
    drone: int  # droneEnumValue of WPML
    drone_sub: int  # droneSubEnumValue
    payload: int | None  # payloadEnumValue; None for the aircraft of DJI Fly, whose files have none
    exchangeable: bool  # whether other cameras can be mounted
    lenses: tuple[str, ...]  # values of `--lens`
    default_lenses: tuple[str, ...]  # those that photograph for maps
    cameras: tuple[str, ...]  # its cameras in the catalogue; none if they are not there
    note: str  # what is not known for certain

    @property
    def is_for_fly(self) -> bool:
        """Whether DJI Fly flies it, and not DJI Pilot 2."""
        return self.payload is None


def _model(row: dict[str, str]) -> DjiModel:
    lenses, default_lenses, cameras = (
        tuple(filter(None, row[key].split("|"))) for key in ("lenses", "default_lenses", "cameras")
    )
    return DjiModel(
        name=row["name"],
        drone=int(row["drone"]),
        drone_sub=int(row["drone_sub"]),
        payload=int(row["payload"]) if row["payload"] else None,
        exchangeable=row["mount"] == "exchangeable",
        lenses=lenses,
        default_lenses=default_lenses,
        cameras=cameras,
        note=row["note"],
    )


_TABLE = resources.files("uavseg.flight.formats").joinpath("dji_models.csv").read_text(encoding="utf-8")
DJI_MODELS = {row["key"]: _model(row) for row in csv.DictReader(_TABLE.splitlines())}
DEFAULT_DJI_MODEL = "m3e"


@dataclass(frozen=True, slots=True)
class FileOptions:
    """Options of mission files; ParameterError if aircraft or turn are not known, or it has no such lens."""

    editable: bool = False  # whether a .plan holds survey items that QGroundControl can edit, where possible
    dji_model: str = DEFAULT_DJI_MODEL  # the aircraft of a .kmz: a key of `DJI_MODELS`
    lens: str | None = None  # which lenses photograph, between commas; None: all that serve for maps
    turn: str = TURN_STOP  # "stop" at waypoints, or fly "through" them

    def __post_init__(self) -> None:
        if self.dji_model not in DJI_MODELS:
            raise ParameterError(
                f"a DJI aircraft is one of {', '.join(DJI_MODELS)}, not {shown(self.dji_model)}"
            )
        if self.turn not in TURNS:
            raise ParameterError(f"a turn (--turn) is one of {', '.join(TURNS)}, not {shown(self.turn)}")
        if self.lens is None:
            return
        if self.model.is_for_fly:
            raise ParameterError(
                f"DJI Fly photographs with the lens that is chosen in the app; leave --lens out for a "
                f"{self.model.name}"
            )
        for lens in self.lenses:
            if lens not in self.model.lenses:
                raise ParameterError(
                    f"a {self.model.name} (--dji-model) has the lenses {', '.join(self.model.lenses)}, not "
                    f"{shown(lens)} (--lens)"
                )

    @property
    def model(self) -> DjiModel:
        """The aircraft of a .kmz."""
        return DJI_MODELS[self.dji_model]

    @property
    def lenses(self) -> tuple[str, ...]:
        """The lenses that photograph, each once; none for the aircraft of DJI Fly."""
        if self.lens is None:
            return self.model.default_lenses
        return tuple(dict.fromkeys(lens.strip() for lens in self.lens.split(",")))
