// A range slider: cells are coloured while it is dragged, regions are outlined when it rests.
"use strict";

const REST_MS = 150;
const HELD_MS = 4000; // without a movement, also where the browser does not report a release

/** The slider of a page that holds all cells: its regions are outlined in the page. */
async function addSlider(page, list) {
  const grid = await Blocks.decode(page.data.cells);
  const cells = new CellOverlay(grid, page.data.image.bounds);
  const outlines = new Outlines(grid);
  const range = addRange(page, list.controls, {areas: areaBySteps(grid), cells, moved, rested});
  let turns = 0, outlining = 0; // the number of the outlining that is under way

  function moved() {
    outlining = 0;
    outlines.cancel();
    cells.layer.addTo(page.map);
    list.layer.remove();
  }

  /** Outlines of the regions, with their attributes; cells stay until they are there. */
  async function rested(low, high) {
    const own = outlining = ++turns, goesOn = () => outlining === own;
    const found = await outlines.find(low, high);
    if (found && goesOn() && await list.showInTurns(found, goesOn)) end();
  }

  function end() {
    outlining = 0;
    cells.layer.remove();
  }

  list.settle = () => {
    if (!range.stopWaiting() && !outlining) return;
    outlines.cancel();
    list.show(Blocks.regions(grid, ...range.steps()));
    list.layer.addTo(page.map);
    end();
  };
  list.show(Blocks.regions(grid, ...range.steps()));
}

/**
 * Two handles above which the histogram is drawn: cells are coloured while one is dragged.
 * `areas` gives square metres of a range of steps, `cells` draws it, `moved` and `rested` say what else is shown.
 */
function addRange(page, controls, {areas, cells, moved, rested}) {
  const found = make("p", {className: "found"});
  const [low, high] = page.data.range.map((value, n) => handle(["Low", "High"][n], value));
  const steps = () => [low.step(), high.step()];
  let drawing = 0, resting = 0;

  /** Cells of the range, at once. */
  function preview() {
    drawing = 0;
    cells.draw(...steps());
    const area = areas(...steps());
    found.textContent = `v ${low.step() / Blocks.STEPS} to ${high.step() / Blocks.STEPS}: ${areaText(area)} in range`;
  }

  function rest() {
    resting = 0;
    rested(...steps());
  }

  /** Whether it had not rested yet; then it will not. */
  function stopWaiting() {
    const waited = resting !== 0;
    clearTimeout(resting);
    resting = 0;
    return waited;
  }

  function restIn(milliseconds) {
    clearTimeout(resting);
    resting = setTimeout(rest, milliseconds);
  }

  for (const [own, other, sign] of [[low, high, 1], [high, low, -1]]) {
    own.moved = () => {
      own.set(Math.min(Math.max(own.step(), (1 - sign) / 2), Blocks.STEPS - (1 + sign) / 2));
      if (sign * (other.step() - own.step()) < 1) other.set(own.step() + sign);
      moved();
      if (!drawing) drawing = requestAnimationFrame(preview);
      restIn(HELD_MS);
    };
    own.rested = () => restIn(REST_MS);
  }
  controls.append(histogram(areas), low.element, high.element, found);
  preview();
  return {steps, stopWaiting};
}

/** How much area there is of each v, drawn above the sliders. */
function histogram(areas) {
  const bins = 100, width = Blocks.STEPS / bins;
  const heights = Array.from({length: bins}, (_, n) => areas(n * width, (n + 1) * width));
  const canvas = make("canvas", {width: bins, height: 40, className: "histogram"}), most = Math.max(...heights, 1e-9);
  canvas.ariaHidden = "true";
  const context = canvas.getContext("2d");
  context.fillStyle = "#000000";
  heights.forEach((height, n) => {
    const tall = Math.ceil((40 * height) / most);
    context.fillRect(n, 40 - tall, 1, tall);
  });
  return make("div", {className: "slider"}, "v", canvas);
}

function handle(name, step) {
  const slider = make("input", {type: "range", min: 0, max: Blocks.STEPS, step: 1, value: step});
  const text = make("input", {type: "number", min: 0, max: 1, step: 0.005, value: step / Blocks.STEPS});
  slider.ariaLabel = `${name} end of the range`;
  text.ariaLabel = `${name} end of the range, as a number`;
  slider.id = `${name.toLowerCase()}-slider`;
  text.id = `${name.toLowerCase()}-number`;
  const own = {
    element: make("div", {className: "slider"}, name, slider, text),
    step: () => Number(slider.value),
    set: (value) => { slider.value = value; text.value = slider.value / Blocks.STEPS; },
    moved: () => {},
    rested: () => {},
  };
  slider.oninput = () => { text.value = own.step() / Blocks.STEPS; own.moved(); };
  slider.onchange = () => own.rested();
  text.onchange = () => { own.set(Math.round(Number(text.value) * Blocks.STEPS)); own.moved(); own.rested(); };
  return own;
}
