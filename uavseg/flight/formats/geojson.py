"""GeoJSON of missions for display in GIS software, in positions without height.

Heights of GeoJSON count from the ellipsoid (RFC 7946), which heights of missions do not: they are attributes,
above home, the sea or the terrain, as `height_above` says.
"""

import json
from collections.abc import Mapping
from typing import Any

from uavseg.errors import MissionError
from uavseg.flight.formats.options import FileOptions
from uavseg.flight.mission.features import MissionFeature, Place, as_geojson, features_of, mission_of_features
from uavseg.flight.mission.mission import Mission
from uavseg.inputs import parse_json
from uavseg.plain_text import shown


def write_geojson(mission: Mission, options: FileOptions) -> bytes:
    """Write a mission as the content of a .geojson file, a feature on each line."""
    lines = ",\n".join(json.dumps(as_geojson(one), allow_nan=False) for one in features_of(mission))
    return f'{{"type": "FeatureCollection", "features": [\n{lines}\n]}}\n'.encode()


def read_geojson(content: bytes, name: str) -> Mission:
    """Read a .geojson file that `write_geojson` wrote."""
    document = parse_json(content.decode())
    if not isinstance(document, dict) or document.get("type") != "FeatureCollection":
        raise MissionError('it is not GeoJSON: "type" is not "FeatureCollection"')
    return mission_of_features(map(_read_feature, document["features"]), name)


def _read_feature(feature: Mapping[str, Any]) -> MissionFeature:
    properties = feature.get("properties") or {}
    geometry = feature.get("geometry")
    if geometry is None:
        return MissionFeature(str(properties.get("kind")), "", (), values=properties)
    shape, coordinates = geometry["type"], geometry["coordinates"]
    if shape == "Point":
        coordinates = [coordinates]
    elif shape == "Polygon":
        coordinates = coordinates[0][::-1]
    elif shape != "LineString":
        raise MissionError(f"it holds a {shown(shape, quoted=False)}, which no mission has")
    places: tuple[Place, ...] = tuple((float(lat), float(lon), 0.0) for lon, lat, *_ in coordinates)
    return MissionFeature(str(properties.get("kind")), shape, places, values=properties)
