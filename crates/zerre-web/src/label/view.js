// The picture under the crosshair: zoom, pan, marks, magnifier. Places are pixels of the picture; pixel (x, y) covers
// [x, x + 1) by [y, y + 1), so that its middle is at .5.

const LARGEST = 64;
const KEPT = 32;
const LENS = 9;

const colour = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Pictures of frames, fetched ahead and kept for a while. */
export class Pictures {
  constructor(size) { this.size = size; this.kept = new Map(); }

  /** The picture of a frame; the promise fails with a sentence. */
  get(frame) {
    const found = this.kept.get(frame) ?? this.fetch(frame);
    this.kept.delete(frame);
    this.kept.set(frame, found);
    for (const old of this.kept.keys()) {
      if (this.kept.size <= KEPT) break;
      this.kept.delete(old);
    }
    return found;
  }

  async fetch(frame) {
    try {
      const answer = await fetch(`frames/${frame}`);
      if (!answer.ok) throw new Error(await answer.text());
      // The pixels as they are stored: marks are of these, whatever the file says of its orientation.
      const bitmap = await createImageBitmap(await answer.blob(), { imageOrientation: "none" });
      const [width, height] = this.size;
      if (bitmap.width !== width || bitmap.height !== height) throw new Error("It has another size than the first picture.");
      return bitmap;
    } catch (error) {
      this.kept.delete(frame);
      throw error instanceof TypeError ? new Error("The server does not answer.") : error;
    }
  }
}

export class View {
  /** `moved()` is called when the crosshair moves, `clicked(place)` when somebody marks with the mouse. */
  constructor(canvas, lens, size, { moved, clicked }) {
    Object.assign(this, { canvas, lens, size, moved, clicked });
    this.at = size.map(side => Math.floor(side / 2) + 0.5);
    this.marks = [];
    this.picture = null;
    this.scale = 1;
    this.origin = [0, 0];
    this.fitted = true;
    this.drag = null;
    new ResizeObserver(() => this.resize()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    canvas.addEventListener("pointerdown", event => this.down(event));
    canvas.addEventListener("pointermove", event => this.move(event));
    canvas.addEventListener("pointerup", event => this.up(event));
    canvas.addEventListener("pointercancel", () => { this.drag = null; });
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 16 : 1) / 400), this.pointer(event));
    }, { passive: false });
    canvas.addEventListener("contextmenu", event => event.preventDefault());
    this.resize();
  }

  get ratio() { return devicePixelRatio || 1; }

  resize() {
    const { width, height } = this.canvas.getBoundingClientRect();
    this.wide = width;
    this.high = height;
    this.canvas.width = Math.max(1, Math.round(width * this.ratio));
    this.canvas.height = Math.max(1, Math.round(height * this.ratio));
    if (this.fitted) this.fit(); else this.clamp();
    this.draw();
  }

  fit() {
    const [width, height] = this.size;
    const scale = Math.min(this.wide / width, this.high / height);
    // A whole factor keeps pixels square and equal.
    this.scale = scale > 2 ? Math.floor(scale) : scale;
    this.fitted = true;
    this.clamp();
    this.draw();
  }

  /** Keeps the picture in sight: in the middle where there is room, without a gap where there is none. */
  clamp() {
    [this.wide, this.high].forEach((room, k) => {
      const side = this.size[k] * this.scale;
      const free = room - side;
      this.origin[k] = free >= 0 ? Math.round(free / 2) : Math.min(0, Math.max(free, this.origin[k]));
    });
  }

  /** Zooms about a place on the page, or about the crosshair. */
  zoom(factor, about) {
    const on = about ?? this.onPage(this.at);
    const least = Math.min(1, this.wide / this.size[0], this.high / this.size[1]);
    const scale = Math.min(LARGEST, Math.max(least, this.scale * factor));
    const place = on.map((value, k) => (value - this.origin[k]) / this.scale);
    this.scale = scale;
    this.origin = on.map((value, k) => value - place[k] * scale);
    this.fitted = false;
    this.clamp();
    this.draw();
    this.moved();
  }

  pan(across, down) {
    this.origin[0] += across;
    this.origin[1] += down;
    this.fitted = false;
    this.clamp();
    this.draw();
  }

  onPage(place) { return place.map((value, k) => this.origin[k] + value * this.scale); }

  /** Where the pointer is on the canvas: the middle of the pixel of the screen that it names. */
  pointer(event) {
    const seen = this.canvas.getBoundingClientRect();
    const half = 0.5 / this.ratio;
    return [event.clientX - seen.left + half, event.clientY - seen.top + half];
  }

  place(event) {
    return this.pointer(event).map((value, k) => (value - this.origin[k]) / this.scale);
  }

  inside(place) { return place.every((value, k) => value >= 0 && value <= this.size[k]); }

  /** Moves the crosshair, and the picture with it where it would leave the sight. */
  go(place) {
    this.at = place.map((value, k) => Math.min(this.size[k], Math.max(0, value)));
    const margin = 24;
    this.onPage(this.at).forEach((value, k) => {
      const room = k ? this.high : this.wide;
      if (value < margin) this.origin[k] += margin - value;
      if (value > room - margin) this.origin[k] -= value - room + margin;
    });
    this.clamp();
    this.draw();
    this.moved();
  }

  step(across, down) { this.go([this.at[0] + across, this.at[1] + down]); }

  down(event) {
    if (event.button > 1) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.drag = { from: [event.clientX, event.clientY], far: event.button === 1, button: event.button };
  }

  move(event) {
    if (!this.drag) {
      const place = this.place(event);
      if (this.inside(place)) { this.at = place; this.draw(); this.moved(); }
      return;
    }
    const { from } = this.drag;
    const [across, down] = [event.clientX - from[0], event.clientY - from[1]];
    if (!this.drag.far && Math.hypot(across, down) < 5) return;
    this.drag.far = true;
    this.drag.from = [event.clientX, event.clientY];
    this.canvas.classList.add("panning");
    this.pan(across, down);
  }

  up(event) {
    const drag = this.drag;
    this.drag = null;
    this.canvas.classList.remove("panning");
    if (!drag || drag.far || drag.button !== 0) return;
    const place = this.place(event);
    if (!this.inside(place)) return;
    this.at = place;
    this.clicked(place);
  }

  draw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => { this.asked = false; this.paint(); });
  }

  paint() {
    const pen = this.canvas.getContext("2d");
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    pen.clearRect(0, 0, this.wide, this.high);
    const [width, height] = this.size;
    const [left, top] = this.origin;
    if (this.picture) {
      pen.imageSmoothingEnabled = this.scale < 1.5;
      pen.imageSmoothingQuality = "high";
      pen.drawImage(this.picture, left, top, width * this.scale, height * this.scale);
    } else {
      pen.fillStyle = colour("--sunken");
      pen.fillRect(left, top, width * this.scale, height * this.scale);
    }
    for (const mark of this.marks) this.paintMark(pen, mark);
    if (this.picture) this.cross(pen);
    this.magnify();
  }

  cross(pen) {
    // Lines lie on pixels of the screen, or they would be blurred over two; they end with the picture.
    const [x, y] = this.onPage(this.at).map(value => Math.floor(value) + 0.5);
    const ends = [0, 1].map(k => [Math.max(0, this.origin[k]),
      Math.min(k ? this.high : this.wide, this.origin[k] + this.size[k] * this.scale)]);
    const [[left, right], [top, bottom]] = ends;
    const gap = Math.max(9, Math.min(40, this.scale * 1.5));
    const lines = new Path2D();
    for (const [x1, y1, x2, y2] of [[left, y, x - gap, y], [x + gap, y, right, y], [x, top, x, y - gap], [x, y + gap, x, bottom]]) {
      // Near the edge there is no room for a line.
      if (x2 < x1 || y2 < y1) continue;
      lines.moveTo(x1, y1);
      lines.lineTo(x2, y2);
    }
    pen.strokeStyle = "rgba(0, 0, 0, .55)";
    pen.lineWidth = 3;
    pen.stroke(lines);
    pen.strokeStyle = "#fff";
    pen.lineWidth = 1;
    pen.stroke(lines);
    pen.fillStyle = "#fff";
    pen.strokeStyle = "rgba(0, 0, 0, .7)";
    pen.beginPath();
    pen.arc(x, y, 1.75, 0, 2 * Math.PI);
    pen.fill();
    pen.stroke();
  }

  paintMark(pen, { place, name, colour: ink, active }) {
    const [x, y] = this.onPage(place);
    for (const [wide, stroke] of [[5, "rgba(0, 0, 0, .6)"], [2.5, ink]]) {
      pen.strokeStyle = stroke;
      pen.lineWidth = active ? wide : wide * 0.7;
      pen.beginPath();
      pen.arc(x, y, 9, 0, 2 * Math.PI);
      pen.moveTo(x - 4, y);
      pen.lineTo(x + 4, y);
      pen.moveTo(x, y - 4);
      pen.lineTo(x, y + 4);
      pen.stroke();
    }
    if (!name) return;
    pen.font = "600 12px system-ui, sans-serif";
    const wide = pen.measureText(name).width;
    pen.fillStyle = "rgba(0, 0, 0, .65)";
    pen.beginPath();
    pen.roundRect(x + 9, y - 30, wide + 12, 20, 5);
    pen.fill();
    pen.fillStyle = "#fff";
    pen.textBaseline = "middle";
    pen.fillText(name, x + 15, y - 19.5);
  }

  /** The surroundings of the crosshair, each pixel large. */
  magnify() {
    const { width, height } = this.lens.getBoundingClientRect();
    const side = Math.round(Math.min(width, height) * this.ratio);
    if (!side) return;
    if (this.lens.width !== side) { this.lens.width = side; this.lens.height = side; }
    const pen = this.lens.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.fillStyle = colour("--sunken");
    pen.fillRect(0, 0, side, side);
    if (!this.picture) return;
    const scale = LENS * this.ratio;
    const [x, y] = this.at;
    pen.imageSmoothingEnabled = false;
    pen.drawImage(this.picture, side / 2 - x * scale, side / 2 - y * scale, this.size[0] * scale, this.size[1] * scale);
    for (const [wide, stroke] of [[3 * this.ratio, "rgba(0, 0, 0, .55)"], [this.ratio, "#fff"]]) {
      pen.strokeStyle = stroke;
      pen.lineWidth = wide;
      pen.beginPath();
      const gap = scale * 0.75;
      for (const [a, b] of [[0, side / 2 - gap], [side / 2 + gap, side]]) {
        pen.moveTo(a, side / 2);
        pen.lineTo(b, side / 2);
        pen.moveTo(side / 2, a);
        pen.lineTo(side / 2, b);
      }
      pen.stroke();
    }
    pen.fillStyle = "#fff";
    pen.fillRect(side / 2 - this.ratio, side / 2 - this.ratio, 2 * this.ratio, 2 * this.ratio);
  }
}
