// Latency: sensor to pose over the last minute, and the median and 99th percentile of each hop.

import { Drawing, colour, label, roundUp } from "./canvas.js";

const LEFT = 58;
const BOTTOM = 20;
const TOP = 10;

export class DelaysView {
  constructor(canvas, body) {
    this.drawing = new Drawing(canvas, (...to) => this.draw(...to));
    this.body = body;
    this.series = [];
    this.rows = new Map();
  }

  set({ series, stages }) {
    this.series = series;
    this.drawing.request();
    const names = stages.map(({ stage }) => stage);
    if (names.join() !== [...this.rows.keys()].join()) this.build(names);
    const longest = Math.max(...stages.map(({ hand_over: before, work }) => before.p50_ms + work.p50_ms), 0.001);
    for (const { stage, hand_over: before, work } of stages) {
      const { cells, parts } = this.rows.get(stage);
      const values = [before.p50_ms, before.p99_ms, work.p50_ms, work.p99_ms];
      values.forEach((value, k) => { cells[k].textContent = milliseconds(value); });
      parts[0].style.width = `${(100 * before.p50_ms) / longest}%`;
      parts[1].style.width = `${(100 * work.p50_ms) / longest}%`;
    }
  }

  build(names) {
    this.rows = new Map(names.map((name) => {
      const row = document.createElement("tr");
      const head = Object.assign(document.createElement("th"), { scope: "row", textContent: name });
      const cells = Array.from({ length: 4 }, () => document.createElement("td"));
      const last = Object.assign(document.createElement("td"), { className: "bars" });
      const bar = Object.assign(document.createElement("div"), { className: "bar" });
      const parts = [document.createElement("i"), document.createElement("i")];
      bar.append(...parts);
      last.append(bar);
      row.append(head, ...cells, last);
      return [name, { row, cells, parts }];
    }));
    this.body.replaceChildren(...[...this.rows.values()].map(({ row }) => row));
  }

  draw(context, width, height) {
    const seen = this.series.filter(Boolean);
    const highest = Math.max(...seen.map(({ max_ms: max }) => max), 1);
    const topMs = roundUp(highest);
    const right = (k) => LEFT + ((width - LEFT - 12) * k) / Math.max(this.series.length - 1, 1);
    const down = (value) => height - BOTTOM - ((height - BOTTOM - TOP) * value) / topMs;
    context.strokeStyle = colour("grid");
    context.lineWidth = 1;
    for (const value of [0, topMs / 2, topMs]) {
      context.beginPath();
      context.moveTo(LEFT, Math.round(down(value)) + 0.5);
      context.lineTo(width - 12, Math.round(down(value)) + 0.5);
      context.stroke();
      label(context, !value ? "0" : topMs < 1000 ? `${value} ms` : `${value / 1000} s`, LEFT - 6, down(value) + 4, "right");
    }
    for (const [seconds, align] of [[60, "left"], [30, "center"], [0, "right"]]) {
      const text = seconds ? `−${seconds} s` : "now";
      label(context, text, right((this.series.length - 1) * (1 - seconds / 60)), height - 5, align);
    }
    this.drawLine(context, "max_ms", colour("second"), right, down);
    this.drawLine(context, "p50_ms", colour("accent"), right, down);
  }

  drawLine(context, key, stroke, right, down) {
    context.strokeStyle = stroke;
    context.fillStyle = stroke;
    context.lineWidth = 2;
    context.beginPath();
    this.series.forEach((value, k) => {
      if (!value) return;
      const [x, y] = [right(k), down(value[key])];
      if (this.series[k - 1]) context.lineTo(x, y);
      else context.moveTo(x - 0.5, y);
      context.lineTo(x, y);
    });
    context.stroke();
  }
}

/** Returns a duration with three digits. */
export function milliseconds(value) {
  return value < 10 ? value.toFixed(2) : value < 100 ? value.toFixed(1) : value.toFixed(0);
}
