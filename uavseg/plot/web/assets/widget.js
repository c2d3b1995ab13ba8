// The widget of notebooks (anywidget): the page of `uavseg map` in a frame, which shares its range.

const STEPS = 1000;

function render({model, el}) {
  const frame = document.createElement("iframe");
  frame.sandbox = "allow-scripts allow-downloads";  // an origin of its own: the page cannot reach the notebook
  frame.title = "Raster with a range slider";
  frame.style.cssText = "width: 100%; border: 1px solid #777; box-sizing: border-box";
  const resize = () => { frame.style.height = `${model.get("height")}px`; };
  let said = false;  // by this page, which is not to be set back while it is dragged on
  const show = () => {
    if (said) return;
    const steps = model.get("range").map((bound) => Math.round(bound * STEPS));
    frame.contentWindow?.postMessage({uavseg: "range", steps}, "*");
  };
  const hear = (event) => {
    if (event.source !== frame.contentWindow) return;
    if (event.data?.uavseg === "ready") show();
    if (event.data?.uavseg !== "range") return;
    said = true;
    model.set("range", event.data.steps.map((step) => step / STEPS));
    said = false;
    model.save_changes();
  };
  window.addEventListener("message", hear);
  model.on("change:range", show);
  model.on("change:height", resize);
  resize();
  frame.srcdoc = model.get("page");
  el.append(frame);
  return () => {
    window.removeEventListener("message", hear);
    model.off("change:range", show);
    model.off("change:height", resize);
  };
}

export default {render};
