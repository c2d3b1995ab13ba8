// The page of `uavseg map`. Content of files becomes text nodes only, never markup.
"use strict";

(async () => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const panel = document.getElementById("panel");
  const COLORS = {file: "#ff8c1a", range: "#00a5e0", off: "#777777", flight: "#c4001a", stay: "#007a33"};
  const LISTED = 100;

  function make(name, values = {}, ...children) {
    const element = Object.assign(document.createElement(name), values);
    element.append(...children);
    return element;
  }

  function download(collection, name) {
    const blob = new Blob([JSON.stringify(collection)], {type: "application/geo+json"});
    const link = make("a", {href: URL.createObjectURL(blob), download: name});
    document.body.append(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  // The map and the raster.

  const map = L.map("map", {maxZoom: 26, zoomSnap: 0.25, preferCanvas: true, attributionControl: false});
  const [west, south, east, north] = data.image.bounds;
  const bounds = L.latLngBounds([south, west], [north, east]);
  const raster = L.imageOverlay(data.image.url, bounds, {alt: data.title}).addTo(map);
  const layers = L.control.layers({}, {}, {position: "topright"}).addTo(map);
  layers.addOverlay(raster, "Raster");
  L.control.scale({maxWidth: 160}).addTo(map);
  const fit = () => map.fitBounds(bounds);
  fit();
  map.on("resize", fit);  // until the page is used: a frame gets its size late
  for (const used of ["pointerdown", "keydown"]) addEventListener(used, () => map.off("resize", fit), {once: true});
  document.getElementById("title").textContent = data.title;
  document.getElementById("about").textContent = data.about;
  for (const note of data.notes) panel.append(make("p", {className: "warning", textContent: note}));

  // Regions: a layer, a list with tick boxes, a download.

  class RegionList {
    constructor(title, color, fileName, shown = true) {
      this.color = color;
      this.summary = make("p");
      this.items = make("ul", {className: "list"});
      const all = make("button", {type: "button", textContent: "All"});
      const none = make("button", {type: "button", textContent: "None"});
      const save = make("button", {type: "button", textContent: "Download chosen"});
      save.dataset.download = fileName;
      all.onclick = () => this.choose(true);
      none.onclick = () => this.choose(false);
      save.onclick = () => download(this.chosen(), fileName);
      this.controls = make("div", {}, make("h2", {textContent: title}));
      panel.append(make("section", {}, this.controls, this.summary, all, " ", none, " ", save, this.items));
      this.layer = L.geoJSON(null, {
        style: (feature) => this.style(feature),
        onEachFeature: (feature, shape) => this.bind(feature, shape),
      });
      if (shown) this.layer.addTo(map);
      layers.addOverlay(this.layer, make("span", {textContent: title}).innerHTML);
    }

    style(feature) {
      const on = this.ticked.has(feature);
      return {color: on ? this.color : COLORS.off, weight: on ? 3 : 2, fillOpacity: on ? 0.3 : 0.05};
    }

    bind(feature, shape) {
      this.shapes.set(feature, shape);
      shape.bindPopup(() => this.popup(feature), {maxWidth: 300, autoPanPadding: [20, 20]});
    }

    popup(feature) {
      const table = make("table");
      for (const [name, value] of Object.entries(feature.properties)) {
        const text = value === null ? "" : typeof value === "object" ? JSON.stringify(value) : String(value);
        table.append(make("tr", {}, make("th", {textContent: name}), make("td", {textContent: text})));
      }
      const box = this.tickBox(feature);
      return make("div", {className: "popup"}, table, make("label", {}, box, "\u00a0chosen"));
    }

    tickBox(feature) {
      const box = make("input", {type: "checkbox", checked: this.ticked.has(feature)});
      box.ariaLabel = `Choose region ${nameOf(feature)}`;
      box.onchange = () => {
        if (box.checked) this.ticked.add(feature);
        else this.ticked.delete(feature);
        this.shapes.get(feature).setStyle(this.style(feature));
        this.describe();
        const listed = this.boxes.get(feature);
        if (listed) listed.checked = box.checked;
      };
      return box;
    }

    show(collection) {
      this.collection = collection;
      this.ticked = new Set(collection.features);
      this.shapes = new Map();
      this.layer.clearLayers();
      this.layer.addData(collection);
      this.list();
    }

    list() {
      this.boxes = new Map();
      const listed = this.collection.features.slice(0, LISTED);
      this.items.replaceChildren(...listed.map((feature) => {
        const box = this.tickBox(feature);
        this.boxes.set(feature, box);
        const go = make("button", {type: "button", textContent: `${nameOf(feature)}: ${areaOf(feature)}`});
        go.onclick = () => {
          this.layer.addTo(map);
          map.fitBounds(this.shapes.get(feature).getBounds(), {maxZoom: 20, padding: [40, 40]});
          this.shapes.get(feature).openPopup();
        };
        return make("li", {}, make("label", {}, box), go);
      }));
      this.describe();
    }

    describe() {
      const {features} = this.collection, more = features.length - LISTED;
      const listed = more > 0 ? `; the first ${LISTED} are listed, choose others on the map` : "";
      this.summary.textContent = `${this.ticked.size} of ${features.length} chosen${listed}`;
    }

    choose(all) {
      this.ticked = new Set(all ? this.collection.features : []);
      this.layer.setStyle((feature) => this.style(feature));
      this.list();
    }

    chosen() {
      return {...this.collection, features: this.collection.features.filter((one) => this.ticked.has(one))};
    }
  }

  function nameOf(feature) {
    const {id, class: kind} = feature.properties;
    return [id ?? feature.id ?? "", kind ?? ""].join(" ").trim() || "region";
  }

  function areaOf(feature) {
    const area = feature.properties.area_m2;
    if (typeof area !== "number") return "show";
    return area < 1e4 ? `${area.toFixed(0)} m\u00b2` : `${(area / 1e4).toFixed(2)} ha`;
  }

  // A slider that extracts regions of whole cells.

  async function addSlider() {
    const grid = await Blocks.decode(data.cells);
    const list = new RegionList("Regions of a range", COLORS.range, "range.geojson", !data.regions);
    const [low, high] = data.range.map((value, n) => handle(["Low", "High"][n], value));
    let waiting = 0;
    const extract = () => {
      waiting = 0;
      list.show(Blocks.regions(grid, low.step(), high.step()));
    };
    for (const [own, other, sign] of [[low, high, 1], [high, low, -1]]) {
      own.changed = () => {
        list.layer.addTo(map);
        own.set(Math.min(Math.max(own.step(), (1 - sign) / 2), Blocks.STEPS - (1 + sign) / 2));
        if (sign * (other.step() - own.step()) < 1) other.set(own.step() + sign);
        if (!waiting) waiting = requestAnimationFrame(extract);
      };
    }
    list.controls.append(low.element, high.element);
    extract();
  }

  function handle(name, step) {
    const slider = make("input", {type: "range", min: 0, max: Blocks.STEPS, step: 1, value: step});
    const text = make("input", {type: "number", min: 0, max: 1, step: 0.005, value: step / Blocks.STEPS});
    slider.ariaLabel = `${name} end of the range`;
    text.ariaLabel = `${name} end of the range, as a number`;
    slider.id = `${name.toLowerCase()}-slider`;
    text.id = `${name.toLowerCase()}-number`;
    const own = {
      element: make("div", {className: "slider"}, name, slider, text),
      step: () => Number(slider.value),
      set: (value) => { slider.value = value; text.value = slider.value / Blocks.STEPS; },
      changed: () => {},
    };
    slider.oninput = () => { text.value = own.step() / Blocks.STEPS; own.changed(); };
    text.onchange = () => { own.set(Math.round(Number(text.value) * Blocks.STEPS)); own.changed(); };
    return own;
  }

  // Missions are drawn above regions, which are clicked through them.

  map.createPane("missions");
  Object.assign(map.getPane("missions").style, {zIndex: 450, pointerEvents: "none"});
  const above = {pane: "missions", renderer: L.canvas({pane: "missions"}), interactive: false};

  // Missions: legs with arrows and numbers, photographs, fence, estimates.

  function addMission(mission) {
    const group = L.featureGroup().addTo(map), safe = make("span", {textContent: mission.name}).innerHTML;
    layers.addOverlay(group, `Mission ${safe}`);
    panel.append(make("section", {}, make("h2", {textContent: `Mission ${mission.name}`}),
      make("p", {textContent: mission.estimate}),
      ...mission.notes.map((note) => make("p", {className: "warning", textContent: note}))));
    for (const feature of mission.features.features) {
      const {kind, inclusion} = feature.properties;
      if (!feature.geometry) continue;
      if (kind === "fence") L.geoJSON(feature, {...above, style: fenceStyle(inclusion)}).addTo(group);
      if (kind === "photographs" && feature.geometry.type === "LineString") photographed(feature);
      if (kind === "rally") L.geoJSON(feature, {pointToLayer: (_, at) => label(at, "R", "number home")}).addTo(group);
    }
    const path = mission.path.map(([lat, lon]) => L.latLng(lat, lon));
    L.polyline(path, {...above, color: "#ffffff", weight: 5}).addTo(group);
    L.polyline(path, {...above, color: COLORS.flight, weight: 3}).addTo(group);
    const marks = L.layerGroup().addTo(group);
    map.on("zoomend", draw);
    draw();

    function photographed(feature) {
      L.geoJSON(feature, {...above, style: {color: COLORS.flight, weight: 11, opacity: 0.45}}).addTo(group);
    }

    function label(at, text, className) {
      const icon = L.divIcon({className, html: make("span", {textContent: text}), iconSize: [22, 18]});
      return L.marker(at, {icon, keyboard: false});
    }

    /** Numbers and arrows, as many as have room. */
    function draw() {
      marks.clearLayers();
      const taken = [];
      const place = (at, marker) => {
        const point = map.latLngToLayerPoint(at);
        if (taken.some((other) => other.distanceTo(point) < 24)) return;
        taken.push(point);
        marks.addLayer(marker());
      };
      place(path[0], () => label(path[0], "H", "number home").bindPopup("Home"));
      path.forEach((at, n) => {
        if (mission.numbers[n]) place(at, () => label(at, String(mission.numbers[n]), "number"));
      });
      for (let n = 1; n < path.length; n++) {
        const [from, to] = [map.latLngToLayerPoint(path[n - 1]), map.latLngToLayerPoint(path[n])];
        if (from.distanceTo(to) < 60) continue;
        const at = map.layerPointToLatLng(from.add(to).divideBy(2));
        place(at, () => {
          const head = make("span", {textContent: "\u25b6"});
          head.style.transform = `rotate(${Math.atan2(to.y - from.y, to.x - from.x)}rad)`;
          const icon = L.divIcon({className: "arrow", html: head, iconSize: [18, 18]});
          return L.marker(at, {icon, interactive: false, keyboard: false});
        });
      }
    }
  }

  function fenceStyle(inclusion) {
    return {color: inclusion ? COLORS.stay : "#000000", weight: 3, dashArray: "8 6", fillOpacity: inclusion ? 0 : 0.25};
  }

  // Position of the device.

  function addPosition() {
    if (!navigator.geolocation) return;
    const button = make("button", {type: "button", textContent: "Show my position"});
    const shown = L.layerGroup().addTo(map), status = document.getElementById("status");
    button.onclick = () => map.locate({watch: true, enableHighAccuracy: true});
    map.on("locationfound", ({latlng, accuracy}) => {
      const style = {color: "#ffffff", fillColor: "#0050ff", fillOpacity: 1, weight: 3, radius: 9};
      shown.clearLayers();
      shown.addLayer(L.circle(latlng, {radius: accuracy, color: "#0050ff", weight: 1, interactive: false}));
      shown.addLayer(L.circleMarker(latlng, {...style, interactive: false}));
      status.textContent = `Position known to ${accuracy.toFixed(0)} m`;
    });
    map.on("locationerror", () => { status.textContent = "The device does not give its position"; });
    status.before(button);
  }

  const toggle = document.getElementById("toggle");
  toggle.onclick = () => {
    toggle.ariaExpanded = String(!document.body.classList.toggle("closed"));
    map.invalidateSize();
  };
  addPosition();
  data.missions.forEach(addMission);
  if (data.regions) new RegionList("Regions", COLORS.file, "chosen.geojson").show(data.regions);
  if (data.cells) {
    if (typeof DecompressionStream === "undefined") {
      panel.append(make("p", {className: "warning", textContent: "This browser is too old for the range slider."}));
    } else {
      await addSlider();
    }
  }
  document.body.dataset.ready = "true";
})();
