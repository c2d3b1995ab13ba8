// Drawing on the map: home, keep-out zones, a sample. Each is begun with a button and ends with clicks.
"use strict";

class Drawing {
  constructor(map, status) {
    Object.assign(this, {map, status, clicked: null, corners: []});
    this.shown = L.layerGroup().addTo(map);
    map.on("click", ({latlng}) => this.clicked && this.clicked(latlng));
    map.on("dblclick", () => this.finish && this.finish());
  }

  begin(words, clicked, finish = null) {
    this.end();
    Object.assign(this, {clicked, finish});
    this.status.textContent = words;
    this.map.getContainer().classList.add("drawing");
    this.map.doubleClickZoom.disable();
    this.map.closePopup();
  }

  end() {
    Object.assign(this, {clicked: null, finish: null, corners: []});
    this.shown.clearLayers();
    this.status.textContent = "";
    this.map.getContainer().classList.remove("drawing");
    this.map.doubleClickZoom.enable();
  }

  /** One place. */
  point(words, done) {
    this.begin(words, (at) => { this.end(); done(at); });
  }

  /** Two places: a centre and another one on the edge. */
  disc(words, done) {
    this.begin(words, (at) => {
      this.corners.push(at);
      if (this.corners.length === 2) {
        const [center, edge] = this.corners;
        this.end();
        done(center, edge);
      } else {
        this.shown.addLayer(L.circleMarker(at, {radius: 6, color: "#000000", interactive: false}));
      }
    });
  }

  /** Three corners or more; a double click, or a click on the first, ends it. */
  polygon(words, done) {
    const finish = () => {
      const corners = this.corners;
      this.end();
      if (corners.length >= 3) done(corners);
    };
    this.begin(words, (at) => {
      const first = this.corners[0], near = (one) => this.map.latLngToLayerPoint(one);
      if (first && this.corners.length > 2 && near(first).distanceTo(near(at)) < 14) return finish();
      const last = this.corners.at(-1);
      if (last && near(last).distanceTo(near(at)) < 3) return undefined; // the second click of a double click
      this.corners.push(at);
      this.shown.clearLayers();
      return this.shown.addLayer(L.polygon(this.corners, {color: "#000000", dashArray: "6 4", interactive: false}));
    }, finish);
  }
}
