"""The widget of notebooks in headless Chromium, its model in place of Jupyter's."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

import uavseg
from tests.plot.web.test_in_browser import CHROMIUM, NODE, SAMPLE, has_playwright

pytest.importorskip("anywidget")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not has_playwright(), reason="needs chromium, node and playwright-core"),
]

HOST = """<!DOCTYPE html><title>notebook</title><body><div id="cell"></div>
<script type="application/json" id="state">%s</script>
<script type="module">
const state = JSON.parse(document.getElementById("state").textContent);
window.model = {
  listeners: {}, saved: 0,
  get: (name) => state[name],
  set(name, value) {
    state[name] = value;
    for (const call of this.listeners[`change:${name}`] ?? []) call();
  },
  save_changes() { this.saved += 1; },
  on(name, call) { (this.listeners[name] ??= []).push(call); },
  off(name, call) { this.listeners[name] = this.listeners[name].filter((one) => one !== call); },
};
const widget = await import(URL.createObjectURL(new Blob([state.esm], {type: "text/javascript"})));
window.cleanUp = widget.default.render({model: window.model, el: document.getElementById("cell")});
</script>"""


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    from uavseg.api.widget import RangeWidget

    folder = tmp_path_factory.mktemp("widget")
    pictures = Path(os.environ.get("UAVSEG_SCREENSHOTS") or folder)
    widget = RangeWidget(SAMPLE, (0.55, 1), height=500)
    state = {"page": widget.page, "range": widget.range, "height": widget.height, "esm": str(widget._esm)}
    text = json.dumps(state).replace("<", "\\u003c")
    (folder / "host.html").write_text(HOST % text)
    program = Path(__file__).with_name("drive_widget.js")
    done = subprocess.run(
        [str(NODE), str(program), str(folder), str(pictures), str(CHROMIUM)],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def test_the_widget_requests_nothing_and_has_no_errors(seen: dict[str, Any]) -> None:
    assert seen["requests"] == [] and seen["errors"] == []


def test_it_begins_with_its_range_and_height(seen: dict[str, Any]) -> None:
    assert seen["first"] == ["0.55", "1"] and seen["height"] == 500


def test_the_raster_fills_the_map(seen: dict[str, Any]) -> None:
    assert 300 < seen["picture"] <= 700


def test_the_slider_and_the_number_set_the_range(seen: dict[str, Any]) -> None:
    assert seen["dragged"] == [0.57, 1] and seen["typed"] == [0.57, 0.8]
    assert seen["saved"] >= 1


def test_a_slider_that_is_dragged_is_not_set_back(seen: dict[str, Any]) -> None:
    assert seen["echoes"] == 0


@pytest.mark.parametrize(("name", "shown"), [("given", ["0.1", "0.3"]), ("again", ["0.6", "1"])])
def test_a_range_that_is_set_moves_the_slider(name: str, shown: list[str], seen: dict[str, Any]) -> None:
    assert seen[name] == shown


def test_messages_of_other_windows_do_not_count(seen: dict[str, Any]) -> None:
    assert seen["forged"] == [0.6, 1]


def test_the_page_cannot_reach_the_notebook(seen: dict[str, Any]) -> None:
    assert seen["reach"] == "SecurityError"


def test_a_closed_widget_listens_no_more(seen: dict[str, Any]) -> None:
    assert seen["listeners"] == 0


def test_the_page_is_that_of_the_map_command(tmp_path: Path) -> None:
    from uavseg.api.widget import RangeWidget

    page = RangeWidget(SAMPLE, (0.55, 1)).page
    uavseg.map_page(SAMPLE, tmp_path / "map.html")
    data = '<script type="application/json" id="data">'
    [ours, theirs] = (
        text.partition(data)[2].partition("</script>")[0]
        for text in (page, (tmp_path / "map.html").read_text(encoding="utf-8"))
    )
    assert ours == theirs and len(ours) > 1000
