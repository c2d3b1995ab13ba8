// Outlines of a range, found in a worker, so that the page answers meanwhile.
"use strict";

const TURN_MS = 12; // at work on outlines, before the page has its turn

const WORKER = `
  "use strict";
  const Blocks = (${makeBlocks})();
  let grid = null;
  onmessage = ({data}) => {
    if (data.grid) grid = data.grid;
    else postMessage({asked: data.asked, found: Blocks.regions(grid, data.low, data.high)});
  };
`;

class Outlines {
  constructor(grid) {
    Object.assign(this, {grid, asked: 0, waiting: null, worker: null});
    try {
      const url = URL.createObjectURL(new Blob([WORKER], {type: "text/javascript"}));
      this.worker = new Worker(url);
      this.worker.onmessage = ({data}) => { if (data.asked === this.asked) this.answer(data.found); };
      this.worker.onerror = () => this.endWorker();
      this.worker.postMessage({grid});
    } catch {
      this.endWorker(); // a browser without workers: the page answers itself
    }
  }

  /** Regions of a range of steps, later; null where another range was asked for meanwhile, or none any more. */
  find(low, high) {
    this.cancel();
    return new Promise((resolve) => {
      this.waiting = {low, high, resolve};
      if (this.worker) this.worker.postMessage({asked: this.asked, low, high});
      else this.answer(Blocks.regions(this.grid, low, high));
    });
  }

  cancel() {
    this.asked++;
    this.answer(null);
  }

  answer(found) {
    const waiting = this.waiting;
    this.waiting = null;
    if (waiting) waiting.resolve(found);
  }

  endWorker() {
    const waiting = this.waiting;
    this.worker = null;
    if (waiting) this.answer(Blocks.regions(this.grid, waiting.low, waiting.high));
  }
}

/** Call `act` for each item; the page has its turn in between. Ends where `goesOn` says so; whether all were done. */
async function inTurns(items, act, goesOn) {
  let begun = performance.now();
  for (const item of items) {
    if (performance.now() - begun > TURN_MS) {
      await new Promise((resolve) => setTimeout(resolve));
      if (!goesOn()) return false;
      begun = performance.now();
    }
    act(item);
  }
  return true;
}
