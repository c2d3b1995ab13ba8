"""`uavseg check`, `upload`, `download`, `footprints`, `georeference`: missions, and what came back."""

import json
from typing import TYPE_CHECKING, Any

from uavseg.cli import write
from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter, say, show, showing_phases
from uavseg.errors import MissionError
from uavseg.options import missions

if TYPE_CHECKING:
    from uavseg.flight.mission.mission import Mission


@job_command("check", missions.CheckOptions)
def command(options: missions.CheckOptions, reporter: Reporter) -> None:
    """Read the mission in FILE (.plan, .waypoints, .kml, .geojson, .kmz or .csv) back, and tell what it
    holds, how long it takes, and which autopilots, programs and aircraft would refuse it.

    With --photos, tell what the photographs of the flight show, which are missing or blurred, and how they
    overlap; --gaps writes what they do not show, for the next flight.

    Exit code 1: FILE cannot be read, its mission would not be safe, leaves its fence, comes near to a zone of
    --avoid, exceeds a limit, the autopilot refuses it, or the photographs show less than 99.9 %.
    """
    from uavseg.jobs.flights.check import check, check_request

    quiet, gaps = reporter.quiet, options.gaps
    if gaps is not None:
        write.keep_inputs(
            [gaps], options.file, options.photos, options.regions, options.terrain.dem, options.poses.camera
        )
    with showing_phases(quiet):
        found = check(options.file, check_request(options))
    if gaps is not None:
        found.write_gaps(gaps, options.files.overwrite)
    if options.as_json:
        show(json.dumps(found.as_dict(), indent=2, allow_nan=False))
    elif not quiet:
        rows = _rows(found.as_dict())
        for one in found.verdicts:
            rows[one.who] = "accepts it" if one.accepts else f"refuses it: {one.reason}"
        width = max(map(len, rows))
        show("\n".join(f"{name:<{width}}  {value}" for name, value in rows.items()))
    for warning in () if quiet else found.warnings:
        say(f"note: {warning}")
    if found.problems:
        more = f" (and {len(found.problems) - 1} more)" if len(found.problems) > 1 else ""
        raise MissionError(f"{options.file}: {found.problems[0]}{more}")


def _rows(about: dict[str, Any]) -> dict[str, str]:
    from uavseg.flight.mission.estimate import duration_text

    fence, home = about["fence"], about["home"]
    slowest, fastest = f"{about['slowest_m_s']:.4g}", f"{about['fastest_m_s']:.4g}"
    speed = fastest if slowest == fastest else f"{slowest} to {fastest}"
    autopilot = "any autopilot" if about["autopilot"] == "generic" else about["autopilot"]
    return {
        "items": f"{about['items']:,} ({about['waypoints']:,} waypoints), for {autopilot}",
        "home": f"{home['lat']:.7f},{home['lon']:.7f}, {home['altitude_m']:g} m above the sea",
        "heights": f"{about['lowest_m']:g} to {about['highest_m']:g} m above home",
        "distance": f"{about['distance_m'] / 1000:.2f} km at {speed} m/s",
        "time": duration_text(about["duration_s"]),
        "photographs": f"{about['photographs']:,}",
        "fence": f"{fence['inclusions']} to stay inside, {fence['exclusions']} to keep out of",
        "rally points": f"{about['rally_points']}",
        **(_coverage_rows(about["coverage"]) if "coverage" in about else {}),
    }


def _coverage_rows(about: dict[str, Any]) -> dict[str, str]:
    def overlap(side: str) -> str:
        texts = (
            "not known" if one is None else f"{one['median']:.0%}, at least {one['least']:.0%}"
            for one in (about["overlap"][side], about["planned_overlap"][side])
        )
        return "; planned ".join(texts)

    near = about["planned"] - len(about["missing"])
    seen = (f"{100 * about[key]:.2f} %" for key in ("covered", "seen_twice", "seen_three_times"))
    return {
        "taken": f"{about['taken']:,}, for {near:,} of {about['planned']:,} that are planned",
        "covered": "{} of {:,.0f} m2, {} twice, {} three times".format(next(seen), about["area_m2"], *seen),
        "gaps": f"{about['gaps']:,}, {about['gaps_m2']:,.1f} m2",
        "overlap along": overlap("along"),
        "overlap beside": overlap("beside"),
        "blurred": f"{len(about['blurred']):,}; {about['blur_not_known']:,} not known",
    }


@job_command("upload", missions.UploadOptions)
def upload(options: missions.UploadOptions, reporter: Reporter) -> None:
    """Send the mission in FILE (.plan or .waypoints) to a vehicle with its fence and rally points, read them
    back and compare.

    Only heartbeats and the MAVLink mission protocol are sent: nothing arms or starts the vehicle. A fence and
    rally points that the file does not have are left as they are.

    Exit codes: 0, the vehicle holds the mission; 1, it is armed, it refused it, or something failed; 3, it
    accepted the mission, which could then not be read back.
    """
    from uavseg.jobs.flights.link import upload
    from uavseg.output.disk import noted_stream

    link = options.link
    with noted_stream("the mission of the vehicle"):
        done = upload(options.file, link.connect, link.timeout, reporter.progress, options.while_armed)
    reporter.finish(done.warnings)
    reporter.say(f"{options.file}: {vehicle_report(done.mission, done.vehicle)}, read back and equal")


def vehicle_report(mission: "Mission", vehicle: str) -> str:
    """Return what was transferred, and the vehicle."""
    parts = [f"{len(mission.items)} items"]
    if mission.fence:
        parts.append(f"a fence of {len(mission.fence)} shape{'s' * (len(mission.fence) > 1)}")
    if mission.rally:
        parts.append(f"{len(mission.rally)} rally point{'s' * (len(mission.rally) > 1)}")
    return f"{', '.join(parts)} ({vehicle})"


@job_command("download", missions.DownloadOptions)
def download(options: missions.DownloadOptions, reporter: Reporter) -> None:
    """Read the mission that a vehicle holds, with its fence and rally points, to a file.

    The file is for QGroundControl (.plan) or for Mission Planner (.waypoints, which holds no fence).
    """
    from uavseg.flight.formats.files import check_mission_format
    from uavseg.jobs.flights.link import download

    output, overwrite = options.output, options.files.overwrite
    check_mission_format(output)
    write.check_output(output, overwrite)
    found = download(options.link.connect, options.link.timeout, reporter.progress)
    unwritten = write.write_mission_output(found.mission, output, overwrite)
    reporter.finish((*found.warnings, *unwritten))
    reporter.say(f"{output}: {vehicle_report(found.mission, found.vehicle)}")


@job_command("footprints", missions.FootprintsOptions)
def footprints(options: missions.FootprintsOptions, reporter: Reporter) -> None:
    """Draw the ground that each PHOTO (a file, or a folder with its subfolders) shows.

    Position, height, angles of the camera and focal length are those of the EXIF and XMP tags of DJI, Autel,
    Parrot, Skydio, senseFly and Pix4D, and of geotags alone. A photograph that cannot be placed is left out,
    and named with the reason.
    """
    from uavseg.jobs.flights import photographs as job
    from uavseg.regions.formats import export

    target, overwrite = options.output, options.files.overwrite
    write.check_targets(target, None, overwrite)
    write.keep_inputs([target], options.poses.dem, options.poses.camera)
    found = job.footprints(options.photographs, options, reporter.progress)
    reporter.finish([*found.warnings, *export.format_notes(found.regions, target)])
    write.write_region_output(found, target, overwrite)
    area = found.regions.columns["area_m2"]
    reporter.timed_table(
        footprints=f"{len(found.regions):,} -> {write.shown(target)}",
        areas=f"{area.min():,.1f} to {area.max():,.1f} m2",
    )


@job_command("georeference", missions.GeoreferenceOptions)
def georeference(options: missions.GeoreferenceOptions, reporter: Reporter) -> None:
    """Make a map of PHOTOs (files, or folders with their subfolders) by their pose, without photogrammetry.

    Tags are read as by `uavseg footprints`. Each pixel is of the photograph whose camera is nearest; ground
    that is hidden or near the horizon stays empty. The likely error in metres is said at the end, and is
    among the tags of the map. `uavseg extract` and `uavseg match` take the map as it is.
    """
    from uavseg.jobs.flights import photographs as job

    found = job.georeference(options.photographs, options, reporter.progress)
    reporter.finish(found.warnings)
    rows, cols = found.geobox.shape
    pixels = f"{cols:,} x {rows:,} pixels of {100 * found.geobox.transform.a:g} cm"
    reporter.timed_table(
        photos=f"{len(found.photographs):,}",
        map=f"{pixels} -> {write.shown(str(found.path))}",
        error=f"likely {found.error_m:.1f} m, up to {found.edge_error_m:.1f} m at edges",
    )
