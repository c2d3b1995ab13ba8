// Cells of a range as a picture over the map, so that a slider is followed however many regions there are.
"use strict";

/** Area in square metres of the valid cells in a range of steps, from sums over codes. */
function areaBySteps(grid) {
  const sums = new Float64Array(2 * Blocks.STEPS + 1);
  const byRow = Array.from({length: grid.rows}, (_, row) => Blocks.cellArea(grid, row));
  for (let n = 0; n < grid.codes.length; n++) {
    if (grid.codes[n] < sums.length && grid.counts[n]) sums[grid.codes[n]] += byRow[Math.floor(n / grid.cols)](n % grid.cols);
  }
  return areaOfCodes(sums);
}

/** The same from the area of the cells of each code. */
function areaOfCodes(areas) {
  const sums = new Float64Array(areas.length + 1);
  areas.forEach((area, code) => { sums[code + 1] = sums[code] + area; });
  return (low, high) => sums[2 * high + 1] - sums[2 * low];
}

class CellOverlay {
  constructor(grid, bounds) {
    const [west, south, east, north] = bounds, [left, top] = mercator(west, north), [right, bottom] = mercator(east, south);
    const scale = CellOverlay.SIDE / Math.max(right - left, top - bottom);
    this.canvas = make("canvas", {className: "cells"});
    this.canvas.width = Math.max(Math.round((right - left) * scale), 1);
    this.canvas.height = Math.max(Math.round((top - bottom) * scale), 1);
    const {width, height} = this.canvas;
    this.cellAt = cellsOf(grid, bounds, width, height);
    // One code more, for pixels outside of the raster.
    this.codes = new Uint16Array(grid.codes.length + 1).fill(Blocks.NONE);
    for (let n = 0; n < grid.codes.length; n++) if (grid.counts[n]) this.codes[n] = grid.codes[n];
    this.context = this.canvas.getContext("2d");
    this.image = this.context.createImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
    // Made for SVG, this layer places any element.
    this.layer = L.svgOverlay(this.canvas, [[south, west], [north, east]], {interactive: false, opacity: 0.65});
  }

  draw(low, high) {
    const {pixels, cellAt, codes} = this, from = 2 * low, to = 2 * high;
    for (let n = 0; n < pixels.length; n++) {
      const code = codes[cellAt[n]];
      pixels[n] = code >= from && code <= to ? CellOverlay.COLOR : 0;
    }
    this.context.putImageData(this.image, 0, 0);
  }
}
CellOverlay.SIDE = 1024;
CellOverlay.COLOR = 0xffffd040; // alpha, blue, green, red: COLORS.range

function mercator(lon, lat) {
  return [(lon * Math.PI) / 180, Math.asinh(Math.tan((lat * Math.PI) / 180))];
}

function lonLatOf(x, y) {
  return [(x * 180) / Math.PI, (Math.atan(Math.sinh(y)) * 180) / Math.PI];
}

/** The cell below each pixel of a picture in Web Mercator. */
function cellsOf(grid, [west, south, east, north], width, height) {
  const [left, top] = mercator(west, north), [right, bottom] = mercator(east, south);
  return cellsAt(grid, width, height, (x, y) => {
    return lonLatOf(left + (x * (right - left)) / width, top - (y * (top - bottom)) / height);
  });
}

/** The cell below each pixel of a picture, of which `place` gives longitude and latitude: found at the nodes of a coarse mesh, interpolated in between. */
function cellsAt(grid, width, height, place) {
  const mesh = 64, nodes = [];
  for (let j = 0; j <= mesh; j++) {
    for (let i = 0; i <= mesh; i++) nodes.push(Blocks.rowCol(grid, ...place((i * width) / mesh, (j * height) / mesh)));
  }
  const found = new Int32Array(width * height), outside = grid.codes.length, cell = Blocks.CELL;
  for (let y = 0; y < height; y++) {
    const down = ((y + 0.5) / height) * mesh, j = Math.floor(down), v = down - j;
    for (let x = 0; x < width; x++) {
      const along = ((x + 0.5) / width) * mesh, i = Math.floor(along), u = along - i, at = j * (mesh + 1) + i;
      const a = nodes[at], b = nodes[at + 1], c = nodes[at + mesh + 1], d = nodes[at + mesh + 2];
      const row = (1 - v) * ((1 - u) * a[0] + u * b[0]) + v * ((1 - u) * c[0] + u * d[0]);
      const col = (1 - v) * ((1 - u) * a[1] + u * b[1]) + v * ((1 - u) * c[1] + u * d[1]);
      const inside = row >= 0 && col >= 0 && row < grid.shape[0] && col < grid.shape[1];
      found[y * width + x] = inside ? Math.floor(row / cell) * grid.cols + Math.floor(col / cell) : outside;
    }
  }
  return found;
}

if (typeof module !== "undefined") module.exports = {areaBySteps, cellsOf};
