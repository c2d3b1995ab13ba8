// A range slider: cells are coloured while it is dragged, regions are outlined when it rests.
"use strict";

const REST_MS = 150;
const HELD_MS = 4000; // without a movement, also where the browser does not report a release

async function addSlider(page, list) {
  const grid = await Blocks.decode(page.data.cells);
  const cells = new CellOverlay(grid, page.data.image.bounds);
  const areas = areaBySteps(grid), found = make("p", {className: "found"});
  const [low, high] = page.data.range.map((value, n) => handle(["Low", "High"][n], value));
  const outlines = new Outlines(grid);
  let drawing = 0, resting = 0, turns = 0, outlining = 0; // the number of the outlining that is under way

  /** Cells of the range, at once. */
  function preview() {
    drawing = 0;
    cells.draw(low.step(), high.step());
    const area = areas(low.step(), high.step());
    found.textContent = `v ${low.step() / Blocks.STEPS} to ${high.step() / Blocks.STEPS}: ${areaText(area)} in range`;
  }

  /** Outlines of the regions, with their attributes; cells stay until they are there. */
  async function outline() {
    resting = 0;
    const own = outlining = ++turns, goesOn = () => outlining === own;
    const found = await outlines.find(low.step(), high.step());
    if (found && goesOn() && await list.showInTurns(found, goesOn)) end();
  }

  function end() {
    outlining = 0;
    cells.layer.remove();
  }

  function moved() {
    outlining = 0;
    outlines.cancel();
    cells.layer.addTo(page.map);
    list.layer.remove();
    if (!drawing) drawing = requestAnimationFrame(preview);
    restIn(HELD_MS);
  }

  function restIn(milliseconds) {
    clearTimeout(resting);
    resting = setTimeout(outline, milliseconds);
  }

  for (const [own, other, sign] of [[low, high, 1], [high, low, -1]]) {
    own.moved = () => {
      own.set(Math.min(Math.max(own.step(), (1 - sign) / 2), Blocks.STEPS - (1 + sign) / 2));
      if (sign * (other.step() - own.step()) < 1) other.set(own.step() + sign);
      moved();
    };
    own.rested = () => restIn(REST_MS);
  }
  list.settle = () => {
    if (!resting && !outlining) return;
    clearTimeout(resting);
    resting = 0;
    outlines.cancel();
    list.show(Blocks.regions(grid, low.step(), high.step()));
    list.layer.addTo(page.map);
    end();
  };
  list.controls.append(histogram(areas), low.element, high.element, found);
  preview();
  list.show(Blocks.regions(grid, low.step(), high.step()));
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
