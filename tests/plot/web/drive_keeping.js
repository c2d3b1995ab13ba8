// Visit installable pages on a web server, and again without it, on two sizes; print what was seen as JSON.
// Arguments: the folder of two pages, one with a newer first.html, the browser; playwright-core is found through
// NODE_PATH.
"use strict";

const fs = require("node:fs"), http = require("node:http"), os = require("node:os"), path = require("node:path");
const {chromium} = require("playwright-core");
const [, , folder, newer, executablePath] = process.argv;
const TYPES = {".html": "text/html", ".js": "text/javascript", ".webmanifest": "application/manifest+json"};
const SIZES = {phone: {width: 390, height: 844}, desktop: {width: 1280, height: 800}};

let state = "as it was"; // or "failing", "replaced", or "foreign": another page in its place, as of a hotel
const server = http.createServer((request, response) => {
  const name = decodeURIComponent(path.basename(new URL(request.url, "http://a").pathname));
  const file = [state === "replaced" ? newer : folder, folder].map((place) => path.join(place, name)).find(fs.existsSync);
  if (state === "failing" || !file) return response.writeHead(state === "failing" ? 503 : 404).end();
  response.writeHead(200, {"Content-Type": TYPES[path.extname(name)]});
  return response.end(state === "foreign" ? "<title>sign in</title><body data-ready>" : fs.readFileSync(file));
});
const listen = (port) => new Promise((done) => server.listen(port, "127.0.0.1", () => done(server.address().port)));
const close = () => new Promise((done) => { server.close(done); server.closeAllConnections(); });

async function visit(port, size) {
  const user = fs.mkdtempSync(path.join(os.tmpdir(), "keeping-"));
  const context = await chromium.launchPersistentContext(user, {
    executablePath, args: ["--no-sandbox", "--disable-gpu"], viewport: size, hasTouch: size.width < 500,
  });
  const page = context.pages()[0] ?? await context.newPage(), seen = {errors: []};
  page.on("pageerror", (error) => seen.errors.push(String(error)));
  const look = async (name) => {
    await page.goto(`http://127.0.0.1:${port}/${name}`);
    await page.waitForSelector("body[data-ready]");
    await page.evaluate(() => navigator.serviceWorker.ready);
    await page.waitForFunction(() => navigator.serviceWorker.controller);
    return page.evaluate(() => ({
      title: document.title,
      slider: !!document.getElementById("low-slider"),
      regions: document.querySelector("#panel .found")?.textContent,
      notes: [...document.querySelectorAll("#panel .warning")].map((one) => one.textContent),
    }));
  };
  const first = "first.html", second = "second%20map's.html";
  seen.first = await look(first);
  const session = await context.newCDPSession(page);
  seen.installability = (await session.send("Page.getInstallabilityErrors")).installabilityErrors.map((one) => one.errorId);
  seen.manifest = (await session.send("Page.getAppManifest")).errors;
  seen.second = await look(second);
  await close();
  seen.offline = [await look(first), await look(second), await look(`${first}?again`)];
  await listen(port);
  state = "failing";
  seen.failing = await look(first);
  state = "replaced";
  seen.replaced = await look(first);
  await close();
  seen.kept = await look(first);
  await listen(port);
  state = "foreign";
  seen.foreign = (await look(first)).title;
  await close();
  seen.after = await look(first);
  seen.files = await page.evaluate(async () => {
    const kept = await Promise.all((await caches.keys()).map((name) => caches.open(name)));
    return (await Promise.all(kept.map((cache) => cache.keys()))).map((keys) => keys.length);
  });
  state = "as it was";
  await listen(port);
  await context.close();
  fs.rmSync(user, {recursive: true, force: true});
  return seen;
}

(async () => {
  const port = await listen(0), seen = {};
  for (const [name, size] of Object.entries(SIZES)) seen[name] = await visit(port, size);
  await close();
  console.log(JSON.stringify(seen));
})().catch((error) => { console.error(error); process.exit(1); });
