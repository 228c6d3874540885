// The trajectory in the frame of the first scan: x to the right, y up, ellipses of its covariance, and the points of the scans.

import { Drawing, colour, label, roundUp } from "./canvas.js";

const MAX_POINTS = 60000;
const CELL_M = 0.4;
const SOLID = 3; // A place that was seen so often is drawn: what is seen once is mostly noise.
const MAP_STEP_M = 1; // A vehicle that stands adds no points.
const FOLLOWED_M = 60; // Half of what is seen around the vehicle.
const SIGMAS_95 = Math.sqrt(5.991); // 95 % of a normal distribution in the plane.
const ELLIPSE_PIXELS = 70; // Distance between two ellipses.

export class TrackView {
  constructor(canvas, onMoved) {
    this.drawing = new Drawing(canvas, (...to) => this.draw(...to));
    this.onMoved = onMoved;
    this.mode = "fit";
    this.withMap = true;
    this.clear();
    this.listen(canvas);
  }

  clear() {
    this.vertices = [];
    this.map = new Map();
    this.mapped = null;
    this.cellM = CELL_M;
    this.view = { x: 0, y: 0, scale: 4 };
  }

  add({ vertices, replace, pose }) {
    if (replace) this.vertices = [];
    this.vertices.push(...vertices);
    this.pose = pose?.vertex;
    this.drawing.request();
  }

  /** Adds the points of a scan at its pose. */
  addPoints({ unit_m: unitM, pose: [x, y, yaw] }, buffer) {
    if (this.mapped && Math.hypot(x - this.mapped[0], y - this.mapped[1]) < MAP_STEP_M) return;
    this.mapped = [x, y];
    const places = new Int16Array(buffer);
    const [cos, sin] = [Math.cos(yaw) * unitM, Math.sin(yaw) * unitM];
    for (let k = 0; k < places.length; k += 2) {
      const [ahead, left] = [places[k], places[k + 1]];
      this.keep(x + cos * ahead - sin * left, y + sin * ahead + cos * left);
    }
  }

  keep(x, y, times = 1) {
    const [column, row] = [Math.round(x / this.cellM), Math.round(y / this.cellM)];
    const key = (column + 1e6) * 4e6 + row + 1e6;
    const cell = this.map.get(key);
    if (cell) cell.seen += times;
    else this.map.set(key, { x: column * this.cellM, y: row * this.cellM, seen: times });
    if (this.map.size > MAX_POINTS) this.forget();
  }

  // Forgets what is not drawn; where that is not enough, the cells grow.
  forget() {
    for (const [key, { seen }] of this.map) {
      if (seen < SOLID) this.map.delete(key);
    }
    if (this.map.size < 0.8 * MAX_POINTS) return;
    const cells = this.map.values();
    this.map = new Map();
    this.cellM *= 2;
    for (const { x, y, seen } of cells) this.keep(x, y, seen);
  }

  set(choice) {
    Object.assign(this, choice);
    if (choice.mode === "follow") this.view.scale = 0;
    this.drawing.request();
  }

  zoom(factor, at = { x: this.drawing.width / 2, y: this.drawing.height / 2 }) {
    const before = this.toMetres(at);
    this.view.scale = Math.min(Math.max(this.view.scale * factor, 0.002), 200);
    if (this.mode !== "follow") {
      const after = this.toMetres(at);
      this.view.x += before.x - after.x;
      this.view.y += before.y - after.y;
      this.free();
    }
    this.drawing.request();
  }

  free() {
    this.mode = "free";
    this.onMoved();
  }

  toMetres({ x, y }) {
    const { view, drawing } = this;
    return { x: view.x + (x - drawing.width / 2) / view.scale, y: view.y - (y - drawing.height / 2) / view.scale };
  }

  listen(canvas) {
    const fingers = new Map();
    const at = (event) => ({ x: event.offsetX, y: event.offsetY });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * 0.0015), at(event));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, at(event));
    });
    canvas.addEventListener("pointermove", (event) => {
      const from = fingers.get(event.pointerId);
      if (!from) return;
      const to = at(event);
      const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
      fingers.set(event.pointerId, to);
      if (other) this.zoom(distance(to, other) / Math.max(distance(from, other), 1), other);
      else this.pan(to.x - from.x, to.y - from.y);
    });
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
    }
  }

  pan(right, down) {
    this.view.x -= right / this.view.scale;
    this.view.y += down / this.view.scale;
    this.free();
    this.drawing.request();
  }

  place(width, height) {
    const { view } = this;
    if (this.mode === "follow" && this.pose) {
      [view.x, view.y] = this.pose;
      view.scale ||= Math.min(width, height) / 2 / FOLLOWED_M;
    } else if (this.mode === "fit") {
      const all = this.pose ? [...this.vertices, this.pose] : this.vertices;
      const span = (axis) => {
        let [low, high] = [0, 0];
        for (const vertex of all) {
          low = Math.min(low, vertex[axis]);
          high = Math.max(high, vertex[axis]);
        }
        return [(low + high) / 2, high - low];
      };
      const [[x, wide], [y, high]] = [span(0), span(1)];
      Object.assign(view, { x, y, scale: Math.min(width / (wide + 60), height / (high + 60)) });
    }
  }

  draw(context, width, height) {
    this.place(width, height);
    const { view } = this;
    const right = (x) => width / 2 + (x - view.x) * view.scale;
    const down = (y) => height / 2 - (y - view.y) * view.scale;
    this.drawGrid(context, width, height, right, down);
    if (this.withMap) this.drawMap(context, right, down);
    this.drawPath(context, right, down);
    this.drawEllipses(context, right, down);
    if (this.vertices.length) drawStart(context, right(this.vertices[0][0]), down(this.vertices[0][1]));
    if (this.pose) drawPose(context, right(this.pose[0]), down(this.pose[1]), this.pose[2]);
    drawScale(context, view.scale, width, height);
  }

  drawGrid(context, width, height, right, down) {
    const stepM = roundUp(70 / this.view.scale);
    const first = this.toMetres({ x: 0, y: height });
    const last = this.toMetres({ x: width, y: 0 });
    context.strokeStyle = colour("grid");
    context.lineWidth = 1;
    context.beginPath();
    for (let x = Math.ceil(first.x / stepM) * stepM; x < last.x; x += stepM) {
      context.moveTo(Math.round(right(x)) + 0.5, 0);
      context.lineTo(Math.round(right(x)) + 0.5, height);
    }
    for (let y = Math.ceil(first.y / stepM) * stepM; y < last.y; y += stepM) {
      context.moveTo(0, Math.round(down(y)) + 0.5);
      context.lineTo(width, Math.round(down(y)) + 0.5);
    }
    context.stroke();
  }

  drawMap(context, right, down) {
    const size = Math.ceil(this.cellM * this.view.scale);
    context.fillStyle = colour("map");
    for (const { x, y, seen } of this.map.values()) {
      if (seen < SOLID) continue;
      context.globalAlpha = Math.min(0.2 + 0.06 * seen, 1);
      context.fillRect(Math.floor(right(x)), Math.floor(down(y)), size, size);
    }
    context.globalAlpha = 1;
  }

  drawPath(context, right, down) {
    context.strokeStyle = colour("accent");
    context.lineWidth = 2.5;
    context.lineJoin = "round";
    context.beginPath();
    for (const [x, y] of this.vertices) context.lineTo(right(x), down(y));
    if (this.pose) context.lineTo(right(this.pose[0]), down(this.pose[1]));
    context.stroke();
  }

  drawEllipses(context, right, down) {
    context.strokeStyle = colour("second");
    context.lineWidth = 1.25;
    let last = null;
    const draw = ([x, y, , xx, xy, yy]) => {
      const at = { x: right(x), y: down(y) };
      if (last && distance(at, last) < ELLIPSE_PIXELS) return;
      last = at;
      const { major, minor, angle } = axes(xx, xy, yy);
      context.beginPath();
      const radius = (sigma) => SIGMAS_95 * sigma * this.view.scale;
      context.ellipse(at.x, at.y, radius(major), radius(minor), -angle, 0, 2 * Math.PI);
      context.stroke();
    };
    // From the newest back: its ellipse is always there.
    if (this.pose) draw(this.pose);
    for (let k = this.vertices.length - 1; k >= 0; k -= 1) draw(this.vertices[k]);
  }
}

/** Returns the standard deviations along the axes of a covariance, and the angle of the first. */
export function axes(xx, xy, yy) {
  const mean = (xx + yy) / 2;
  const spread = Math.hypot((xx - yy) / 2, xy);
  const sigma = (variance) => Math.sqrt(Math.max(variance, 0));
  return { major: sigma(mean + spread), minor: sigma(mean - spread), angle: Math.atan2(2 * xy, xx - yy) / 2 };
}

const distance = (a, b) => Math.hypot(a.x - b.x, a.y - b.y);

function drawStart(context, x, y) {
  context.fillStyle = colour("good");
  context.beginPath();
  context.arc(x, y, 5, 0, 2 * Math.PI);
  context.fill();
  label(context, "start", x + 9, y + 4);
}

function drawPose(context, x, y, yaw) {
  context.save();
  context.translate(x, y);
  context.rotate(-yaw);
  context.fillStyle = colour("text");
  context.strokeStyle = colour("view");
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(12, 0);
  context.lineTo(-8, 7);
  context.lineTo(-4, 0);
  context.lineTo(-8, -7);
  context.closePath();
  context.stroke();
  context.fill();
  context.restore();
}

function drawScale(context, scale, width, height) {
  const metres = roundUp(70 / scale);
  const [right, down] = [width - 16, height - 14];
  context.strokeStyle = colour("muted");
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(right - metres * scale, down);
  context.lineTo(right, down);
  context.stroke();
  label(context, metres < 1000 ? `${metres} m` : `${metres / 1000} km`, right, down - 6, "right");
}
