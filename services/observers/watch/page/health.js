// The state of the run, its processes, and its key figures.

import { milliseconds } from "./delays.js";

const LATE_MS = 5000; // Without a pose for so long a working run is shown as late.
const UNKNOWN = "−"; // What is not known.
// What a pose rests on.
const MATCHES = {
  refined: "of the map is met",
  weak: "weak: few points, or poor",
  predicted: "none: motion predicted",
  searched: "scan to scan",
};

const byId = (id) => document.getElementById(id);
const degrees = (angle) => (angle * 180) / Math.PI;
const signed = (value, digits) => `${value < 0 ? "−" : ""}${Math.abs(value).toFixed(digits)}`;
const megabytes = (bytes) => `${(bytes / 1e6).toFixed(0)} MB`;

function write(id, text) {
  const element = byId(id);
  if (element.textContent !== text) element.textContent = text;
}

export class HealthView {
  constructor() {
    this.connected = false;
    this.advanced = performance.now();
    setInterval(() => this.judge(), 500);
  }

  setRun(run) {
    this.run = run;
    const name = run.out.split("/").filter(Boolean).slice(-2).join("/");
    write("out", name);
    byId("out").title = run.out;
    document.title = `${name} · Gyre`;
    const pace = run.rate === null ? "as fast as it goes" : run.rate === 1 ? "real time" : `${run.rate} × real time`;
    write("mode", run.state === "waiting" ? "" : `${run.live ? "live" : "lossless"}, ${pace}, window ${run.window}`);
    this.judge();
  }

  setConnected(connected) {
    if (this.connected === connected) return;
    this.connected = connected;
    this.advanced = performance.now();
    this.judge();
  }

  setPose(pose, drift) {
    if (!pose) return;
    if (pose.seq !== this.pose?.seq) this.advanced = performance.now();
    this.pose = pose;
    const [x, y, yaw] = pose.vertex;
    write("speed", pose.speed_mps.toFixed(2));
    write("speed-note", pose.stationary ? "stationary" : `${(pose.speed_mps * 3.6).toFixed(0)} km/h, ${signed(degrees(pose.yaw_rate_radps), 1)} °/s`);
    write("position", `${signed(x, 1)}, ${signed(y, 1)}`);
    write("heading", `yaw ${signed(degrees(yaw), 1)}°, scan ${pose.scan}`);
    const isMatched = pose.outcome === "refined" || pose.outcome === "weak";
    write("match", isMatched ? `${(100 * pose.overlap).toFixed(0)} %` : UNKNOWN);
    this.writeMatchNote();
    if (!drift) return;
    write("drift", drift.position_m.toFixed(2));
    write("drift-note", `yaw ${degrees(drift.yaw_rad).toFixed(2)}°, last ${drift.over_m.toFixed(0)} m`);
  }

  setHealth(health) {
    const { delays, missed } = health;
    if (delays.samples) {
      write("latency", milliseconds(delays.sensor_to_pose.p50_ms));
      write("latency-note", `p99 ${milliseconds(delays.sensor_to_pose.p99_ms)} ms`);
    }
    write("poses", String(health.poses));
    write("rate", `${health.scans_per_s.toFixed(1)}/s`);
    const isLong = health.distance_m >= 10000;
    const driven = (health.distance_m / (isLong ? 1000 : 1)).toFixed(isLong ? 2 : 0);
    write("driven", `, ${driven} ${isLong ? "km" : "m"} driven`);
    write("dropped", String(health.dropped));
    write("in-flight", `${health.in_flight} in flight`);
    write("missed", `Missed by this page's observer: ${missed.pose} poses, ${missed.scan} scans, ${missed.masked} masked scans`);
    this.others = health.others;
    this.writeMatchNote();
    this.notice = health.notice;
    this.setProcesses(health.processes);
    this.judge();
  }

  // What the newest pose rests on; with a gyro or wheels, how often they are used.
  writeMatchNote() {
    if (!this.pose) return;
    const { outcome, basis } = this.pose;
    write("match-note", this.others ? `${basis}: ${this.others}` : MATCHES[outcome]);
  }

  setProcesses(processes) {
    const rows = processes.map((process) => {
      const row = document.createElement("tr");
      const head = Object.assign(document.createElement("th"), { scope: "row", textContent: process.name });
      if (process.pid) head.title = `process ${process.pid}`;
      const state = Object.assign(document.createElement("td"), { className: "left", textContent: process.state });
      state.dataset.level = process.level;
      const share = process.processor_share;
      const texts = [
        String(process.restarts),
        share === null ? UNKNOWN : `${(100 * share).toFixed(share < 0.1 ? 1 : 0)} %`,
        process.own_bytes === null ? UNKNOWN : megabytes(process.own_bytes),
      ];
      row.append(head, state, ...texts.map((textContent) => Object.assign(document.createElement("td"), { textContent })));
      return row;
    });
    byId("processes").replaceChildren(...rows);
    const dead = processes.filter((process) => process.last_death);
    const since = (process) => (process.level === "good" ? ", and works again" : "");
    write("deaths", dead.map((process) => `${process.name} died by ${process.last_death}${since(process)}.`).join(" "));
  }

  // Says what is wrong first, then how the run is.
  judge() {
    const [level, state, sentence] = this.verdict();
    write("state", state);
    byId("state").dataset.level = level;
    const banner = byId("banner");
    const text = sentence ?? (this.notice || "");
    banner.hidden = !text;
    banner.dataset.level = level;
    if (banner.textContent !== text) banner.textContent = text;
  }

  verdict() {
    const { run } = this;
    if (!this.connected) {
      return ["bad", "Connection lost", "The connection to gyre watch is lost. What is shown is old; this page tries again."];
    }
    const poses = this.pose ? `${this.pose.seq + 1} poses` : "no pose";
    switch (run?.state) {
      case "working": break;
      case "finishing": return ["good", "Finishing", "The last scan has its pose; the results are being written."];
      case "complete": return ["good", "Ended: complete", `The run has ended: complete, ${poses}. The next one in this folder is shown here when it starts.`];
      case "interrupted": return ["warn", "Ended early", `The run has ended before its recording, after ${poses}. The same command continues it.`];
      default: return ["off", "Waiting", "There is no run yet. It is shown here when it starts."];
    }
    const lateMs = performance.now() - this.advanced;
    if (lateMs > LATE_MS) return ["warn", "No pose", `No pose for ${Math.floor(lateMs / LATE_MS) * (LATE_MS / 1000)} s.`];
    return ["good", "Running"];
  }
}
