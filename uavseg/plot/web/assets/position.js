// Position of the device, where it is allowed.
"use strict";

function addPosition({map}) {
  if (!navigator.geolocation) return;
  const button = make("button", {type: "button", textContent: "Show my position"});
  const shown = L.layerGroup().addTo(map), status = document.getElementById("status");
  button.onclick = () => map.locate({watch: true, enableHighAccuracy: true});
  map.on("locationfound", ({latlng, accuracy}) => {
    const style = {color: "#ffffff", fillColor: "#0050ff", fillOpacity: 1, weight: 3, radius: 9};
    shown.clearLayers();
    shown.addLayer(L.circle(latlng, {radius: accuracy, color: "#0050ff", weight: 1, interactive: false}));
    shown.addLayer(L.circleMarker(latlng, {...style, interactive: false}));
    status.textContent = `Position known to ${accuracy.toFixed(0)} m`;
  });
  map.on("locationerror", () => { status.textContent = "The device does not give its position"; });
  status.before(button);
}
