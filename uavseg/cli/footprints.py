"""`uavseg footprints`: what ground photographs show."""

from __future__ import annotations

from uavseg.cli import write
from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter
from uavseg.options.photographs import FootprintsOptions


@job_command("footprints", FootprintsOptions)
def command(options: FootprintsOptions) -> None:
    """Draw the ground that each PHOTO (a file, or a folder with its subfolders) shows.

    Position, height, angles of the camera and focal length are those of the EXIF and XMP tags of DJI, Autel,
    Parrot, Skydio, senseFly and Pix4D, and of geotags alone. A photograph that cannot be placed is left out,
    and named with the reason.
    """
    from uavseg.jobs.flights.footprints import footprints
    from uavseg.regions.formats import export

    target, overwrite = options.output, options.files.overwrite
    reporter = Reporter(options.messages, options.progress)
    write.check_targets(target, None, overwrite)
    write.keep_inputs([target], options.poses.dem, options.poses.camera)
    found = footprints(options.photographs, options, reporter.progress)
    reporter.finish([*found.warnings, *export.format_notes(found.regions, target)])
    write.write_region_output(found, target, overwrite)
    area = found.regions.columns["area_m2"]
    reporter.table(
        {
            "footprints": f"{len(found.regions):,} -> {write.shown(target)}",
            "areas": f"{area.min():,.1f} to {area.max():,.1f} m2",
            "seconds": f"{reporter.seconds:.2f}",
        }
    )
