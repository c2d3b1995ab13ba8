// The slider of a raster with too many cells for a page: the server sends the codes of the cells below the pixels of
// the tiles that are seen, once; the page colours them while a handle is dragged.
"use strict";

const CodeTiles = L.GridLayer.extend({
  initialize(options) {
    L.GridLayer.prototype.initialize.call(this, options);
    Object.assign(this, {range: [0, 0], shown: new Set()});
    this.on("tileunload", ({tile}) => {
      this.shown.delete(tile);
      tile.unloaded.abort();
    });
  },

  createTile({x, y, z}, done) {
    const {x: side} = this.getTileSize(), tile = make("canvas", {className: "cells", width: side, height: side});
    this.shown.add(tile);
    tile.dataset.place = `${z}/${x}/${y}`;
    tile.unloaded = new AbortController();
    fetch(`codes/${tile.dataset.place}`, {signal: tile.unloaded.signal}).then(async (response) => {
      if (!response.ok) throw new Error(`answer ${response.status}`);
      if (response.status === 200) {
        tile.codes = new Uint16Array(await response.arrayBuffer());
        this.paint(tile);
      }
      done(null, tile);
    }).catch((error) => { if (!tile.unloaded.signal.aborted) done(error, tile); });
    return tile;
  },

  draw(low, high) {
    this.range = [2 * low, 2 * high];
    for (const tile of this.shown) if (tile.codes) this.paint(tile);
  },

  paint(tile) {
    const {codes, width, height} = tile, [from, to] = this.range, context = tile.getContext("2d");
    const image = context.createImageData(width, height), pixels = new Uint32Array(image.data.buffer);
    for (let n = 0; n < pixels.length; n++) if (codes[n] >= from && codes[n] <= to) pixels[n] = CellOverlay.COLOR;
    context.putImageData(image, 0, 0);
  },
});

function addTiledSlider(page) {
  const {map, data, panel, layers} = page, [west, south, east, north] = data.image.bounds;
  Object.assign(map.createPane("cells").style, {zIndex: 390, pointerEvents: "none"});
  const bounds = [[south, west], [north, east]];
  const layer = new CodeTiles({pane: "cells", maxZoom: 26, bounds, opacity: 0.65, updateWhenIdle: false});
  const controls = make("section", {}, make("h2", {textContent: "Cells of a range"}));
  const missing = make("p", {className: "warning", hidden: true});
  missing.textContent = "Some cells are not shown: the server does not answer. Is it still running?";
  layer.on("tileerror", () => { missing.hidden = false; });
  layer.on("loading", () => { missing.hidden = true; });
  panel.append(controls);
  const moved = () => layer.addTo(map);
  addRange(page, controls, {areas: areaOfCodes(data.server.areas), cells: layer, moved, rested() {}});
  controls.append(missing, make("p", {textContent: "Borders run along cells of 8 x 8 pixels of the raster."}));
  layers.addOverlay(layer.addTo(map), "Cells of the range");
}
