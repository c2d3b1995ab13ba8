"""Notes for the pilot about photographs: what they show, how far apart they are, and what triggers them."""

from uavseg.flight.params.plan import COVERING, PlanParams

NO_PHOTOS = "no photographs are taken; give a camera (--camera) for that"


def photo_notes(params: PlanParams, how_often: str = "") -> list[str]:
    """Notes about the photographs of a mission.

    Parameters
    ----------
    params : PlanParams
    how_often : str, optional
        Where photographs are taken; by default at a distance along lines.
    """
    photos, height = params.photos, params.altitude_m
    if photos is None:
        return [NO_PHOTOS] if params.pattern in COVERING else []
    across, along = photos.camera.footprint_m(height, photos.pitch_deg)
    lines = f"lines {params.spacing_m:.1f} m apart, " if params.spacing_m is not None else ""
    ground = "over flat ground" if params.terrain is None else "above the ground"
    often = how_often or f"a photograph every {photos.trigger_m(height):.1f} m"
    view = (
        f"footprint {across:.0f} x {along:.0f} m, "
        if params.pattern != "orbit"
        else "the camera looks at the middle of each region, at the height of home, "
    )
    notes = [
        f"{photos.camera.name} at {height:.1f} m {ground}: "
        f"{100 * photos.camera.gsd_m(height, photos.pitch_deg):.2f} cm per pixel, {view}{lines}{often}"
    ]
    return [*notes, *_trigger_notes(params)]


def _trigger_notes(params: PlanParams) -> list[str]:
    photos = params.photos
    assert photos is not None
    if photos.trigger == "none":
        every = photos.trigger_m(params.altitude_m)
        return [
            "the mission does not trigger the camera: start it by other means, with a photograph at least "
            f"every {every:.1f} m ({every / params.speed_m_s:.1f} s at {params.speed_m_s:g} m/s)"
        ]
    if photos.trigger == "distance":
        return []
    return [
        "photographs are taken with IMAGE_START_CAPTURE (2000): try on the ground that the camera of this "
        "vehicle does so"
    ]
