// Regions of a range from block means, in the page: the answer of `uavseg extract blocks.tif --refine none`.
//
// A cell is 8 x 8 pixels. Its code says where the mean v of its leaf lies among steps of 1/1000:
// 2 k where it equals k/1000, 2 k + 1 where it lies between k/1000 and (k + 1)/1000, 65535 where the leaf has
// no valid pixel. So a range whose bounds are steps is decided exactly.
"use strict";

/** A function with a name, so that a worker can be given its text: it uses nothing from outside of it. */
function makeBlocks() {
  const CELL = 8, STEPS = 1000, NONE = 65535;

  async function unpack(base64) {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  }

  /** The grid of cells of the page's data. */
  async function decode(packed) {
    return {
      shape: packed.shape, rows: packed.cells[0], cols: packed.cells[1], ground: packed.ground,
      codes: new Uint16Array(await unpack(packed.codes)), counts: new Uint8Array(await unpack(packed.counts)),
    };
  }

  /** Label 4-connected cells of one kind; returns the labels, 0 for none, and how many there are. */
  function label(inside, rows, cols) {
    const labels = new Int32Array(rows * cols), stack = new Int32Array(rows * cols);
    let count = 0;
    for (let start = 0; start < labels.length; start++) {
      if (!inside[start] || labels[start]) continue;
      labels[start] = ++count;
      stack[0] = start;
      for (let top = 1; top > 0;) {
        const cell = stack[--top], col = cell % cols;
        const near = [col > 0 ? cell - 1 : -1, col < cols - 1 ? cell + 1 : -1, cell - cols, cell + cols];
        for (const next of near) {
          if (next < 0 || next >= labels.length || !inside[next] || labels[next]) continue;
          labels[next] = count;
          stack[top++] = next;
        }
      }
    }
    return {labels, count};
  }

  /** Closed rings on cell corners, [row, col], with their part; exteriors have positive area. */
  function traceRings(parts, rows, cols) {
    const width = cols + 1, seen = new Uint8Array((rows + 1) * width), rings = [];
    const at = (row, col) => (row < 0 || col < 0 || row >= rows || col >= cols ? 0 : parts[row * cols + col]);
    // A step keeps its part on the right: east along the top edge of a cell, south along its right edge.
    const moves = [[0, 1], [1, 0], [0, -1], [-1, 0]];
    for (let row = 0; row < rows; row++) {
      for (let col = 0; col < cols; col++) {
        const part = parts[row * cols + col];
        if (!part) continue;
        if (at(row - 1, col) !== part && !(seen[row * width + col] & 1)) follow(row, col, 0, part);
        if (at(row + 1, col) !== part && !(seen[(row + 1) * width + col + 1] & 4)) follow(row + 1, col + 1, 2, part);
      }
    }
    return rings;

    function follow(row, col, way, part) {
      const path = [];
      while (!(seen[row * width + col] & (1 << way))) {
        seen[row * width + col] |= 1 << way;
        path.push(row * width + col);
        row += moves[way][0];
        col += moves[way][1];
        way = turn(row, col, way, part);
      }
      for (const ring of simpleRings(path)) rings.push({part, points: corners(ring)});
    }

    // The cells ahead of a corner decide: right where the part ends there, left where it goes on to both sides.
    function turn(row, col, way, part) {
      const aheadRight = [[row, col], [row, col - 1], [row - 1, col - 1], [row - 1, col]][way];
      const aheadLeft = [[row - 1, col], [row, col], [row, col - 1], [row - 1, col - 1]][way];
      if (at(...aheadRight) !== part) return (way + 1) % 4;
      return at(...aheadLeft) === part ? (way + 3) % 4 : way;
    }

    /** Split a closed path at the corners that it meets more than once. */
    function* simpleRings(path) {
      const place = new Map(), open = [];
      for (const corner of path) {
        if (place.has(corner)) {
          const ring = open.splice(place.get(corner));
          for (const one of ring) place.delete(one);
          yield ring;
        }
        place.set(corner, open.length);
        open.push(corner);
      }
      yield open;
    }

    function corners(ring) {
      return ring.filter((corner, n) => {
        const before = ring[(n + ring.length - 1) % ring.length], after = ring[(n + 1) % ring.length];
        return after - corner !== corner - before;
      }).map((corner) => [Math.floor(corner / width), corner % width]);
    }
  }

  function signedArea(points) {
    let twice = 0;
    points.forEach(([row, col], n) => {
      const [nextRow, nextCol] = points[(n + 1) % points.length];
      twice += col * nextRow - nextCol * row;
    });
    return twice / 2;
  }

  /** Longitude and latitude of a pixel corner, between the nearest of the places that are known. */
  function lonLat(grid, row, col) {
    const {shape, ground} = grid, [rows, cols] = ground.shape;
    const y = (row / grid.shape[0]) * (rows - 1), x = (col / shape[1]) * (cols - 1);
    const top = Math.min(Math.floor(y), rows - 2), left = Math.min(Math.floor(x), cols - 2);
    const mix = (values) => {
      const at = (r, c) => values[r * cols + c], v = y - top, u = x - left;
      return (1 - v) * ((1 - u) * at(top, left) + u * at(top, left + 1)) +
        v * ((1 - u) * at(top + 1, left) + u * at(top + 1, left + 1));
    };
    const unit = 10 ** ground.decimals;
    return [mix(ground.lon), mix(ground.lat)].map((degrees) => Math.round(degrees * unit) / unit);
  }

  /** Row and column in pixels of a longitude and latitude: Newton's method on the table of places. */
  function rowCol(grid, lon, lat) {
    const {shape, ground} = grid, [rows, cols] = ground.shape;
    let y = (rows - 1) / 2, x = (cols - 1) / 2;
    for (let step = 0; step < 8; step++) {
      const top = Math.min(Math.max(Math.floor(y), 0), rows - 2), left = Math.min(Math.max(Math.floor(x), 0), cols - 2);
      const at = top * cols + left, v = y - top, u = x - left;
      const terms = [ground.lon, ground.lat].map((values) => {
        const a = values[at], right = values[at + 1] - a, down = values[at + cols] - a;
        const both = values[at + cols + 1] - a - right - down;
        return [a + u * right + v * down + u * v * both, right + v * both, down + u * both];
      });
      const [[f, fu, fv], [g, gu, gv]] = terms, det = fu * gv - fv * gu, [df, dg] = [lon - f, lat - g];
      x += (df * gv - fv * dg) / det;
      y += (fu * dg - df * gu) / det;
    }
    return [(y / (rows - 1)) * shape[0], (x / (cols - 1)) * shape[1]];
  }

  /** A function from the column of a cell in a row to its area in square metres. */
  function cellArea(grid, row) {
    const top = CELL * row, height = Math.min(CELL, grid.shape[0] - top);
    return (col) => height * Math.min(CELL, grid.shape[1] - CELL * col) * pixelArea(grid, top + CELL / 2, CELL * col + CELL / 2);
  }

  /** Square metres of a pixel near a place. */
  function pixelArea(grid, row, col) {
    const {shape, ground} = grid, [rows, cols] = [ground.shape[0] - 1, ground.shape[1] - 1];
    const r = Math.min(Math.floor((row / shape[0]) * rows), rows - 1);
    const c = Math.min(Math.floor((col / shape[1]) * cols), cols - 1);
    return ground.pixel_m2[r * cols + c];
  }

  /** The regions of a range of steps, largest first, as a GeoJSON FeatureCollection. */
  function regions(grid, low, high) {
    const {rows, cols, codes, counts, shape} = grid;
    const inside = new Uint8Array(codes.length), valid = new Uint8Array(codes.length);
    for (let n = 0; n < codes.length; n++) {
      inside[n] = codes[n] !== NONE && codes[n] >= 2 * low && codes[n] <= 2 * high;
      valid[n] = inside[n] && counts[n] > 0;
    }
    const {labels, count} = label(inside, rows, cols), parts = label(valid, rows, cols).labels;
    const found = Array.from({length: count + 1}, () => ({
      side: 0, valid: 0, area: 0, sum: 0, first: -1, polygons: new Map(),
    }));
    for (let n = 0; n < labels.length; n++) {
      if (!valid[n]) continue;
      const one = found[labels[n]], row = CELL * Math.floor(n / cols), col = CELL * (n % cols);
      const side = Math.min(CELL, shape[0] - row) * Math.min(CELL, shape[1] - col);
      if (one.first < 0) one.first = n;
      one.side += side;
      one.valid += counts[n];
      one.area += side * pixelArea(grid, row + CELL / 2, col + CELL / 2);
      one.sum += (counts[n] * codes[n]) / 2 / STEPS;
    }
    const label_of_part = new Map();
    for (let n = 0; n < parts.length; n++) if (parts[n]) label_of_part.set(parts[n], labels[n]);
    for (const {part, points} of traceRings(parts, rows, cols)) {
      const {polygons} = found[label_of_part.get(part)];
      if (!polygons.has(part)) polygons.set(part, []);
      const place = ([row, col]) =>
        lonLat(grid, Math.min(CELL * row, shape[0]), Math.min(CELL * col, shape[1]));
      const ring = points.map(place);
      ring.push(ring[0]);
      if (signedArea(points) > 0) polygons.get(part).unshift(ring);
      else polygons.get(part).push(ring);
    }
    const kept = found.filter((one) => one.first >= 0);
    kept.sort((one, other) => other.side - one.side || one.first - other.first);
    return {type: "FeatureCollection", features: kept.map((one, n) => feature(one, n + 1, low, high))};
  }

  function feature(one, id, low, high) {
    const polygons = [...one.polygons.values()].map((rings) => rings.map(counterClockwise));
    const geometry = polygons.length === 1
      ? {type: "Polygon", coordinates: polygons[0]} : {type: "MultiPolygon", coordinates: polygons};
    const properties = {
      id, pixels: one.side, area_m2: Number(one.area.toPrecision(7)),
      mean: Number((one.sum / one.valid).toFixed(3)), range_low: low / STEPS, range_high: high / STEPS,
    };
    return {type: "Feature", id, properties, geometry};
  }

  /** RFC 7946: exteriors counter-clockwise, holes clockwise. */
  function counterClockwise(ring, n) {
    let twice = 0;
    for (let k = 0; k + 1 < ring.length; k++) twice += ring[k][0] * ring[k + 1][1] - ring[k + 1][0] * ring[k][1];
    return twice > 0 === (n === 0) ? ring : [...ring].reverse();
  }

  return {CELL, NONE, STEPS, cellArea, decode, lonLat, regions, rowCol, unpack};
}

const Blocks = makeBlocks();

if (typeof module !== "undefined") module.exports = Blocks;
