// Print the regions of ranges, as the page of `uavseg map` finds them.
// Arguments: the folder of the page's code, a file of {cells, ranges}.
"use strict";

const fs = require("node:fs");
const Blocks = require(`${process.argv[2]}/blocks.js`);
const {cells, ranges} = JSON.parse(fs.readFileSync(process.argv[3], "utf8"));
Blocks.decode(cells).then((grid) => {
  process.stdout.write(JSON.stringify(ranges.map(([low, high]) => Blocks.regions(grid, low, high))));
});
