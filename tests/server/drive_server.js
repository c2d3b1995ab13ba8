// Use the page of `uavseg serve` in Chromium from opening it to a downloaded mission, and print what was seen as JSON.
// Arguments: its address, a folder for screenshots and files, the browser.
"use strict";

const {chromium} = require("playwright-core");
const [, , url, folder, executablePath] = process.argv;

(async () => {
  const browser = await chromium.launch({executablePath, args: ["--no-sandbox", "--disable-gpu"]});
  const seen = {others: [], errors: [], tiles: 0};
  const context = await browser.newContext({acceptDownloads: true, viewport: {width: 1200, height: 800}});
  const page = await context.newPage();
  page.on("request", (request) => {
    if (!/^(data|blob):/.test(request.url()) && !request.url().startsWith(url)) seen.others.push(request.url());
  });
  page.on("response", (response) => { seen.tiles += response.status() === 200 && response.url().includes("/tiles/"); });
  page.on("pageerror", (error) => seen.errors.push(String(error)));
  page.on("console", (message) => message.type() === "error" && seen.errors.push(message.text()));

  async function clickMap(share) {
    const box = await page.locator("#map").boundingBox();
    await page.mouse.click(box.x + share[0] * box.width, box.y + share[1] * box.height);
    await page.waitForTimeout(400); // apart from a double click
  }
  async function settled() {
    await page.waitForFunction(() => !document.getElementById("exact").disabled, null, {timeout: 60000});
  }
  async function save(name) {
    const [file] = await Promise.all([page.waitForEvent("download"), page.click(`a[data-file="${name}"]`)]);
    await file.saveAs(`${folder}/${name}`);
  }

  await page.goto(url);
  await page.waitForSelector("body[data-ready]");
  await page.fill("#low-number", "0.55");
  await page.press("#low-number", "Tab");
  await page.fill("#min-area", "500");
  await page.click("#exact");
  await settled();
  seen.status = await page.innerText("#job-status");
  await save("regions.gpkg");
  await page.waitForTimeout(500);
  await page.screenshot({path: `${folder}/served_regions.png`});

  await page.click("#home");
  await clickMap([0.47, 0.62]);
  seen.home = await page.innerText("#home");
  await page.click("#zone");
  for (const corner of [[0.38, 0.32], [0.5, 0.32], [0.44, 0.5], [0.38, 0.32]]) await clickMap(corner);
  seen.zone = await page.innerText("#zone");
  await page.selectOption("#camera", "DJI Mavic 3");
  await page.fill("#altitude", "60");
  await page.click("#plan");
  await page.waitForSelector("a[data-file='mission.plan']", {timeout: 60000});
  await settled();
  await save("mission.plan");
  await page.locator("input.footprints").waitFor();
  await page.locator("#plan").scrollIntoViewIfNeeded();
  await page.waitForTimeout(500);
  await page.screenshot({path: `${folder}/served_mission.png`});

  await page.click("#like");
  await clickMap([0.78, 0.5]);
  await clickMap([0.81, 0.5]);
  await settled();
  seen.like = [await page.innerText("#job-status"), await page.locator("[data-download='exact.geojson']").locator("..").innerText()];
  seen.question = await page.isVisible("#question");
  if (seen.question) {
    const before = await page.innerText("#job-status");
    const asked = page.waitForRequest((request) => request.url().endsWith("jobs/match"));
    await page.click("#unwanted");
    seen.answer = JSON.parse((await asked).postData());
    await settled();
    seen.answered = [before, await page.innerText("#job-status")];
  }
  await page.fill("#altitude", "-5");
  await page.click("#plan");
  await settled();
  seen.refused = await page.innerText("#job-status");
  await browser.close();
  process.stdout.write(JSON.stringify(seen));
})();
