// What the page of `uavseg serve` has more: tiles, exact regions, regions like a sample, missions.
"use strict";

function addServed(page) {
  const {map, panel, data} = page, own = {job: null, home: null, zones: []};
  if (data.server.tiles) {
    const [west, south, east, north] = data.image.bounds, bounds = [[south, west], [north, east]];
    const tiles = L.tileLayer("tiles/{z}/{x}/{y}", {maxZoom: 26, bounds, className: "tiles"}).addTo(map);
    page.layers.addOverlay(tiles, "Raster, full resolution");
  }
  const status = make("p", {id: "job-status"}), drawing = new Drawing(map, status);
  status.setAttribute("role", "status");
  const bar = make("progress", {max: 1, value: 0, hidden: true}), stop = button("Stop", "stop");
  stop.hidden = true;
  const area = field("Smallest region, m\u00b2", "min-area", 0);
  const exact = button("Exact regions of the range", "exact"), like = button("Regions like a sample", "like");
  panel.append(make("section", {}, make("h2", {textContent: "Find regions"}), ...ends(data), area.label, exact, " ", like, status, bar, " ", stop));
  const wanted = button("Wanted", "wanted"), unwanted = button("Not wanted", "unwanted"), place = L.layerGroup().addTo(map);
  const question = make("p", {id: "question", hidden: true}, "What is in the circle would help most: ", wanted, " ", unwanted);
  status.before(question);
  const list = new RegionList(page, "Exact regions", COLORS.file, "exact.geojson");
  list.layer.addTo(map);
  list.show({type: "FeatureCollection", features: []});
  const files = make("p");
  list.controls.append(files);

  exact.onclick = () => find("extract", {
    low: Number(document.getElementById("low-number").value), high: Number(document.getElementById("high-number").value),
  });
  like.onclick = () => drawing.disc("Click the centre of the sample, then its edge.", (center, edge) => {
    find("match", {center: [center.lat, center.lng], edge: [edge.lat, edge.lng], like: [], unlike: []});
  });

  if (data.server.footprints) {
    const box = footprints(map, {footprints: data.server.footprints}), gaps = button("Gaps of the photographs", "gaps");
    gaps.onclick = () => find("gaps", {});
    panel.append(make("section", {}, make("h2", {textContent: "After the flight"}), ...box, ...(data.server.gaps ? [gaps] : [])));
  }

  async function find(kind, body) {
    const report = await run(kind, kind === "gaps" ? body : {...body, min_area: area.value() || null});
    if (!report) return;
    about(body, report.answer.ask || []);
    own.job = report.job;
    list.show(report.answer.regions);
    files.replaceChildren(...links(report));
    status.replaceChildren(...report.answer.warnings.map((text) => make("span", {className: "warning", textContent: text})));
  }

  /** Show the place whose answer would help most, and find regions again with the answer. */
  function about(body, asked) {
    place.clearLayers();
    question.hidden = !asked.length;
    for (const {disc, ring} of asked) {
      const shape = L.polygon(ring, {color: "#ffffff", weight: 3, rim: 1.5, fill: false, interactive: false});
      place.addLayer(shape);
      map.fitBounds(shape.getBounds().pad(4));
      wanted.onclick = () => find("match", {...body, like: [...body.like, disc]});
      unwanted.onclick = () => find("match", {...body, unlike: [...body.unlike, disc]});
    }
  }

  /** Run a job with its progress shown; nothing where it failed, which is said. */
  async function run(kind, body) {
    const buttons = [exact, like, plan, wanted, unwanted];
    buttons.forEach((one) => { one.disabled = true; });
    status.textContent = "Running";
    bar.hidden = stop.hidden = false;
    try {
      const report = await runJob(kind, body, ({job, done, total}) => {
        bar.value = total ? done / total : 0;
        stop.onclick = () => ask(`jobs/${job}/stop`, {});
      });
      status.textContent = "";
      return report;
    } catch (error) {
      status.textContent = error.message;
      status.scrollIntoView({block: "nearest"});
      return null;
    } finally {
      bar.hidden = stop.hidden = true;
      buttons.forEach((one) => { one.disabled = false; });
    }
  }

  // Missions.

  const altitude = field("Height above home, m", "altitude", 60), speed = field("Speed, m/s", "speed", 5);
  const spacing = field("Distance of lines, m (with no camera)", "spacing", 20);
  const camera = choice("Camera", "camera", ["", ...data.server.cameras]);
  const pattern = choice("Pattern", "pattern", ["survey", "visit", "perimeter"]);
  const edge = make("input", {type: "checkbox", id: "allow-edge"});
  const home = button("Home: auto", "home"), zone = button("Keep-out zone", "zone"), clear = button("No zones", "clear");
  const plan = button("Plan mission", "plan"), result = make("div"), drawn = L.layerGroup().addTo(map);
  panel.append(make("section", {}, make("h2", {textContent: "Plan a mission"}),
    make("p", {textContent: "Over the exact regions that are chosen."}), altitude.label, speed.label, pattern.label,
    camera.label, spacing.label, make("label", {className: "tick"}, edge, "\u00a0Regions at the edge of the raster too"), home, " ", zone, " ", clear, " ", plan, result));
  const shown = [];

  home.onclick = () => drawing.point("Click the place from which the vehicle starts.", (at) => { own.home = at; mark(); });
  zone.onclick = () => drawing.polygon("Click the corners of a zone; the first corner again, or a double click, ends it.", (corners) => {
    own.zones.push(corners);
    mark();
  });
  clear.onclick = () => { own.zones = []; mark(); };

  function mark() {
    drawn.clearLayers();
    for (const corners of own.zones) {
      drawn.addLayer(L.polygon(corners, {color: "#000000", weight: 3, fillOpacity: 0.35, interactive: false}));
    }
    if (own.home) {
      drawn.addLayer(L.circleMarker(own.home, {radius: 9, color: "#ffffff", fillColor: "#9c0014", fillOpacity: 1, interactive: false}));
    }
    home.textContent = own.home ? `Home: ${own.home.lat.toFixed(6)}, ${own.home.lng.toFixed(6)}` : "Home: auto";
    zone.textContent = own.zones.length ? `Keep-out zones: ${own.zones.length}` : "Keep-out zone";
  }

  plan.onclick = async () => {
    const chosen = list.chosen().features.map((feature) => feature.properties.id);
    if (!own.job || !chosen.length) {
      status.textContent = "First find exact regions, and choose one.";
      status.scrollIntoView({block: "nearest"});
      return;
    }
    const way = camera.value() || pattern.value() !== "survey" ? {} : {spacing: spacing.value()};
    const report = await run("plan", {
      job: own.job, ids: chosen, home: own.home ? [own.home.lat, own.home.lng] : "auto", altitude: altitude.value(),
      speed: speed.value(), pattern: pattern.value(), camera: camera.value() || null, allow_edge: edge.checked, ...way,
      zones: own.zones.map((corners) => corners.map(({lat, lng}) => [lat, lng])),
    });
    if (!report) return;
    shown.splice(0).forEach((remove) => remove());
    result.replaceChildren(...links(report), ...report.answer.warnings.map((text) => make("p", {className: "warning", textContent: text})));
    for (const mission of report.answer.missions) shown.push(addMission(page, {...mission, notes: []}));
  };
}

/** Fields for the range, where this browser has no slider. */
function ends({range}) {
  if (document.getElementById("low-number")) return [];
  return ["Low", "High"].map((name, n) => field(`${name} end of v`, `${name.toLowerCase()}-number`, range[n] / Blocks.STEPS).label);
}

function links(report) {
  return report.files.map((name) => {
    const link = make("a", {href: `jobs/${report.job}/files/${name}`, download: name, textContent: `Download ${name}`, className: "file"});
    link.dataset.file = name;
    return link;
  });
}

function button(text, id) {
  return make("button", {type: "button", textContent: text, id});
}

function field(text, id, value) {
  const input = make("input", {type: "number", id, value, min: 0, step: "any"});
  return {label: make("label", {className: "field"}, text, input), value: () => Number(input.value)};
}

function choice(text, id, names) {
  const select = make("select", {id}, ...names.map((name) => make("option", {value: name, textContent: name || "none"})));
  return {label: make("label", {className: "field"}, text, select), value: () => select.value};
}
