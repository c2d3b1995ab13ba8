"""`uavseg footprints` and `uavseg georeference`: what ground photographs show, and a map of them."""

from uavseg.cli import write
from uavseg.cli.command import job_command
from uavseg.cli.terminal.say import Reporter
from uavseg.options.missions import FootprintsOptions, GeoreferenceOptions


@job_command("footprints", FootprintsOptions)
def footprints(options: FootprintsOptions, reporter: Reporter) -> None:
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
    reporter.table(
        footprints=f"{len(found.regions):,} -> {write.shown(target)}",
        areas=f"{area.min():,.1f} to {area.max():,.1f} m2",
        seconds=f"{reporter.seconds:.2f}",
    )


@job_command("georeference", GeoreferenceOptions)
def georeference(options: GeoreferenceOptions, reporter: Reporter) -> None:
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
    reporter.table(
        photos=f"{len(found.photographs):,}",
        map=f"{pixels} -> {write.shown(str(found.path))}",
        error=f"likely {found.error_m:.1f} m, up to {found.edge_error_m:.1f} m at edges",
        seconds=f"{reporter.seconds:.2f}",
    )
