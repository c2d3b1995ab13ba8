// What axe-core, the Tab key and a finger find on a page, on a telephone and on a desktop: print it as JSON.
// Arguments: the address of the page, a folder for screenshots, the browser; modules are found through NODE_PATH.
"use strict";

const {chromium} = require("playwright-core");
const [, , url, folder, executablePath] = process.argv;
const SIZES = {
  phone: {viewport: {width: 390, height: 844}, hasTouch: true, isMobile: true},
  desktop: {viewport: {width: 1280, height: 800}},
};
const kind = url.startsWith("file:") ? "map" : "serve";

/** Number the controls that are seen and can be used, and return what names each. */
function numbered() {
  const all = [...document.querySelectorAll("a[href], button, input, select, [tabindex='0']")];
  const seen = all.filter((one) => one.checkVisibility({visibilityProperty: true}) && !one.disabled);
  return seen.map((one, n) => {
    one.dataset.control = n;
    return one.id || one.ariaLabel || one.title || one.textContent.trim() || one.outerHTML.slice(0, 120);
  });
}

/** The number of the control that has the focus, whether its look says so, and whether something lies over it. */
function focused() {
  const one = document.activeElement;
  if (!one || one === document.body) return null;
  const look = getComputedStyle(one), box = one.getBoundingClientRect();
  const x = Math.min(Math.max(box.x + box.width / 2, 0), innerWidth - 1), y = box.y + Math.min(box.height / 2, 20);
  const top = document.elementFromPoint(x, y);
  return {
    number: Number(one.dataset.control ?? -1),
    marked: look.outlineStyle !== "none" && parseFloat(look.outlineWidth) >= 2,
    covered: !top || !(one.contains(top) || top.contains(one)),
  };
}

/** Places of the screen where a region lies, below nothing else. */
function placesOfRegions() {
  const canvas = document.querySelector(".leaflet-overlay-pane canvas"), box = canvas.getBoundingClientRect();
  const pixels = canvas.getContext("2d", {willReadFrequently: true}), scale = canvas.width / box.width;
  const painted = (x, y) => pixels.getImageData((x - box.x) * scale, (y - box.y) * scale, 1, 1).data[3] > 0;
  const filled = (x, y) => [-4, 0, 4].every((down) => [-4, 0, 4].every((along) => painted(x + along, y + down)));
  const found = [];
  for (let y = 60; y < innerHeight - 20; y += 6) {
    for (let x = 20; x < innerWidth - 20; x += 6) {
      if (document.elementFromPoint(x, y)?.closest(".leaflet-overlay-pane") && filled(x, y)) found.push([x, y]);
    }
  }
  return found;
}

/** How far a popup goes out of the screen or the map, in pixels, and whether something lies over its corners. */
function popupPlace() {
  const popup = document.querySelector(".leaflet-popup-content-wrapper"), close = document.querySelector(".leaflet-popup-close-button");
  if (!popup) return null;
  const box = popup.getBoundingClientRect(), cross = close.getBoundingClientRect(), inset = 14;
  const corners = [[box.left, box.top], [box.right, box.top], [box.left, box.bottom], [box.right, box.bottom]];
  const inside = ([x, y]) => [x < box.x + 50 ? x + inset : x - inset, y < box.y + box.height / 2 ? y + inset : y - inset];
  return {
    outside: Math.max(-box.left, -box.top, box.right - innerWidth, box.bottom - innerHeight),
    covered: corners.map(inside).filter(([x, y]) => !document.elementFromPoint(x, y)?.closest(".leaflet-popup")).length,
    cross: document.elementFromPoint(cross.x + cross.width / 2, cross.y + cross.height / 2)?.closest(".leaflet-popup-close-button") === close,
    rows: popup.querySelectorAll("tr").length,
  };
}

(async () => {
  const browser = await chromium.launch({executablePath, args: ["--no-sandbox", "--disable-gpu"]});
  const seen = {};
  for (const [name, options] of Object.entries(SIZES)) {
    const page = await (await browser.newContext({...options, bypassCSP: true})).newPage(); // CSP holds axe-core back too
    const own = seen[name] = {violations: [], errors: []};
    page.on("pageerror", (error) => own.errors.push(String(error)));
    const open = async () => {
      await page.goto(url);
      await page.waitForSelector("body[data-ready]");
      await page.addScriptTag({path: require.resolve("axe-core/axe.min.js")});
    };
    await open();
    const look = async (state) => {
      const {violations} = await page.evaluate(() => axe.run(document, {runOnly: ["wcag2a", "wcag2aa", "wcag2aaa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]}));
      for (const one of violations) {
        for (const node of one.nodes) own.violations.push(`${state}: ${one.id}: ${node.html.slice(0, 200)} ${node.failureSummary}`);
      }
    };
    await look("opened");

    // Each control is reached by Tab, and its look says where the focus is.
    const controls = await page.evaluate(numbered), reached = new Set();
    own.unmarked = [];
    own.hidden = [];
    for (let n = 0; n < controls.length + 40; n++) {
      await page.keyboard.press("Tab");
      const one = await page.evaluate(focused);
      if (!one || one.number < 0) continue;
      reached.add(one.number);
      if (!one.marked) own.unmarked.push(controls[one.number]);
      if (one.covered) own.hidden.push(controls[one.number]);
    }
    own.controls = controls.length;
    own.missed = controls.filter((_, n) => !reached.has(n));

    if (kind === "map") {
      const places = await page.evaluate(placesOfRegions);
      own.popups = [];
      for (const n of [0, 0.25, 0.5, 0.75, 1]) {
        const [x, y] = places[Math.floor(n * (places.length - 1))];
        await (options.hasTouch ? page.touchscreen.tap(x, y) : page.mouse.click(x, y));
        await page.waitForTimeout(700); // until the map has moved
        own.popups.push(await page.evaluate(popupPlace));
        if (n === 0) {
          await page.screenshot({path: `${folder}/access_${name}.png`});
          await look("with a popup");
        }
        await open(); // where the map was
      }
      // Regions by keys alone: the list opens a popup, whose tick box is the one of the list; Escape closes it.
      const row = page.locator("section:has([data-download='chosen.geojson']) li:first-child");
      await row.locator("button").focus();
      await page.keyboard.press("Enter");
      await page.waitForSelector(".leaflet-popup .popup");
      await page.waitForTimeout(700);
      own.listed = await page.evaluate(popupPlace);
      own.focus = [await page.evaluate(() => Boolean(document.activeElement.closest(".leaflet-popup")))];
      await page.screenshot({path: `${folder}/access_listed_${name}.png`});
      await page.keyboard.press("Escape");
      await page.waitForTimeout(400);
      own.closed = await page.locator(".leaflet-popup").count() === 0;
      own.focus.push(await row.locator("button").evaluate((one) => one === document.activeElement));
      await row.locator("input").focus();
      await page.keyboard.press("Space");
      own.unticked = !(await row.locator("input").isChecked());
      const width = () => page.locator("#map img.leaflet-image-layer").evaluate((one) => one.getBoundingClientRect().width);
      const before = await width();
      await page.focus(".leaflet-control-zoom-out");
      await page.keyboard.press("Space");
      await page.waitForTimeout(500);
      own.spaced = await width() < before;
      // The switch of layers opens with Enter, where it is a button.
      await page.focus(".leaflet-control-layers-toggle");
      await page.keyboard.press("Enter");
      own.layers = await page.isVisible(".leaflet-control-layers-list");
      await look("with layers");
    }
    if (kind === "serve") {
      // Jobs by keys alone: regions, a mission over them, and one that is refused.
      const work = async (button) => {
        await page.focus(button);
        await page.keyboard.press("Enter");
        await page.waitForFunction(() => document.getElementById("exact").disabled, null, {timeout: 5000}).catch(() => null);
        await page.waitForFunction(() => !document.getElementById("exact").disabled, null, {timeout: 60000});
      };
      await page.fill("#low-number", "0.55");
      await page.press("#low-number", "Tab");
      await page.fill("#min-area", "500");
      await work("#exact");
      own.downloads = [await page.locator("a[data-file]").count()];
      await look("with regions");
      await page.selectOption("#camera", "DJI Mavic 3");
      await page.fill("#altitude", "60");
      await work("#plan");
      await page.waitForSelector("a[data-file='mission.plan']", {timeout: 60000});
      own.downloads.push(await page.locator("a[data-file]").count());
      await look("with a mission");
      await page.screenshot({path: `${folder}/access_served_${name}.png`});
      await page.fill("#altitude", "-5");
      await work("#plan");
      own.refused = await page.innerText("#job-status");
      await look("with a refusal");
    }
    if (name === "phone") {
      await page.focus("#toggle");
      await page.keyboard.press("Enter");
      own.toggled = [await page.isHidden("#panel"), await page.getAttribute("#toggle", "aria-expanded")];
      await look("without the panel");
    }
  }
  await browser.close();
  process.stdout.write(JSON.stringify(seen, null, 1));
})();
