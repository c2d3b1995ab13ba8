"""Styles of regions for GIS programs: QML for QGIS, and SLD 1.0 (OGC 02-070) for all that read it.

Regions are filled half transparent and outlined: in one colour, or in one for each class where they have a
column `class`, or graduated where they have levels.
"""

from collections.abc import Sequence
from html import escape
from itertools import cycle

from uavseg.regions.table import Regions

Class = tuple[str, str]
"""Name of a class and its colour, such as ("water", "#1f78b4")."""

COLOR = "#ffa500"
_ALPHA = 0.35  # of the fill
_OUTLINE_MM = 0.5  # in QGIS
_OUTLINE_PX = 1.5  # in SLD
_PALETTE = ("#1f78b4", "#e6ab02", "#33a02c", "#e31a1c", "#6a3d9a", "#b15928", "#a6761d", "#666666")
_RAMP = ("#440154", "#fde725")  # the ends of viridis, by way of
_RAMP_MIDDLE = "#21918c"


def classes_of(regions: Regions, colors: Sequence[Class] = ()) -> tuple[str, tuple[Class, ...]] | None:
    """The column by which regions are coloured, and its values with their colours; None for one colour.

    Parameters
    ----------
    regions : Regions
    colors : sequence of (name, colour)
        Of classes; others get colours from a palette, in the order of their names.
    """
    if "class" in regions.columns:
        colors = colors or _given_colors(regions)
        names = sorted(
            {str(name) for name in regions.columns["class"].tolist()} - {name for name, _ in colors}
        )
        return "class", (*colors, *zip(names, cycle(_PALETTE), strict=False))
    if "level" in regions.columns:
        found = sorted(set(regions.columns["level"].tolist()))
        return "level", tuple((str(level), _ramp(k, len(found))) for k, level in enumerate(found))
    return None


def _given_colors(regions: Regions) -> tuple[Class, ...]:
    """Classes with the colours of the column `color`, in the order of their names."""
    if "color" not in regions.columns:
        return ()
    pairs = zip(regions.columns["class"].tolist(), regions.columns["color"].tolist(), strict=True)
    return tuple(sorted({str(name): str(color) for name, color in pairs if color}.items()))


def qml(regions: Regions, colors: Sequence[Class] = ()) -> str:
    """The style as QML, as QGIS 3 reads it.

    Parameters
    ----------
    regions : Regions
    colors : sequence of (name, colour)
    """
    classes = classes_of(regions, colors)
    if classes is None:
        head = '<renderer-v2 type="singleSymbol" enableorderby="0" forceraster="0" symbollevels="0">'
        inner = f"<symbols>{_qml_symbol('0', COLOR)}</symbols>"
    else:
        column, values = classes
        head = (
            f'<renderer-v2 type="categorizedSymbol" attr="{column}" enableorderby="0" forceraster="0" '
            'symbollevels="0">'
        )
        kind = "long" if column == "level" else "string"
        categories = "".join(
            f'<category value="{escape(name)}" label="{escape(name)}" symbol="{k}" type="{kind}" '
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


def sld(regions: Regions, layer: str = "regions", colors: Sequence[Class] = ()) -> str:
    """The style as SLD 1.0.

    Parameters
    ----------
    regions : Regions
    layer : str
        Name of the layer that it is for.
    colors : sequence of (name, colour)
    """
    classes = classes_of(regions, colors)
    rules = (
        _sld_rule("regions", COLOR)
        if classes is None
        else "".join(_sld_rule(name, color, classes[0]) for name, color in classes[1])
    )
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
    options = {
        "color": _rgba(color, _ALPHA),
        "style": "solid",
        "outline_color": _rgba(color, 1),
        "outline_style": "solid",
        "outline_width": f"{_OUTLINE_MM:g}",
        "outline_width_unit": "MM",
        "joinstyle": "round",
    }
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
    """Color k of `count`, from dark to bright."""
    at = 2 * k / (count - 1) if count > 1 else 1.0
    low, high = (_RAMP[0], _RAMP_MIDDLE) if at <= 1 else (_RAMP_MIDDLE, _RAMP[1])
    share = at if at <= 1 else at - 1
    mixed = (round(a + share * (b - a)) for a, b in zip(_rgb(low), _rgb(high), strict=True))
    return "#" + "".join(f"{part:02x}" for part in mixed)
