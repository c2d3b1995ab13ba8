// The page of `uavseg map` and `uavseg serve`: read this first.
"use strict";

(async () => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const panel = document.getElementById("panel"), old = typeof DecompressionStream === "undefined";
  const packed = data.regions?.packed;
  if (packed) data.regions = old ? null : JSON.parse(new TextDecoder().decode(await Blocks.unpack(packed)));
  const map = L.map("map", {maxZoom: 26, zoomSnap: 0.25, renderer: new RimCanvas({padding: 0.3}), attributionControl: false});
  const [west, south, east, north] = data.image.bounds;
  const bounds = L.latLngBounds([south, west], [north, east]);
  Object.assign(map.createPane("picture").style, {zIndex: 150, pointerEvents: "none"}); // below tiles
  const raster = L.imageOverlay(data.image.url, bounds, {alt: data.title, pane: "picture"}).addTo(map);
  const layers = L.control.layers({}, {}, {position: "topright"}).addTo(map);
  const page = {data, map, layers, panel};
  layers.addOverlay(raster, "Raster");
  L.control.scale({maxWidth: 160}).addTo(map);
  map.fitBounds(bounds);
  // Until the page is used it shows the whole raster: a frame gets its size late, in several steps.
  const sized = new ResizeObserver(() => map.invalidateSize({animate: false}).fitBounds(bounds, {animate: false}));
  sized.observe(map.getContainer());
  for (const used of ["pointerdown", "keydown"]) addEventListener(used, () => sized.disconnect(), {once: true});
  document.getElementById("title").textContent = data.title;
  document.getElementById("about").textContent = data.about;
  for (const note of data.notes) panel.append(make("p", {className: "warning", textContent: note}));

  const {kept} = document.documentElement.dataset; // of a page that no server has sent now, see keep.js
  if (kept) {
    const date = Number(kept) ? `on ${new Date(Number(kept)).toLocaleString()}` : "earlier";
    panel.append(make("p", {className: "warning", textContent: `Its server does not answer: the page as it was loaded ${date}.`}));
  }
  if (data.keeper && location.protocol !== "file:") navigator.serviceWorker?.register(data.keeper, {scope: location.pathname});

  const toggle = document.getElementById("toggle");
  toggle.onclick = () => {
    toggle.ariaExpanded = String(!document.body.classList.toggle("closed"));
    map.invalidateSize();
  };
  addEventListener("keydown", ({key}) => { if (key === "Escape") map.closePopup(); }); // Leaflet hears it on the map alone
  // Leaflet's buttons are links to "#", which Space does not press.
  map.getContainer().addEventListener("keydown", (event) => {
    if (event.key !== " " || !event.target.matches("a[role='button']")) return;
    event.preventDefault();
    event.target.click();
  });
  // A link to "#close" is a link to a place of the page, which is not there.
  map.on("popupopen", ({popup}) => popup.getElement().querySelector("a[href='#close']")?.setAttribute("href", "#"));
  addPosition(page);
  missionPanes(map);
  let ranged = null; // the slider is above lists, which may be long
  const missing = [...packed ? ["so many regions"] : [], ...data.cells ? ["the range slider"] : []];
  if (old && missing.length) {
    panel.append(make("p", {className: "warning", textContent: `This browser is too old for ${missing.join(" and ")}.`}));
  } else if (data.cells) {
    ranged = new RegionList(page, "Regions of a range", COLORS.range, "range.geojson", !data.regions);
  }
  if (data.regions) new RegionList(page, "Regions", COLORS.file, "chosen.geojson").show(data.regions);
  if (ranged) await addSlider(page, ranged);
  if (data.server?.areas) addTiledSlider(page);
  if (data.server) addServed(page);
  for (const mission of data.missions) addMission(page, mission);
  document.body.dataset.ready = "true";
})();
