// The slider of a raster with too many cells for a page, in Chromium: print what the canvases of cells show as JSON.
// Arguments: the address of the page, a folder for screenshots, the browser, a file of ranges in steps.
"use strict";

const fs = require("node:fs");
const {chromium} = require("playwright-core");
const [, , url, folder, executablePath, asked] = process.argv;

(async () => {
  const browser = await chromium.launch({executablePath, args: ["--no-sandbox", "--disable-gpu"]});
  const seen = {errors: [], shown: [], asked: 0};
  const page = await (await browser.newContext({viewport: {width: 1200, height: 800}})).newPage();
  page.on("request", (request) => { seen.asked += request.url().includes("/codes/"); });
  page.on("pageerror", (error) => seen.errors.push(String(error)));
  page.on("console", (message) => message.type() === "error" && seen.errors.push(message.text()));
  await page.goto(url);
  await page.waitForSelector("body[data-ready]");
  await page.waitForLoadState("networkidle");
  const before = seen.asked;
  for (const [low, high] of JSON.parse(fs.readFileSync(asked, "utf8"))) {
    // As a hand drags them: the handles push each other, so each is set once more.
    await page.evaluate(([low, high]) => {
      for (const [name, value] of [["low", low], ["high", high], ["low", low]]) {
        const slider = document.getElementById(`${name}-slider`);
        slider.value = value;
        slider.dispatchEvent(new Event("input", {bubbles: true}));
      }
    }, [low, high]);
    await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
    seen.shown.push(await page.evaluate(() => ({
      text: document.querySelector(".found").textContent,
      tiles: [...document.querySelectorAll("canvas.cells")].filter((tile) => tile.codes).map((tile) => {
        const pixels = tile.getContext("2d").getImageData(0, 0, 256, 256).data, bits = [];
        for (let n = 3; n < pixels.length; n += 4) bits.push(pixels[n] ? "1" : "0");
        return {place: tile.dataset.place, bits: bits.join("")};
      }),
    })));
  }
  seen.dragged = seen.asked - before;
  // Tiles lie over the picture: where they are, it can be taken away, and nothing changes.
  seen.covered = [];
  const clip = {x: 250, y: 250, width: 300, height: 300};
  for (let k = 0; k < 3; k++) {
    await page.click(".leaflet-control-zoom-in");
    await page.waitForTimeout(600);
  }
  await still();
  await page.screenshot({path: `${folder}/served_cells.png`});
  seen.covered.push((await still()).toString("base64"));
  await page.evaluate(() => document.querySelector("img.leaflet-image-layer").remove());
  seen.covered.push((await still()).toString("base64"));

  /** A picture of a part of the map that is the same for a second: tiles fade in. */
  async function still() {
    let before = Buffer.alloc(0);
    for (let tries = 0; tries < 30; tries++) {
      await page.waitForLoadState("networkidle");
      const now = await page.screenshot({clip});
      if (now.equals(before)) break;
      before = now;
      await page.waitForTimeout(1000);
    }
    return before;
  }
  await browser.close();
  process.stdout.write(JSON.stringify(seen));
})();
