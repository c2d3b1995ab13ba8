// Regions: a layer, a list with tick boxes, a download.
"use strict";

const PART = 50; // rows that are made together, when the list is scrolled near them
const ROW_PX = 45;
const BUTTONS_PX = 112; // the height of the buttons over the map, below which popups lie

class RegionList {
  /** `page` has the map, its layer switch and the panel. */
  constructor(page, title, color, fileName, shown = true) {
    Object.assign(this, {page, color});
    this.summary = make("p");
    this.items = make("div", {className: "list"});
    const near = {rootMargin: "300px"};
    near.root = this.items;
    this.parts = new IntersectionObserver((seen) => seen.forEach((one) => this.fill(one)), near);
    const all = make("button", {type: "button", textContent: "All"});
    const none = make("button", {type: "button", textContent: "None"});
    const save = make("button", {type: "button", textContent: "Download chosen"});
    save.dataset.download = fileName;
    all.onclick = () => this.choose(true);
    none.onclick = () => this.choose(false);
    save.onclick = () => {
      this.settle();
      download(this.chosen(), fileName);
    };
    this.controls = make("div", {}, make("h2", {textContent: title}));
    page.panel.append(make("section", {}, this.controls, this.summary, all, " ", none, " ", save, this.items));
    this.layer = L.geoJSON(null, {
      style: (feature) => this.style(feature),
      onEachFeature: (feature, shape) => this.bind(feature, shape),
    });
    if (shown) this.layer.addTo(page.map);
    page.layers.addOverlay(this.layer, make("span", {textContent: title}).innerHTML);
  }

  /** Finish what is under way, before regions are downloaded. */
  settle() {}

  style(feature) {
    const on = this.ticked.has(feature);
    return {color: on ? this.color : COLORS.off, weight: on ? 3 : 2, rim: 1.5, fillOpacity: on ? 0.3 : 0.05};
  }

  bind(feature, shape) {
    this.shapes.set(feature, shape);
    shape.bindPopup(() => this.popup(feature), {maxWidth: 300, autoPanPaddingTopLeft: [20, BUTTONS_PX], autoPanPaddingBottomRight: [20, 20]});
  }

  popup(feature) {
    const table = make("table");
    for (const [key, value] of Object.entries(feature.properties)) {
      const [name, unit] = measureOf(key);
      const text = unit && typeof value === "number" ? `${Number(value.toPrecision(unit === "\u00b0" ? 9 : 6))}${unit}` : textOf(value);
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
    this.begin(collection);
    this.layer.addData(collection);
    this.list();
  }

  /** As `show`, on the map, while the page answers; where `goesOn` says so it ends early, and gives false. */
  async showInTurns(collection, goesOn) {
    const canvas = this.page.map.options.renderer;
    this.begin(collection);
    canvas.hold(true);
    try {
      this.layer.addTo(this.page.map);
      if (!await inTurns(collection.features, (feature) => this.layer.addData(feature), goesOn)) return false;
    } finally {
      canvas.hold(false);
    }
    this.list();
    return true;
  }

  begin(collection) {
    this.collection = collection;
    this.ticked = new Set(collection.features);
    this.shapes = new Map();
    this.layer.clearLayers();
  }

  /** Show the list from its top: parts of it are empty, and as high as their rows, until they are near. */
  list() {
    const {features} = this.collection;
    this.boxes = new Map();
    this.parts.disconnect();
    this.rows = new Map();
    for (let first = 0; first < features.length; first += PART) {
      const rows = features.slice(first, first + PART), part = make("ul");
      part.style.minHeight = `${rows.length * ROW_PX}px`;
      this.rows.set(part, rows);
    }
    this.items.replaceChildren(...this.rows.keys());
    for (const part of this.rows.keys()) this.parts.observe(part);
    this.describe();
  }

  /** Make the rows of a part that comes near, and remove those of one that is far and not in use. */
  fill({target, isIntersecting}) {
    const rows = this.rows.get(target) ?? [];
    if (isIntersecting && !target.children.length) target.append(...rows.map((feature) => this.row(feature)));
    if (isIntersecting || !target.children.length || target.contains(document.activeElement)) return;
    target.style.minHeight = `${target.offsetHeight}px`;
    target.replaceChildren();
    for (const feature of rows) this.boxes.delete(feature);
  }

  row(feature) {
    const box = this.tickBox(feature);
    this.boxes.set(feature, box);
    const go = make("button", {type: "button", textContent: `${nameOf(feature)}: ${areaOf(feature)}`});
    go.onclick = () => {
      this.layer.addTo(this.page.map);
      const shape = this.shapes.get(feature);
      // Without animation: a popup that opens while the map moves is not brought into view.
      this.page.map.fitBounds(shape.getBounds(), {maxZoom: 20, padding: [40, 40], animate: false});
      shape.openPopup();
      shape.getPopup().getElement().querySelector(".leaflet-popup-close-button").focus({preventScroll: true});
      shape.once("popupclose", ({popup}) => {
        if (popup.getElement().contains(document.activeElement)) go.focus({preventScroll: true});
      });
    };
    return make("li", {}, make("label", {}, box), go);
  }

  describe() {
    this.summary.textContent = `${this.ticked.size} of ${this.collection.features.length} chosen`;
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

function textOf(value) {
  if (value === null) return "";
  if (typeof value === "number") return String(Number(value.toPrecision(9)));
  return typeof value === "object" ? JSON.stringify(value) : String(value);
}

/** The name of a measure and its unit, of the name of a column such as area_m2. */
function measureOf(key) {
  const units = {_m2: " m\u00b2", _m: " m", _s: " s", _deg: "\u00b0"};
  const end = Object.keys(units).find((one) => key.endsWith(one));
  if (end) return [key.slice(0, -end.length), units[end]];
  return ["lon", "lat"].includes(key) ? [key, "\u00b0"] : [key, ""];
}

function nameOf(feature) {
  const {id, class: kind} = feature.properties;
  return [id ?? feature.id ?? "", kind ?? ""].join(" ").trim() || "region";
}

function areaOf(feature) {
  const area = feature.properties.area_m2;
  return typeof area === "number" ? areaText(area) : "show";
}

function areaText(area) {
  return area < 1e4 ? `${area.toFixed(0)} m\u00b2` : `${(area / 1e4).toFixed(2)} ha`;
}
