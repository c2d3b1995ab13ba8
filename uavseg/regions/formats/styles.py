"""Styles of regions for GIS programs: QML for QGIS, and SLD 1.0 (OGC 02-070).

They are beside the file of the regions. Regions are filled half transparent and outlined: in one colour, in
one for each class where they have a column `class`, or graduated where they have levels.
"""

from html import escape
from itertools import cycle
from pathlib import Path

from uavseg.arrays import Path_
from uavseg.errors import OutputError
from uavseg.output.atomic import atomic_file, check_target
from uavseg.regions.table import Regions

Class = tuple[str, str]  # name of a class and its colour, such as ("water", "#1f78b4")

COLOR = "#ffa500"
_ALPHA = 0.35  # of the fill
_OUTLINE_MM = 0.5  # in QGIS
_OUTLINE_PX = 1.5  # in SLD
_PALETTE = ("#1f78b4", "#e6ab02", "#33a02c", "#e31a1c", "#6a3d9a", "#b15928", "#a6761d", "#666666")
_RAMP = ("#440154", "#fde725")  # the ends of viridis
_RAMP_MIDDLE = "#21918c"


def classes_of(regions: Regions) -> tuple[str, tuple[Class, ...]] | None:
    """Return the column by which regions are coloured, and its values with colours; None for one colour.

    Classes without a colour get colours from a palette, in the order of their names.
    """
    if "class" in regions.columns:
        classes = regions.columns["class"].tolist()
        given = regions.columns["color"].tolist() if "color" in regions.columns else ()
        colors = {str(name): str(color) for name, color in zip(classes, given, strict=False) if color}
        names = sorted({str(name) for name in classes} - colors.keys())
        return "class", (*sorted(colors.items()), *zip(names, cycle(_PALETTE), strict=False))
    if "level" in regions.columns:
        levels = sorted(set(regions.columns["level"].tolist()))
        return "level", tuple((str(level), _ramp(k, len(levels))) for k, level in enumerate(levels))
    return None


def qml(regions: Regions) -> str:
    """Return the style as QML, as QGIS 3 reads it."""
    classes = classes_of(regions)
    if classes is None:
        head = '<renderer-v2 type="singleSymbol" enableorderby="0" forceraster="0" symbollevels="0">'
        inner = f"<symbols>{_qml_symbol('0', COLOR)}</symbols>"
    else:
        column, values = classes
        head = (
            f'<renderer-v2 type="categorizedSymbol" attr="{column}" enableorderby="0" forceraster="0" '
            'symbollevels="0">'
        )
        value_type = "long" if column == "level" else "string"
        categories = "".join(
            f'<category value="{escape(name)}" label="{escape(name)}" symbol="{k}" type="{value_type}" '
            'render="true"/>'
            for k, (name, _) in enumerate(values)
        )
        symbols = "".join(_qml_symbol(str(k), color) for k, (_, color) in enumerate(values))
        inner = f"<categories>{categories}</categories><symbols>{symbols}</symbols>"
    return (
        "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n"
        f'<qgis version="3.22.0" styleCategories="Symbology">{head}{inner}</renderer-v2>'
        "<layerGeometryType>2</layerGeometryType></qgis>\n"
    )


def sld(regions: Regions, layer: str = "regions") -> str:
    """Return the style of a layer as SLD 1.0."""
    column, values = classes_of(regions) or (None, (("regions", COLOR),))
    rules = "".join(_sld_rule(name, color, column) for name, color in values)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<StyledLayerDescriptor version="1.0.0" xmlns="http://www.opengis.net/sld" '
        'xmlns:ogc="http://www.opengis.net/ogc" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
        'xsi:schemaLocation="http://www.opengis.net/sld '
        'http://schemas.opengis.net/sld/1.0.0/StyledLayerDescriptor.xsd">'
        f"<NamedLayer><Name>{escape(layer)}</Name><UserStyle><Name>uavseg</Name>"
        f"<FeatureTypeStyle>{rules}</FeatureTypeStyle></UserStyle></NamedLayer></StyledLayerDescriptor>\n"
    )


def _qml_symbol(name: str, color: str) -> str:
    options = (
        {"color": _rgba(color, _ALPHA), "style": "solid", "outline_color": _rgba(color, 1)}
        | {"outline_style": "solid", "outline_width": f"{_OUTLINE_MM:g}", "outline_width_unit": "MM"}
        | {"joinstyle": "round"}
    )
    new = "".join(f'<Option name="{key}" type="QString" value="{value}"/>' for key, value in options.items())
    old = "".join(f'<prop k="{key}" v="{value}"/>' for key, value in options.items())  # before QGIS 3.26
    return (
        f'<symbol name="{name}" type="fill" alpha="1" clip_to_extent="1" force_rhr="0">'
        f'<layer class="SimpleFill" enabled="1" locked="0" pass="0"><Option type="Map">{new}</Option>{old}'
        "</layer></symbol>"
    )


def _sld_rule(name: str, color: str, column: str | None = None) -> str:
    matches = (
        ""
        if column is None
        else f"<ogc:Filter><ogc:PropertyIsEqualTo><ogc:PropertyName>{column}</ogc:PropertyName>"
        f"<ogc:Literal>{escape(name)}</ogc:Literal></ogc:PropertyIsEqualTo></ogc:Filter>"
    )
    return (
        f"<Rule><Name>{escape(name)}</Name>{matches}<PolygonSymbolizer>"
        f'<Fill><CssParameter name="fill">{color}</CssParameter>'
        f'<CssParameter name="fill-opacity">{_ALPHA:g}</CssParameter></Fill>'
        f'<Stroke><CssParameter name="stroke">{color}</CssParameter>'
        f'<CssParameter name="stroke-width">{_OUTLINE_PX:g}</CssParameter></Stroke>'
        "</PolygonSymbolizer></Rule>"
    )


def _rgba(color: str, alpha: float) -> str:
    red, green, blue = _rgb(color)
    return f"{red},{green},{blue},{round(255 * alpha)}"


def _rgb(color: str) -> tuple[int, int, int]:
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def _ramp(k: int, count: int) -> str:
    """Return color k of `count`, from dark to bright."""
    at = 2 * k / (count - 1) if count > 1 else 1.0
    low, high = (_RAMP[0], _RAMP_MIDDLE) if at <= 1 else (_RAMP_MIDDLE, _RAMP[1])
    share = at if at <= 1 else at - 1
    mixed = (round(a + share * (b - a)) for a, b in zip(_rgb(low), _rgb(high), strict=True))
    return "#" + "".join(f"{part:02x}" for part in mixed)


def check_style(target: Path_, format: str, overwrite: bool = False) -> Path:
    """Return the style file of a file of regions (its stem with .qml or .sld), if it may be made.

    The format is "qml" or "sld". An OutputError says that it is another one, or as of `check_target`.
    """
    if format not in ("qml", "sld"):
        raise OutputError(f"a style is qml (of QGIS) or sld, not {format!r}")
    return check_target(Path(target).with_suffix(f".{format}"), overwrite)


def write_style(regions: Regions, target: Path_, format: str, overwrite: bool = False) -> Path:
    """Write the style of regions beside their file, see `check_style`; return its path."""
    path = check_style(target, format, overwrite)
    text = qml(regions) if format == "qml" else sld(regions, Path(target).stem)
    with atomic_file(path, overwrite) as part:
        part.write_text(text, encoding="utf-8")
    return path
