// Missions: legs with arrows and numbers, photographs and their footprints, fence, estimates.
"use strict";

const MOST_MARKS = 60;

/** Panes: footprints lie above the raster, legs above regions, which are clicked through both. */
function missionPanes(map) {
  for (const [name, zIndex] of [["footprints", 430], ["missions", 450]]) {
    Object.assign(map.createPane(name).style, {zIndex, pointerEvents: "none"});
  }
}

/** Show a mission; returns a function that removes it. */
function addMission(page, mission) {
  const {map, layers, panel} = page, above = flat("missions");
  const group = L.featureGroup().addTo(map), safe = make("span", {textContent: mission.name}).innerHTML;
  layers.addOverlay(group, `Mission ${safe}`);
  const section = make("section", {}, make("h2", {textContent: `Mission ${mission.name}`}),
    make("p", {textContent: mission.estimate}), ...footprints(map, mission),
    ...mission.notes.map((note) => make("p", {className: "warning", textContent: note})));
  panel.append(section);
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
  map.on("moveend", draw);
  draw();
  return remove;

  function remove() {
    map.off("moveend", draw);
    section.querySelectorAll("input.footprints:checked").forEach((box) => box.click());
    layers.removeLayer(group);
    group.remove();
    section.remove();
  }

  function photographed(feature) {
    L.geoJSON(feature, {...above, style: {color: COLORS.flight, weight: 11, opacity: 0.45}}).addTo(group);
  }

  function label(at, text, className) {
    const icon = L.divIcon({className, html: make("span", {textContent: text}), iconSize: [22, 18]});
    return L.marker(at, {icon, keyboard: false});
  }

  /** Numbers and arrows in view, as many as have room; of very many, those that are further apart. */
  function draw() {
    for (let room = 24; !drawn(room) && room < 1000; room *= 1.4);
  }

  /** Draw marks that lie so many pixels apart; false if they are too many to be read. */
  function drawn(room) {
    marks.clearLayers();
    const taken = [], view = map.getBounds().pad(0.2);
    const place = (at, marker) => {
      if (!view.contains(at)) return;
      const point = map.latLngToLayerPoint(at);
      if (taken.some((other) => other.distanceTo(point) < room)) return;
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
    return taken.length <= MOST_MARKS;
  }
}

function fenceStyle(inclusion) {
  return {color: inclusion ? COLORS.stay : "#000000", weight: 3, dashArray: "8 6", fillOpacity: inclusion ? 0 : 0.25};
}

function flat(pane) {
  return {pane, renderer: L.canvas({pane}), interactive: false};
}

/** A tick box that shows the ground which each photograph shows, or why that is not known. */
function footprints(map, mission) {
  if (!mission.footprints.length) return mission.unseen ? [make("p", {textContent: mission.unseen})] : [];
  const style = {...flat("footprints"), color: COLORS.shots, weight: 1, fillOpacity: 0.06};
  const layer = L.polygon(mission.footprints.map((ring) => [ring.map(([lon, lat]) => [lat, lon])]), style);
  const box = make("input", {type: "checkbox", className: "footprints"});
  box.onchange = () => (box.checked ? layer.addTo(map) : layer.remove());
  return [make("label", {className: "tick"}, box, `\u00a0Footprints of ${mission.footprints.length} photographs`)];
}
