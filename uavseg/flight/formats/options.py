"""Options of mission files: what some formats need besides the mission."""

from uavseg.dataclass import dataclass
from uavseg.errors import ParameterError
from uavseg.plain_text import shown


@dataclass(frozen=True, slots=True)
class DjiModel:
    """DJI aircraft with its camera, by the numbers of DJI's product support page."""

    name: str
    drone: int  # droneEnumValue of WPML
    drone_sub: int  # droneSubEnumValue
    payload: int  # payloadEnumValue


DJI_MODELS = {
    "m3e": DjiModel("Mavic 3E", 77, 0, 66),
    "m3t": DjiModel("Mavic 3T", 77, 1, 67),
    "m3m": DjiModel("Mavic 3M", 77, 2, 68),
    "m4e": DjiModel("Matrice 4E", 99, 0, 88),
    "m4t": DjiModel("Matrice 4T", 99, 1, 89),
    "m30": DjiModel("Matrice 30", 67, 0, 52),
    "m30t": DjiModel("Matrice 30T", 67, 1, 53),
    "m3d": DjiModel("Matrice 3D", 91, 0, 80),
    "m3td": DjiModel("Matrice 3TD", 91, 1, 81),
    "m300-h20": DjiModel("Matrice 300 RTK with H20", 60, 0, 42),
    "m300-h20t": DjiModel("Matrice 300 RTK with H20T", 60, 0, 43),
    "m350-h20": DjiModel("Matrice 350 RTK with H20", 89, 0, 42),
    "m350-h20t": DjiModel("Matrice 350 RTK with H20T", 89, 0, 43),
    "m350-h30": DjiModel("Matrice 350 RTK with H30", 89, 0, 82),
    "m350-h30t": DjiModel("Matrice 350 RTK with H30T", 89, 0, 83),
}
DEFAULT_DJI_MODEL = "m3e"


@dataclass(frozen=True, slots=True)
class FileOptions:
    """Options of mission files."""

    editable: bool = False  # whether a .plan holds survey items that QGroundControl can edit, where possible
    dji_model: str = DEFAULT_DJI_MODEL  # the aircraft of a .kmz: a key of `DJI_MODELS`, else ParameterError

    def __post_init__(self) -> None:
        if self.dji_model not in DJI_MODELS:
            raise ParameterError(
                f"a DJI aircraft is one of {', '.join(DJI_MODELS)}, not {shown(self.dji_model)}"
            )
