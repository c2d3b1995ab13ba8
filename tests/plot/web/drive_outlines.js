// Outlines of many regions in the page of `uavseg map`, with and without workers; prints what was seen as JSON.
// Arguments: the page, the program of Chromium; playwright-core is found through NODE_PATH.
"use strict";

const fs = require("node:fs");
const {chromium} = require("playwright-core");
const [, , page_, executablePath] = process.argv;

/** Count polygons on the map, and the times at which the page itself looks for regions. */
function watch() {
  const text = document.querySelector("section:has([data-download='range.geojson'])").textContent;
  window.seen = {drawn: Number(text.match(/ of (\d+) chosen/)[1]), called: 0};
  const {onAdd, onRemove} = L.Polygon.prototype, {regions} = Blocks;
  L.Polygon.prototype.onAdd = function (map) { window.seen.drawn++; return onAdd.call(this, map); };
  L.Polygon.prototype.onRemove = function (map) { window.seen.drawn--; return onRemove.call(this, map); };
  Blocks.regions = (...given) => { window.seen.called++; return regions(...given); };
}

/** Move the lower end of the range, and let go. */
function release(step) {
  const low = document.getElementById("low-slider");
  low.value = step;
  low.oninput();
  low.onchange();
}

(async () => {
  const browser = await chromium.launch({executablePath, args: ["--no-sandbox", "--disable-gpu"]});
  const found = {};
  for (const name of ["worker", "slow", "without", "refused"]) {
    const context = await browser.newContext({offline: true, acceptDownloads: true});
    const page = await context.newPage(), errors = [];
    page.on("pageerror", (error) => errors.push(String(error)));
    if (name === "without") await page.addInitScript(() => { delete window.Worker; });
    if (name === "refused") {
      await page.addInitScript(() => {
        window.Worker = class { constructor() { setTimeout(() => this.onerror()); } postMessage() {} };
      });
    }
    if (name === "slow") {
      await page.addInitScript(() => {
        window.Worker = class extends Worker {
          set onmessage(act) { super.onmessage = (event) => setTimeout(() => act(event), 600); }
        };
      });
    }
    await page.goto(`file://${page_}`);
    await page.waitForSelector("body[data-ready]");
    const workers = page.workers().length;
    await page.evaluate(watch);
    const rests = () => page.waitForFunction(() => !document.querySelector("canvas.cells"));
    const state = () => page.evaluate(() => ({...window.seen}));
    const save = async () => {
      const [file] = await Promise.all([page.waitForEvent("download"), page.click("[data-download='range.geojson']")]);
      return JSON.parse(fs.readFileSync(await file.path(), "utf8"));
    };
    await page.evaluate(release, 400);
    await rests();
    const first = {...await state(), regions: await save()};
    // Another range, before the answer to the one before comes, or before its outlines are complete.
    await page.evaluate(release, 450);
    if (name === "slow") {
      await page.waitForTimeout(300);
      await page.evaluate(release, 500);
    } else await page.evaluate(() => new Promise((resolve) => {
      const add = L.Polygon.prototype.onAdd, low = document.getElementById("low-slider");
      L.Polygon.prototype.onAdd = function (map) {
        L.Polygon.prototype.onAdd = add;
        setTimeout(() => { low.value = 500; low.oninput(); low.onchange(); resolve(); });
        return add.call(this, map);
      };
    }));
    const interrupted = await state();
    await rests();
    const last = {...await state(), regions: await save()};
    await page.evaluate(release, 550);
    const atOnce = {regions: await save(), ...await state()}; // before anything rests
    found[name] = {workers, errors, first, interrupted, last, atOnce};
    await context.close();
  }
  await browser.close();
  process.stdout.write(JSON.stringify(found));
})();
