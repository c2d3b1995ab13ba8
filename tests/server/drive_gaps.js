// Use the page of `uavseg serve --photos --mission` from the gaps of photographs to the next flight, and print what was seen.
// Arguments: its address, a folder for screenshots and files, the browser.
"use strict";

const {chromium} = require("playwright-core");
const [, , url, folder, executablePath] = process.argv;

(async () => {
  const browser = await chromium.launch({executablePath, args: ["--no-sandbox", "--disable-gpu"]});
  const seen = {errors: []};
  const context = await browser.newContext({acceptDownloads: true, viewport: {width: 1200, height: 900}});
  const page = await context.newPage();
  page.on("pageerror", (error) => seen.errors.push(String(error)));
  page.on("console", (message) => message.type() === "error" && seen.errors.push(message.text()));
  await page.goto(url);
  await page.waitForSelector("body[data-ready]");
  const flown = page.locator("section", {has: page.locator("#gaps")});
  seen.footprints = await flown.innerText();
  await flown.locator("input.footprints").check();
  await page.click("#gaps");
  await page.waitForFunction(() => !document.getElementById("exact").disabled, null, {timeout: 60000});
  seen.status = await page.innerText("#job-status");
  await page.waitForTimeout(500);
  await page.screenshot({path: `${folder}/served_gaps.png`});
  await page.selectOption("#camera", "DJI Mavic 3");
  await page.check("#allow-edge");
  await page.click("#plan");
  await page.waitForSelector("a[data-file='mission.plan']", {timeout: 60000});
  const [file] = await Promise.all([page.waitForEvent("download"), page.click("a[data-file='mission.plan']")]);
  await file.saveAs(`${folder}/next.plan`);
  await page.waitForTimeout(500);
  await page.screenshot({path: `${folder}/served_next.png`});
  console.log(JSON.stringify(seen));
  await browser.close();
})().catch((error) => { console.error(error); process.exit(1); });
