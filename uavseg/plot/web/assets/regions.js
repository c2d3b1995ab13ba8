// Regions: a layer, a list with tick boxes, a download.
"use strict";

const LISTED = 100;

class RegionList {
  /** `page` has the map, its layer switch and the panel. */
  constructor(page, title, color, fileName, shown = true) {
    Object.assign(this, {page, color});
    this.summary = make("p");
    this.items = make("ul", {className: "list"});
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
    shape.bindPopup(() => this.popup(feature), {maxWidth: 300, autoPanPadding: [20, 20]});
  }

  popup(feature) {
    const table = make("table");
    for (const [name, value] of Object.entries(feature.properties)) {
      table.append(make("tr", {}, make("th", {textContent: name}), make("td", {textContent: textOf(value)})));
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

  list() {
    this.boxes = new Map();
    const listed = this.collection.features.slice(0, LISTED);
    this.items.replaceChildren(...listed.map((feature) => {
      const box = this.tickBox(feature);
      this.boxes.set(feature, box);
      const go = make("button", {type: "button", textContent: `${nameOf(feature)}: ${areaOf(feature)}`});
      go.onclick = () => {
        this.layer.addTo(this.page.map);
        this.page.map.fitBounds(this.shapes.get(feature).getBounds(), {maxZoom: 20, padding: [40, 40]});
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

function textOf(value) {
  if (value === null) return "";
  if (typeof value === "number") return String(Number(value.toPrecision(9)));
  return typeof value === "object" ? JSON.stringify(value) : String(value);
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
