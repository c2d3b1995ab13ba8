// The page inside another window: says which range was chosen, and shows the one that it is given.
"use strict";

(() => {
  const handles = () => ["low-slider", "high-slider"].map((id) => document.getElementById(id));

  function say() {
    const [low, high] = handles();
    if (low) window.parent.postMessage({uavseg: "range", steps: [Number(low.value), Number(high.value)]}, "*");
  }

  // While a slider is dragged only the page answers; the range is said when it is let go.
  document.addEventListener("change", (event) => { if (event.target.closest(".slider")) say(); });

  window.addEventListener("message", (event) => {
    if (event.source !== window.parent || event.data?.uavseg !== "range" || !handles()[0]) return;
    handles().forEach((slider, n) => { slider.value = event.data.steps[n]; });
    handles().forEach((slider) => slider.dispatchEvent(new Event("input", {bubbles: true})));
  });

  const ready = new MutationObserver(() => {
    if (!document.body.dataset.ready) return;
    ready.disconnect();
    window.parent.postMessage({uavseg: "ready"}, "*");
  });
  ready.observe(document.body, {attributes: true, attributeFilter: ["data-ready"]});
})();
