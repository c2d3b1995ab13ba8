// Use the page of `uavseg map` in Chromium as a person would, and print what was seen as JSON.
// Arguments: the page, the folder for screenshots; playwright-core is found through NODE_PATH.
"use strict";

const fs = require("node:fs");
const {chromium} = require("playwright-core");
const [, , page_, folder, executablePath] = process.argv;

/** The least contrast ratio (WCAG 2) between text of the page and what is behind it. */
function leastContrast() {
  const light = ([r, g, b]) => [r, g, b].map((one) => one / 255)
    .map((one) => (one <= 0.04045 ? one / 12.92 : ((one + 0.055) / 1.055) ** 2.4))
    .reduce((sum, one, n) => sum + one * [0.2126, 0.7152, 0.0722][n], 0);
  const parts = (color) => color.match(/[\d.]+/g).map(Number);
  const behind = (element) => {
    for (let one = element; one; one = one.parentElement) {
      const color = parts(getComputedStyle(one).backgroundColor);
      if (color.length === 3 || color[3] > 0.9) return color;
    }
    return [255, 255, 255];
  };
  const texts = [...document.querySelectorAll("body *")].filter((one) => one.offsetParent &&
    !one.closest(".arrow, script, style") && [...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim()));
  return Math.min(...texts.map((one) => {
    const both = [light(parts(getComputedStyle(one).color)), light(behind(one))].sort((a, b) => b - a);
    return (both[0] + 0.05) / (both[1] + 0.05);
  }));
}

(async () => {
  const browser = await chromium.launch({executablePath, args: ["--no-sandbox", "--disable-gpu"]});
  const seen = {requests: [], errors: []};
  async function open(options) {
    const context = await browser.newContext({offline: true, acceptDownloads: true, ...options});
    const page = await context.newPage();
    page.on("request", (request) => {
      if (!/^(data|blob|file):/.test(request.url())) seen.requests.push(request.url());
    });
    page.on("pageerror", (error) => seen.errors.push(String(error)));
    page.on("console", (message) => message.type() === "error" && seen.errors.push(message.text()));
    page.on("dialog", (dialog) => { seen.errors.push(`dialog ${dialog.message()}`); dialog.dismiss(); });
    await page.goto(`file://${page_}`);
    await page.waitForSelector("body[data-ready]");
    return page;
  }
  async function save(page, name) {
    const [file] = await Promise.all([page.waitForEvent("download"), page.click(`[data-download="${name}"]`)]);
    return JSON.parse(fs.readFileSync(await file.path(), "utf8"));
  }

  const page = await open({viewport: {width: 1200, height: 800}});
  seen.first = await save(page, "range.geojson");
  seen.start = await Promise.all(["#low-number", "#high-number"].map((name) => page.inputValue(name)));
  const outlined = () => page.evaluate(() => [
    document.querySelectorAll("canvas.cells").length,
    document.querySelector("section:has([data-download='range.geojson']) .found").textContent,
  ]);
  const rail = await page.locator("#low-slider").boundingBox(), height = rail.y + rail.height / 2;
  await page.mouse.move(rail.x + 0.55 * rail.width, height);
  await page.mouse.down();
  seen.dragged = [];
  for (const share of [0.3, 0.6]) {
    await page.mouse.move(rail.x + share * rail.width, height, {steps: 5});
    await page.waitForTimeout(300);
    seen.dragged.push(await outlined());
  }
  await page.screenshot({path: `${folder}/dragged.png`});
  seen.colored = await page.evaluate(() => {
    const canvas = document.querySelector("canvas.cells");
    const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    let count = 0;
    for (let n = 3; n < pixels.length; n += 4) count += pixels[n] > 0;
    return count / (canvas.width * canvas.height);
  });
  await page.mouse.up();
  await page.waitForFunction(() => !document.querySelector("canvas.cells"));
  seen.released = [Number(await page.inputValue("#low-number")), await save(page, "range.geojson")];
  await page.fill("#low-number", "0.55");
  await page.focus("#low-slider");
  for (let n = 0; n < 30; n++) await page.keyboard.press("ArrowRight");
  seen.low = await page.inputValue("#low-number");
  seen.moved = await save(page, "range.geojson");
  await page.waitForTimeout(300);
  await page.screenshot({path: `${folder}/wide.png`});
  seen.crossed = await page.evaluate(() => {
    const low = document.getElementById("low-slider"), high = document.getElementById("high-slider");
    high.value = 200;
    high.oninput();
    return [Number(low.value), Number(high.value)];
  });
  seen.all = await save(page, "chosen.geojson");
  await page.click("section:has([data-download='chosen.geojson']) li:first-child input");
  seen.without = await save(page, "chosen.geojson");
  await page.click("section:has([data-download='chosen.geojson']) li:first-child button");
  await page.waitForSelector(".leaflet-popup .popup");
  seen.popup = await page.innerText(".leaflet-popup .popup");
  await page.waitForTimeout(500);
  await page.screenshot({path: `${folder}/popup.png`});
  seen.contrast = await page.evaluate(leastContrast);
  await page.click(".leaflet-popup-close-button");
  await page.locator("input.footprints").check();
  await page.locator(".leaflet-container").press("Minus");
  await page.waitForTimeout(600);
  await page.screenshot({path: `${folder}/footprints.png`});
  seen.footprints = await page.innerText("label:has(input.footprints)");
  const before = await page.locator("#map img.leaflet-image-layer").count();
  await page.hover(".leaflet-control-layers");
  await page.click(".leaflet-control-layers label:has-text('Raster')");
  seen.raster = [before, await page.locator("#map img.leaflet-image-layer").count()];
  seen.markup = await page.locator("img[src='x'], b.injected, script[src]").count();
  seen.titles = await page.locator("h2").allInnerTexts();

  const phone = await open({viewport: {width: 390, height: 844}, hasTouch: true, isMobile: true});
  seen.wider = await phone.evaluate(() => document.documentElement.scrollWidth - window.innerWidth);
  seen.small = await phone.evaluate(() => [...document.querySelectorAll("button, .list label")]
    .filter((one) => one.offsetParent && one.getBoundingClientRect().height < 44).map((one) => one.textContent));
  await phone.screenshot({path: `${folder}/phone.png`});
  await phone.tap("#toggle");
  seen.closed = await phone.isHidden("#panel");
  await phone.waitForTimeout(300);
  await phone.screenshot({path: `${folder}/phone_closed.png`});
  await phone.tap("#map", {position: {x: 195, y: 420}});
  await phone.waitForTimeout(300);
  await browser.close();
  process.stdout.write(JSON.stringify(seen));
})();
