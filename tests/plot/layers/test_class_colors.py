"""Colours by class: given ones are kept, the others come from the palette."""

from typing import Any

import numpy as np

from uavseg.plot.layers.region_layer import MAX_CLASSES, class_colors

PALETTE = ("#111111", "#222222", "#333333")


def colors_of(classes: list[object], colors: list[object] | None = None) -> Any:
    columns = {"class": np.array(classes, object)}
    if colors is not None:
        columns["color"] = np.array(colors, object)
    return class_colors(columns, PALETTE)


def test_a_class_has_its_own_color_or_one_that_no_other_has() -> None:
    colors, legend = colors_of(["b", "a", "b", "c"], ["", "#111111", None, "red"])
    assert legend == {"a": "#111111", "b": "#333333", "c": "#222222"}
    assert colors.tolist() == ["#333333", "#111111", "#333333", "#222222"]


def test_without_classes_or_with_too_many_there_are_no_colors_of_classes() -> None:
    assert class_colors({"id": np.arange(3)}, PALETTE) is None
    assert colors_of([str(n) for n in range(MAX_CLASSES)]) is not None
    assert colors_of([str(n) for n in range(MAX_CLASSES + 1)]) is None
    assert colors_of([]) is None


def test_missing_classes_are_one_class_without_a_name() -> None:
    _, legend = colors_of([None, float("nan"), "a"])
    assert set(legend) == {"", "a"}
