// Use the page of `uavseg map` in Chromium as a person would, and print what was seen as JSON.
// Arguments: the page, the folder for screenshots; playwright-core is found through NODE_PATH.
"use strict";

const fs = require("node:fs");
const {chromium} = require("playwright-core");
const [, , page_, folder, executablePath] = process.argv;

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
  await page.focus("#low-slider");
  for (let n = 0; n < 30; n++) await page.keyboard.press("ArrowRight");
  await page.waitForTimeout(300);
  seen.low = await page.inputValue("#low-number");
  seen.moved = await save(page, "range.geojson");
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
  await page.keyboard.press("Escape");
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
