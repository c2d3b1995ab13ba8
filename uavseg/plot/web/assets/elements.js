// Small parts of the page. Content of files becomes text nodes only, never markup.
"use strict";

// Outlines are bright with a black rim, so that they are seen on dark and on bright ground.
const COLORS = {
  file: "#ffa030", range: "#40d0ff", off: "#bbbbbb", rim: "#000000", flight: "#c4001a", stay: "#007a33", shots: "#ffe14d",
};

function make(name, values = {}, ...children) {
  const element = Object.assign(document.createElement(name), values);
  element.append(...children);
  return element;
}

function download(collection, name) {
  const blob = new Blob([JSON.stringify(collection)], {type: "application/geo+json"});
  const link = make("a", {href: URL.createObjectURL(blob), download: name});
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

/** Draws paths with a rim of `options.rim` pixels on either side, when it is not held. */
const RimCanvas = L.Canvas.extend({
  /** While it is held, paths that change are not painted: many that are added in turns are painted once. */
  hold(on) {
    this.held = on;
    if (!on && this._redrawBounds) this._requestRedraw({});
  },
  _requestRedraw(layer) {
    if (this.held) this._extendRedrawBounds(layer);
    else L.Canvas.prototype._requestRedraw.call(this, layer);
  },
  _fillStroke(context, layer) {
    const {rim, stroke, weight, lineCap, lineJoin} = layer.options;
    if (rim && stroke) {
      context.setLineDash([]);
      Object.assign(context, {globalAlpha: 1, lineWidth: weight + 2 * rim, strokeStyle: COLORS.rim, lineCap, lineJoin});
      context.stroke();
    }
    L.Canvas.prototype._fillStroke.call(this, context, layer);
  },
});
