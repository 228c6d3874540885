// What all drawings share: sharp canvases, the colours of the page, and round numbers for axes.

/** Keeps a canvas as sharp as the display, and calls `draw(context, width, height)` after each change of its size or the colours. */
export class Drawing {
  constructor(canvas, draw) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.draw = draw;
    this.requested = false;
    new ResizeObserver(() => this.resize()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.request());
  }

  resize() {
    const scale = Math.min(devicePixelRatio || 1, 2);
    this.width = this.canvas.clientWidth;
    this.height = this.canvas.clientHeight;
    this.canvas.width = Math.round(this.width * scale);
    this.canvas.height = Math.round(this.height * scale);
    this.context.setTransform(scale, 0, 0, scale, 0, 0);
    this.now();
  }

  /** Draws with the next frame of the display. */
  request() {
    if (this.requested) return;
    this.requested = true;
    requestAnimationFrame(() => {
      this.requested = false;
      this.now();
    });
  }

  now() {
    if (!this.width) return;
    this.context.clearRect(0, 0, this.width, this.height);
    this.draw(this.context, this.width, this.height);
  }
}

/** Returns a colour of the style sheet. */
export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

export const isDark = () => matchMedia("(prefers-color-scheme: dark)").matches;

/** Returns 1, 2 or 5 times a power of ten: the smallest that is not below `value`. */
export function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(Math.max(value, 1e-9)));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= value * 0.999);
}

export const FONT = '12px system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';

const LINE = 15; // Pixels between two lines of labels.

/** The labels of a drawing, none of which lies on another one. */
export class Labels {
  constructor() {
    this.taken = [];
  }

  /** Writes a label in the free line that is nearest to a place. */
  write(context, text, x, y) {
    context.font = FONT;
    const end = x + context.measureText(text).width + 4;
    const isFree = (line) => this.taken.every((it) => Math.abs(it.line - line) >= LINE || it.end <= x || end <= it.x);
    let line = y;
    for (let k = 1; !isFree(line); k += 1) line = y + LINE * Math.ceil(k / 2) * (k % 2 ? 1 : -1);
    this.taken.push({ line, x, end });
    label(context, text, x, line);
  }
}

/** Writes a label with a halo, so that it is read on any ground. */
export function label(context, text, x, y, align = "left") {
  context.font = FONT;
  context.textAlign = align;
  context.lineWidth = 3;
  context.lineJoin = "round";
  context.strokeStyle = colour("view");
  context.strokeText(text, x, y);
  context.fillStyle = colour("muted");
  context.fillText(text, x, y);
}
