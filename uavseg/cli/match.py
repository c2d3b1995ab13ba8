"""`uavseg match`: regions of rasters that look like a sample of them, by color and texture."""

import math
import shlex
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uavseg.cli import write
from uavseg.cli.command import ARGUMENTS, job_command
from uavseg.cli.terminal.say import Reporter, say, work_of
from uavseg.options.regions import MatchOptions

if TYPE_CHECKING:
    from uavseg.jobs.match.match import Match
    from uavseg.raster.grid.geobox import GeoBox
    from uavseg.regions.sample.place import Disc
    from uavseg.regions.table import Regions

_ANSWERS: dict[str, Any] = {"y": True, "yes": True, "n": False, "no": False, "s": "skip", "skip": "skip"}
_ANSWERS |= {"q": None, "quit": None}
_MAX_ANSWER = 1 << 16  # bytes of a line


@job_command("match", MatchOptions)
def command(options: MatchOptions, reporter: Reporter) -> None:
    """Find the regions of RASTER... (many are one mosaic) that look like a sample of it.

    By color: mixtures of few kinds of ground are fitted to the colors of the whole raster, and those that are
    far more frequent in the sample than elsewhere are its kind. A radius of 8 pixels is enough.

    By texture: G, the log-likelihood ratio between joint histograms of LBP codes and contrast, tells a
    ploughed field from a meadow of the same grey; what looks more like the raster as a whole than like the
    sample is left out. The sample has a radius of 16 pixels at least, better 32.

    By default color; of what has the colors of the sample, texture decides where it clearly shows two kinds;
    and texture with intensity where color hardly parts the sample from the raster, or where --window,
    --similarity or --intensity is given. The table at the end says which. Several samples, and those of what
    is --unlike, are compared by color. With --classes, a whole map: samples of each class against those of
    all others; what is like none of them is left out.

    Where color leaves much of the raster undecided, a line says where to look, and what to add: the disc that
    would help most as another sample. With --ask such places are asked about one after the other, until no
    answer is expected to change much.

    Where answers by color differ, a line names them, and --answer writes another: 2 what touches the sample,
    for a thing among others of its color, 3 finer kinds, where the whole kind takes too much.

    Each region has its similarity, 1 where it is as like the sample as the sample is to itself.

    RASTER may be a folder, a pattern in quotes, @LIST (a file of names), ITEM.json#ASSET (of STAC) or -
    (names on standard input). Its rasters are one mosaic, unless --each is given.
    """
    from uavseg.jobs.match.match import each_answer, match, with_answers
    from uavseg.jobs.match.request import ANSWERS
    from uavseg.jobs.requests import region_job

    _check_samples(options)
    job = region_job(options)
    if write.answer_each(options, job, ".match.geojson", reporter):
        return
    files = write.RegionFiles(options, ".match.geojson", options.like, options.unlike, options.classes)
    picture = "match.place.png" if files.target == "-" else str(Path(files.target).with_suffix(".place.png"))
    if options.png is not None:
        from uavseg.plot.page.page import check_png_target

        write.check_distinct(files.target, options.png, picture if options.ask else None)
        write.keep_inputs([options.png], options.source.rasters, options.like, options.unlike)
        check_png_target(options.png, files.overwrite)
    if options.ask:
        from uavseg.plot.preview import PlacePicture

        drawn = PlacePicture(picture, files.overwrite)
        write.keep_inputs([picture], options.source.rasters, options.like, options.unlike)
    source: Any = job.opened(options.source.rasters, job.read)
    files.check_crs(source.geobox.wkt)
    work = work_of(options.run, reporter)
    advice: list[str | None] = []
    pictures: dict[str, Regions] = {}
    answers, request = list[str](), job.request

    def ask(disc: "Disc") -> Any:
        drawn.draw(source.dataset, disc, job.read.spec or "auto")
        return _answer(disc, source.geobox, picture, answers)

    if options.classes is None:
        if options.ask:
            request = with_answers(source, request, ask, work)
        made = match(source, request, work)
        found, compared = made.found, _compared(made)
        advice = [made.others, None if options.ask else made.advice]
        if options.png is not None:
            answered = each_answer(source, request, made, work)
            pictures = {f"--answer {n}: {ANSWERS[n]}": regions for n, regions in answered.items()}
    else:
        found = job.find(source, work)
        counts = sorted(Counter(found.regions.columns["class"].tolist()).items())
        compared = {"classes": ", ".join(f"{name} {count:,}" for name, count in counts) or "none"}
    reporter.finish([*found.warnings, *files.notes(found, source.geobox.wkt)])
    for line in filter(None, advice):
        reporter.say(line)
    if options.ask:
        given = [word for word in click.get_current_context().meta[ARGUMENTS] if word != "--ask"]
        end = given.index("--") if "--" in given else len(given)
        words = shlex.join(["uavseg", "match", *given[:end], *answers, *given[end:]])
        reporter.say(f"no more questions; the same regions without them: {words}")
    with write.transaction():
        if options.png is not None:
            from uavseg.plot.preview import draw_answers

            draw_answers(source.dataset, options.png, pictures, job.read.spec or "auto", files.overwrite)
        files.write(found, work)
    common = write.summary_rows(found)
    rows = {"regions": f"{len(found.regions):,} -> {write.shown(files.target)}"}
    rows |= {name: common[name] for name in ("total area", "largest")}
    rows |= write.confidence_row(found) | compared | {name: common[name] for name in ("stretch", "band")}
    reporter.timed_table(rows)


def _check_samples(options: MatchOptions) -> None:
    """Refuse samples of two sorts: those of `like`, or of classes."""
    for name in ("ask", "png"):
        if getattr(options, name) and options.each.each:
            raise click.UsageError(f"--{name} is for one source; leave it out, or --each")
    if options.classes is None:
        if not options.like:
            raise click.UsageError("give a sample with --like, or samples of several classes with --classes")
        return
    given = [f"--{name}" for name in ("like", "unlike", "ask", "png", "window") if getattr(options, name)]
    usual: dict[str, Any] = {"by": "auto", "answer": 1, "similarity": 0.9, "intensity": 1.0}
    given += [f"--{name}" for name, value in usual.items() if getattr(options, name) != value]
    if given:
        why = "--classes compares the colors of all its samples"
        raise click.UsageError(f"{why}; leave out {', '.join(given)}")


def _answer(disc: "Disc", geobox: "GeoBox", picture: str, answers: list[str]) -> Any:
    """Say where a disc lies, read whether it is wanted, and add that to answers, as an option."""
    x, y, _ = disc.word.split(",")
    lon, lat = (math.nan,) * 2 if geobox.wkt is None else geobox.lonlat_from_xy(disc.x, disc.y)
    where = f" (latitude {lat:.7f}, longitude {lon:.7f})" if math.isfinite(lat) else ""
    say(f"what lies at {x}, {y}{where}? It is drawn in {picture}")
    while True:
        say("Is this wanted? [y/n/s(kip)/q]")
        line = b"" if sys.stdin is None else sys.stdin.buffer.readline(_MAX_ANSWER)
        if not line:
            say("standard input has ended, and so have the questions")
            return None
        answer = line.decode(errors="replace").strip().lower()
        if answer in _ANSWERS:
            wanted = _ANSWERS[answer]
            if isinstance(wanted, bool):
                answers.append(f"--{'like' if wanted else 'unlike'}={disc.word}")
            return wanted
        say(f"an answer is y, n, s or q, not {answer[:40]!r}")


def _compared(match: "Match") -> dict[str, str]:
    """Return what was compared, and what it says of the sample."""
    from uavseg.units import GREY_MAX

    color, texture = match.color, match.texture
    rows = {"compared": match.compared if color is not None else "texture and intensity"}
    if color is not None:
        rows["likeness"] = f"{color.sample_mean:.2f} in the sample, {color.raster_mean:.2f} in the raster"
        if color.other_mean is not None:
            rows["likeness"] += f", {color.other_mean:.2f} in what is unlike"
    if texture is not None:
        sample = texture.sample
        mean, deviation = sample.mean / GREY_MAX, sample.deviation / GREY_MAX
        rows["sample"] = f"{sample.model.count:,} pixels, v {mean:.3f} +- {deviation:.3f}"
        rows["window"] = f"{texture.window} pixels"
        own = f"{texture.own:.3f} beyond chance in the sample"
        rows["G per pixel"] = f"{own}, up to {texture.limit:.3f} is like it"
    return rows
