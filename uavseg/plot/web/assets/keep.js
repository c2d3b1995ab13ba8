// Keeps a page of `uavseg map --installable` that came from a web server, for visits without a network.
"use strict";

const PAGE = "$page", NAME = "uavseg $page", MARK = '<link rel="manifest" href="$manifest">'; // of that page
const PATIENCE_MS = 10000;

self.oninstall = (event) => event.waitUntil(keep());
self.onactivate = (event) => event.waitUntil(self.clients.claim());
self.onfetch = (event) => {
  if (event.request.mode === "navigate") event.respondWith(newest(event.request.url));
};

async function keep() {
  await (await caches.open(NAME)).add(new Request(PAGE, {cache: "reload"}));
  await self.skipWaiting();
}

/** The page of the server, to be kept, where that answers with all of it in time; else the one that is kept. */
async function newest(url) {
  const cache = await caches.open(NAME);
  try {
    const answer = await fetch(url, {cache: "no-cache", signal: AbortSignal.timeout(PATIENCE_MS)});
    const {status, redirected} = answer, headers = new Headers(answer.headers), text = await answer.text();
    headers.delete("Content-Encoding"); // the text is decoded
    if (answer.ok && text.includes(MARK)) await cache.put(PAGE, new Response(text, {headers}));
    if (!redirected && status < 500) return new Response(text, {status, headers});
  } catch (error) {
    console.info(`the server does not answer: ${error.message}`);
  }
  return marked(await cache.match(PAGE));
}

/** The kept page, which says so. */
async function marked(answer) {
  if (!answer) return Response.error();
  const time = Date.parse(answer.headers.get("date")) || 0, text = await answer.text();
  const page = text.replace("<html ", `<html data-kept="${time}" `);
  return new Response(page, {headers: {"Content-Type": "text/html; charset=utf-8"}});
}
