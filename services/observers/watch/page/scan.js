// The newest scan: powers or the masked raster, and the points.

import { Drawing, Labels, colour, isDark, roundUp } from "./canvas.js";
import { Objects } from "./objects.js";

const SIDE = 600; // Pixels of the picture on each side.
const BRIGHTEST_SHARE = 0.006;
// From no return to the strongest: dark and light grounds.
const STOPS = {
  dark: [[10, 14, 18], [16, 46, 66], [22, 108, 122], [88, 190, 160], [246, 238, 170]],
  light: [[251, 252, 253], [198, 221, 232], [104, 166, 196], [26, 96, 140], [8, 32, 66]],
};

export class ScanView {
  constructor(canvas, caption) {
    this.drawing = new Drawing(canvas, (...to) => this.draw(...to));
    this.caption = caption;
    this.picture = document.createElement("canvas");
    this.picture.width = this.picture.height = SIDE;
    this.image = new ImageData(SIDE, SIDE);
    this.levels = { low: 0, high: 255 };
    this.layer = "scan";
    this.withPoints = true;
    this.withObjects = true;
    this.objects = new Objects();
    this.rangeM = 0;
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.colours = null;
      if (this.raster) this.setRaster(this.raster.header, this.raster.cells);
    });
  }

  /** Takes a scan: azimuths counter-clockwise from straight ahead, each with its bins. */
  setScan(header, buffer) {
    const powers = new Uint8Array(buffer);
    const old = this.header;
    if (old?.azimuths !== header.azimuths || old.bins !== header.bins) this.places = placesOf(header);
    Object.assign(this, { header, powers });
    this.adapt(powers, header.floor);
    this.describe();
    this.drawing.request();
  }

  setRaster(header, buffer) {
    const cells = new Uint8Array(buffer);
    const picture = document.createElement("canvas");
    picture.width = picture.height = header.side;
    const image = new ImageData(header.side, header.side);
    const pixels = new Uint32Array(image.data.buffer);
    const colours = coloursOf({ low: 0, high: 200 });
    cells.forEach((value, index) => { pixels[index] = colours[value]; });
    picture.getContext("2d").putImageData(image, 0, 0);
    this.raster = { header, cells: buffer, picture };
    if (this.layer === "raster") {
      this.describe();
      this.drawing.request();
    }
  }

  setPoints(header, buffer) {
    this.points = { unitM: header.unit_m, places: new Int16Array(buffer) };
    this.drawing.request();
  }

  /** Takes the objects of a scan; null: the run has none. */
  setObjects(message) {
    this.objects.set(message);
    this.drawing.request();
  }

  /** Shows other layers, or another range (0: all). */
  set(choice) {
    Object.assign(this, choice);
    this.describe();
    this.drawing.request();
  }

  // What is shown: the raster, if it is that, and the distance from the middle to the edge.
  view() {
    const raster = this.layer === "raster" ? this.raster : null;
    const fullM = raster ? raster.header.width_m / 2 : this.header?.max_range_m ?? 100;
    return { raster, rangeM: this.rangeM ? Math.min(this.rangeM, fullM) : fullM };
  }

  describe() {
    const { raster, rangeM } = this.view();
    if (raster) {
      const width = (2 * rangeM).toFixed(0);
      this.caption.textContent = `Masked raster of ${width} m × ${width} m, ahead is up`;
    } else if (this.header) {
      this.caption.textContent = `Scan ${this.header.scan}, to ${rangeM.toFixed(0)} m, ahead is up`;
    }
  }

  // Few cells are stronger than the brightest colour. The scale follows slowly, so that it does not flicker.
  adapt(powers, floor) {
    const counts = new Uint32Array(256);
    for (const power of powers) counts[power] += 1;
    let left = BRIGHTEST_SHARE * powers.length;
    let strong = 255;
    while (strong > 0 && (left -= counts[strong]) > 0) strong -= 1;
    const blend = this.colours ? 0.2 : 1;
    this.levels.low += blend * (floor - this.levels.low);
    this.levels.high += blend * (Math.max(strong, floor + 40) - this.levels.high);
    this.colours = coloursOf(this.levels);
  }

  draw(context, width, height) {
    const size = Math.min(width, height);
    const { raster, rangeM } = this.view();
    const labels = new Labels();
    const scale = size / 2 / rangeM;
    context.save();
    context.translate(width / 2, height / 2);
    context.imageSmoothingQuality = "high";
    if (raster) {
      const side = raster.header.width_m * scale;
      context.imageSmoothingEnabled = false;
      context.drawImage(raster.picture, -side / 2, -side / 2, side, side);
    } else if (this.powers) {
      this.paint();
      const side = 2 * this.header.max_range_m * scale;
      context.drawImage(this.picture, -side / 2, -side / 2, side, side);
    }
    if (this.withPoints && this.points) this.drawPoints(context, scale);
    drawRings(context, labels, scale, rangeM, width, height);
    if (this.withObjects) this.objects.draw(context, scale, labels);
    drawVehicle(context);
    context.restore();
  }

  paint() {
    const pixels = new Uint32Array(this.image.data.buffer);
    this.colours ??= coloursOf(this.levels);
    const { places, colours, powers } = this;
    for (let pixel = 0; pixel < pixels.length; pixel += 1) {
      const place = places[pixel];
      pixels[pixel] = place < 0 ? 0 : colours[powers[place]];
    }
    this.picture.getContext("2d").putImageData(this.image, 0, 0);
  }

  drawPoints(context, scale) {
    const { unitM, places } = this.points;
    context.fillStyle = colour("points");
    context.globalAlpha = 0.8;
    for (let k = 0; k < places.length; k += 2) {
      const [x, y] = [places[k] * unitM, places[k + 1] * unitM];
      context.fillRect(-y * scale - 0.8, -x * scale - 0.8, 1.6, 1.6);
    }
    context.globalAlpha = 1;
  }
}

// For each pixel the cell of the scan that it shows, or -1: ahead is up.
function placesOf({ azimuths, bins }) {
  const places = new Int32Array(SIDE * SIDE).fill(-1);
  const middle = SIDE / 2;
  for (let row = 0; row < SIDE; row += 1) {
    for (let column = 0; column < SIDE; column += 1) {
      const [ahead, left] = [middle - row - 0.5, middle - column - 0.5];
      const bin = Math.floor((Math.hypot(ahead, left) / middle) * bins);
      if (bin >= bins) continue;
      const turns = Math.atan2(left, ahead) / (2 * Math.PI) + 1;
      places[row * SIDE + column] = (Math.round(turns * azimuths) % azimuths) * bins + bin;
    }
  }
  return places;
}

// The pixel of each power.
function coloursOf({ low, high }) {
  const stops = STOPS[isDark() ? "dark" : "light"];
  return Uint32Array.from({ length: 256 }, (_, power) => {
    const value = Math.sqrt(Math.min(Math.max((power - low) / (high - low), 0), 1));
    const at = Math.min(value * (stops.length - 1), stops.length - 1.001);
    const [from, to] = [stops[Math.floor(at)], stops[Math.floor(at) + 1]];
    const [red, green, blue] = from.map((part, k) => part + (at % 1) * (to[k] - part));
    return ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0;
  });
}

function drawRings(context, labels, scale, rangeM, width, height) {
  const stepM = roundUp(rangeM / 6);
  const reach = Math.hypot(width, height) / 2;
  for (let radius = stepM; radius * scale < reach && radius <= rangeM * 1.001; radius += stepM) {
    context.globalAlpha = 0.4;
    context.strokeStyle = colour("muted");
    context.lineWidth = 1;
    context.beginPath();
    context.arc(0, 0, radius * scale, 0, 2 * Math.PI);
    context.stroke();
    context.globalAlpha = 1;
    labels.write(context, `${radius} m`, radius * scale * Math.SQRT1_2, -radius * scale * Math.SQRT1_2);
  }
}

function drawVehicle(context) {
  context.fillStyle = colour("accent");
  context.strokeStyle = colour("view");
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(0, -8);
  context.lineTo(5.5, 7);
  context.lineTo(0, 4);
  context.lineTo(-5.5, 7);
  context.closePath();
  context.stroke();
  context.fill();
}
