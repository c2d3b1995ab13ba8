// Print the cell below each pixel of the picture of cells, and the area of ranges.
// Arguments: the folder of the page's code, a file of {cells, bounds, size, ranges}.
"use strict";

const fs = require("node:fs");
globalThis.Blocks = require(`${process.argv[2]}/blocks.js`);
const {areaBySteps, cellsOf} = require(`${process.argv[2]}/cells.js`);
const {cells, bounds, size: [width, height], ranges} = JSON.parse(fs.readFileSync(process.argv[3], "utf8"));
Blocks.decode(cells).then((grid) => {
  const areas = areaBySteps(grid);
  const found = {cells: [...cellsOf(grid, bounds, width, height)], areas: ranges.map(([low, high]) => areas(low, high))};
  process.stdout.write(JSON.stringify(found));
});
