// The page of `gyre watch`: what arrives is handed to the views, and what is chosen goes back.

import { Connection } from "./connection.js";
import { DelaysView } from "./delays.js";
import { HealthView } from "./health.js";
import { ScanView } from "./scan.js";
import { TrackView } from "./track.js";

const byId = (id) => document.getElementById(id);
const chosen = (name) => document.querySelector(`input[name="${name}"]:checked`)?.value;

const health = new HealthView();
const delays = new DelaysView(byId("series"), byId("stages"));
const scan = new ScanView(byId("scan"), byId("scan-caption"));
const track = new TrackView(byId("track"), () => {
  for (const choice of document.querySelectorAll('input[name="view"]')) choice.checked = false;
});

let run = null;

const connection = new Connection({
  onState: (connected) => health.setConnected(connected),
  onText(message) {
    switch (message.kind) {
      case "run":
        if (run && run !== message.id) track.clear();
        run = message.id;
        byId("objects-choice").hidden = !message.objects;
        if (!message.objects) scan.setObjects(null);
        health.setRun(message);
        break;
      case "poses":
        track.add(message);
        health.setPose(message.pose, message.drift);
        break;
      case "objects":
        scan.setObjects(message);
        break;
      case "health":
        delays.set(message.delays);
        health.setHealth(message);
        break;
    }
  },
  onPicture(header, bytes) {
    switch (header.kind) {
      case "scan": scan.setScan(header, bytes); break;
      case "raster": scan.setRaster(header, bytes); break;
      case "points":
        scan.setPoints(header, bytes);
        track.addPoints(header, bytes);
        break;
    }
  },
  layers: () => {
    const wanted = [chosen("layer")];
    if (byId("with-points").checked || byId("with-map").checked) wanted.push("points");
    if (byId("with-objects").checked) wanted.push("objects");
    return wanted.join(" ");
  },
});

function choose() {
  scan.set({
    layer: chosen("layer"),
    withPoints: byId("with-points").checked,
    withObjects: byId("with-objects").checked,
    rangeM: Number(byId("range").value),
  });
  track.set({ withMap: byId("with-map").checked });
  connection.ask();
}

for (const control of document.querySelectorAll('input[name="layer"], #with-points, #with-objects, #with-map, #range')) {
  control.addEventListener("change", choose);
}
for (const control of document.querySelectorAll('input[name="view"]')) {
  control.addEventListener("change", () => track.set({ mode: control.value }));
}
byId("zoom-in").addEventListener("click", () => track.zoom(1.4));
byId("zoom-out").addEventListener("click", () => track.zoom(1 / 1.4));

setInterval(() => {
  const kilobytes = connection.takeReceived() / 2 / 1000;
  byId("traffic").textContent = `This page receives ${kilobytes.toFixed(0)} kB/s`;
}, 2000);
