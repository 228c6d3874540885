// Moving objects over a scan: a box with the way of a second as an arrow, and the places of the
// last scans.

import { colour } from "./canvas.js";

const TRAIL = 20; // Places of each object.
const HEAD = 7; // Length of an arrow's head, pixels.

export class Objects {
  constructor() {
    this.set(null);
  }

  /** Takes the objects of a scan in the frame of the first one; null: there are none. */
  set(message) {
    if (!message || this.message?.seq >= message.seq) this.trails = new Map();
    this.message = message;
    if (!message) return;
    const before = this.trails;
    this.trails = new Map(message.objects.map(({ id, pose }) => {
      const trail = before.get(id) ?? [];
      return [id, [...trail.slice(1 - TRAIL), [pose[0], pose[1]]]];
    }));
  }

  /** Draws around the vehicle in the middle, ahead is up. */
  draw(context, scale, labels) {
    if (!this.message) return;
    const [x, y, yaw] = this.message.pose;
    const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
    // From the frame of the first scan to the canvas: right and down.
    const turned = ([east, north]) => [(sin * east - cos * north) * scale, -(cos * east + sin * north) * scale];
    const at = (place) => turned([place[0] - x, place[1] - y]);
    for (const object of this.message.objects) {
      context.strokeStyle = context.fillStyle = colour(object.moving ? "object" : "muted");
      drawTrail(context, this.trails.get(object.id).map(at));
      drawBox(context, at(object.pose), yaw - object.pose[2], object.size.map((side) => side * scale));
      if (object.moving) drawArrow(context, at(object.pose), turned(object.velocity));
      const [right, down] = at(object.pose);
      const speed = Math.hypot(...object.velocity);
      labels.write(context, object.moving ? `${object.id}: ${speed.toFixed(1)} m/s` : `${object.id}`, right + 8, down - 8);
    }
  }
}

function drawTrail(context, places) {
  context.globalAlpha = 0.6;
  context.lineWidth = 1.5;
  context.beginPath();
  for (const [right, down] of places) context.lineTo(right, down);
  context.stroke();
  context.globalAlpha = 1;
}

// A box of a length along `turn`, clockwise from up, and a width across.
function drawBox(context, [right, down], turn, [length, width]) {
  context.save();
  context.translate(right, down);
  context.rotate(turn);
  context.lineWidth = 2;
  context.strokeRect(-width / 2, -length / 2, width, length);
  context.restore();
}

function drawArrow(context, [right, down], [across, along]) {
  const length = Math.hypot(across, along);
  if (length < 1) return;
  context.save();
  context.translate(right, down);
  context.rotate(Math.atan2(along, across));
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(0, 0);
  context.lineTo(length, 0);
  context.moveTo(length - HEAD, -HEAD / 2);
  context.lineTo(length, 0);
  context.lineTo(length - HEAD, HEAD / 2);
  context.stroke();
  context.restore();
}
