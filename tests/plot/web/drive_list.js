// Scroll and tab through the list of a page with thousands of regions, and print what was seen as JSON.
// Arguments: the page, the program of the browser; playwright-core is found through NODE_PATH.
"use strict";

const {chromium} = require("playwright-core");
const [, , page_, executablePath] = process.argv;

(async () => {
  const browser = await chromium.launch({executablePath, args: ["--no-sandbox", "--disable-gpu"]});
  const page = await (await browser.newContext({offline: true, viewport: {width: 390, height: 844}})).newPage();
  const errors = [];
  page.on("pageerror", (error) => errors.push(String(error)));
  await page.goto(`file://${page_}`);
  await page.waitForSelector("body[data-ready]");
  const name = "section:has([data-download='chosen.geojson']) .list";
  const list = page.locator(name), rows = () => list.locator("li").count();
  const text = (place) => list.locator("li").nth(place).innerText();
  const far = (top) => list.evaluate((one, to) => { one.scrollTop = to; }, top);
  const first = () => page.waitForFunction((one) => document.querySelector(`${one} ul`).children.length > 0, name);
  await first();
  const seen = {errors, started: await rows(), height: await list.evaluate((one) => one.scrollHeight)};
  await list.locator("li input").first().uncheck();
  await page.evaluate(() => document.activeElement.blur()); // a part in use stays
  await far(1e9);
  await page.waitForFunction((one) => document.querySelector(`${one} ul:last-child`).children.length > 0 &&
    document.querySelector(`${one} ul`).children.length === 0, name);
  Object.assign(seen, {ended: await rows(), last: await text(-1), grown: await list.evaluate((one) => one.scrollHeight)});
  await far(0);
  await first();
  seen.kept = await list.locator("li input").first().isChecked();
  seen.summary = await list.evaluate((one) => one.parentElement.querySelector("p").textContent);
  await list.locator("li input").first().focus();
  for (let n = 0; n < 260; n++) {
    await page.keyboard.press("Tab");
    if (n % 10 === 0) await page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));
  }
  seen.tabbed = await page.evaluate(() => document.activeElement.ariaLabel);
  await browser.close();
  process.stdout.write(JSON.stringify(seen));
})();
