"""Speed that a camera allows: it keeps up with the photographs, and they are not blurred."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from uavseg.flight.params import PlanParams
from uavseg.flight.track import Track


def lower_speed(params: PlanParams, tracks: Sequence[Track]) -> tuple[PlanParams, list[str]]:
    """The speed lowered to what the camera allows where photographs are closest, and notes of it."""
    photos = params.photos
    if photos is None or params.pattern == "visit":
        return params, []
    triggers = np.concatenate([track.trigger_m for track in tracks])
    closest = float(triggers[triggers > 0].min()) if triggers.any() else photos.trigger_m(params.altitude_m)
    limit = photos.max_speed_m_s(params.altitude_m, closest)
    if params.speed_m_s <= limit:
        return params, []
    camera = photos.camera
    interval = f"{camera.name} needs {camera.min_interval_s:g} s between photographs, and " * bool(
        camera.min_interval_s
    )
    note = (
        f"speed lowered from {params.speed_m_s:g} to {limit:.2f} m/s: {interval}"
        f"more speed would blur them at 1/{1 / photos.shutter_s:.0f} s"
    )
    return replace(params, speed_m_s=limit), [note]
