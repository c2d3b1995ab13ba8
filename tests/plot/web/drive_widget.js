// Use the widget of notebooks in Chromium, with a host in place of Jupyter, and print what was seen as JSON.
// Arguments: the folder with host.html, the folder for screenshots, the browser; playwright-core is found through NODE_PATH.
"use strict";

const {chromium} = require("playwright-core");
const [, , folder, pictures, executablePath] = process.argv;

(async () => {
  const browser = await chromium.launch({executablePath, args: ["--no-sandbox", "--disable-gpu"]});
  const context = await browser.newContext({offline: true, viewport: {width: 1000, height: 640}});
  const page = await context.newPage(), seen = {errors: [], requests: []};
  page.on("request", (request) => {
    if (!/^(data|blob|file|about):/.test(request.url())) seen.requests.push(request.url());
  });
  page.on("pageerror", (error) => seen.errors.push(String(error)));
  page.on("console", (message) => message.type() === "error" && seen.errors.push(message.text()));
  await page.goto(`file://${folder}/host.html`);
  const inner = page.frameLocator("iframe");
  await inner.locator("body[data-ready]").waitFor();
  const shown = async () => [await inner.locator("#low-number").inputValue(), await inner.locator("#high-number").inputValue()];
  const until = (low) => page.waitForFunction((value) => window.model.get("range")[0] === value, low);

  /** What a function gives as soon as it is as expected, or after ten seconds. */
  async function soon(ask, expected) {
    for (let n = 0; n < 100 && !expected(await ask()); n++) await page.waitForTimeout(100);
    return ask();
  }
  const width = async () => (await inner.locator("img.leaflet-image-layer").boundingBox()).width;

  seen.first = await shown();
  seen.picture = await soon(width, (pixels) => pixels > 300);
  seen.height = await page.locator("iframe").evaluate((frame) => frame.offsetHeight);
  await inner.locator("body").evaluate(() => {
    window.received = 0;
    window.addEventListener("message", () => { window.received += 1; });
  });
  await inner.locator("#low-slider").focus();
  for (let n = 0; n < 20; n++) await page.keyboard.press("ArrowRight");
  await until(0.57);
  seen.dragged = await page.evaluate(() => window.model.get("range"));
  seen.saved = await page.evaluate(() => window.model.saved);
  await inner.locator("#high-number").fill("0.8");
  await inner.locator("#high-number").press("Enter");
  await page.waitForFunction(() => window.model.get("range")[1] === 0.8);
  seen.typed = await page.evaluate(() => window.model.get("range"));

  seen.echoes = await inner.locator("body").evaluate(() => window.received);
  await page.evaluate(() => window.model.set("range", [0.1, 0.3]));
  seen.given = await soon(shown, ([low]) => low === "0.1");
  await page.evaluate(() => window.model.set("range", [0.6, 1]));
  seen.again = await soon(shown, ([low]) => low === "0.6");
  await page.waitForTimeout(1000);  // until the regions are outlined
  await page.screenshot({path: `${pictures}/widget.png`});

  await page.evaluate(() => window.postMessage({uavseg: "range", steps: [1, 2]}, "*"));
  await page.waitForTimeout(100);
  seen.forged = await page.evaluate(() => window.model.get("range"));
  seen.reach = await inner.locator("body").evaluate(() => {
    try { return String(window.parent.document.title); } catch (error) { return error.name; }
  });
  await page.evaluate(() => window.cleanUp());
  seen.listeners = await page.evaluate(() => Object.values(window.model.listeners).flat().length);
  await browser.close();
  console.log(JSON.stringify(seen));
})().catch((error) => { console.error(error); process.exit(1); });
