// Plots on canvases: axes, curves and marks in the colors of the page.

// Kinds of equilibria.
const CENTER = "center";
const SADDLE = "saddle";
const DEGENERATE = "degenerate";

const paints = new Map(); // cleared when the theme changes
function paint(name) {
  if (!paints.has(name)) {
    const style = getComputedStyle(document.documentElement);
    paints.set(name, style.getPropertyValue(`--${name}`).trim());
  }
  return paints.get(name);
}

// Numbers as people read them.
function digits(x, n = 6) {
  if (x === null || x === undefined || Number.isNaN(x)) return "–";
  if (!Number.isFinite(x)) return x > 0 ? "∞" : "−∞";
  const size = Math.abs(x);
  const text = size !== 0 && (size < 1e-4 || size >= 1e7) ? x.toExponential(n - 1) : String(Number(x.toPrecision(n)));
  return text.replace("-", "−");
}

function niceTicks(low, high, most) {
  const raw = (high - low) / most;
  const unit = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((k) => k * unit >= raw * (1 - 1e-9)) * unit;
  const ticks = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) ticks.push(i * step);
  return ticks.map((x) => [x, digits(Math.abs(x) < 1e-12 * step ? 0 : x, 4)]);
}

// Ticks of an axis; angles at parts of a turn.
function ticksOf(low, high, scale, most) {
  if (typeof scale === "number") return niceTicks(low / scale, high / scale, most).map(([x, text]) => [x * scale, text]);
  if (scale === "deg") {
    const ticks = niceTicks(low / (Math.PI / 180), high / (Math.PI / 180), most);
    const step = [1, 2, 5, 10, 15, 30, 45, 90, 180, 360].find((k) => (high - low) / (Math.PI / 180) / k <= most);
    if (!step || step < 10) return ticks.map(([x, text]) => [(x * Math.PI) / 180, `${text}°`]);
    const found = [];
    for (let i = Math.ceil(low / (Math.PI / 180) / step - 1e-9); i * step <= high / (Math.PI / 180) + 1e-9; i++) {
      found.push([(i * step * Math.PI) / 180, `${digits(i * step)}°`]);
    }
    return found;
  }
  if (scale === "rad" && high - low > 2 && high - low < 40) {
    const step = high - low > 4 * Math.PI ? Math.PI : Math.PI / 2;
    const found = [];
    for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9; i++) {
      const halves = Math.round((i * step) / (Math.PI / 2));
      const sign = halves < 0 ? "−" : "";
      const n = Math.abs(halves);
      const text = n % 2 ? `${n === 1 ? "" : n}π/2` : `${n === 2 ? "" : n / 2}π`;
      found.push([i * step, n ? sign + text : "0"]);
    }
    return found;
  }
  return niceTicks(low, high, most);
}

class Plot {
  constructor(canvas) {
    this.canvas = canvas;
    this.c = canvas.getContext("2d");
    this.box = null;
    [this.x, this.y] = [[0, 1], [0, 1]]; // until something is drawn
    // Asking for the size while the page changes costs a layout each time.
    new ResizeObserver(() => { this.box = null; }).observe(canvas);
  }

  // Clear, at the size that the canvas has on the screen.
  clear() {
    this.box ??= this.canvas.getBoundingClientRect();
    const { box } = this;
    const ratio = window.devicePixelRatio || 1;
    this.width = Math.max(160, box.width);
    this.height = Math.max(100, box.height);
    const [w, h] = [Math.round(this.width * ratio), Math.round(this.height * ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) [this.canvas.width, this.canvas.height] = [w, h];
    this.c.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.c.fillStyle = paint("card");
    this.c.fillRect(0, 0, this.width, this.height);
  }

  // Clear, and fix the ranges; `labels` are {x, y, xScale, yScale}.
  begin(x, y, labels) {
    this.clear();
    this.c.font = "12px system-ui, 'DejaVu Sans', sans-serif";
    [this.x, this.y, this.labels] = [x, y, labels];
    this.yTicks = ticksOf(...y, labels.yScale, Math.max(3, this.height / 45));
    const widest = Math.max(...this.yTicks.map(([, text]) => this.c.measureText(text).width), 10);
    this.left = widest + 26;
    this.right = this.width - 18;
    this.top = 8;
    this.bottom = this.height - 36;
    this.grid();
    this.c.save();
    this.c.beginPath();
    this.c.rect(this.left, this.top, this.right - this.left, this.bottom - this.top);
    this.c.clip();
  }

  grid() {
    const { c } = this;
    c.strokeStyle = paint("grid");
    c.fillStyle = paint("muted");
    c.lineWidth = 1;
    c.setLineDash([]);
    c.textAlign = "center";
    c.textBaseline = "top";
    for (const [x, text] of ticksOf(...this.x, this.labels.xScale, Math.max(3, this.width / 85))) {
      const px = this.px(x);
      this.line(px, this.top, px, this.bottom);
      c.fillText(text, px, this.bottom + 5);
    }
    c.fillText(this.labels.x, 0.5 * (this.left + this.right), this.bottom + 20);
    c.textAlign = "right";
    c.textBaseline = "middle";
    for (const [y, text] of this.yTicks) {
      const py = this.py(y);
      this.line(this.left, py, this.right, py);
      c.fillText(text, this.left - 5, py);
    }
    c.save();
    c.translate(9, 0.5 * (this.top + this.bottom));
    c.rotate(-Math.PI / 2);
    c.textAlign = "center";
    c.fillText(this.labels.y, 0, 0);
    c.restore();
  }

  end() {
    this.c.restore();
    this.c.setLineDash([]);
    this.c.strokeStyle = paint("rule");
    this.c.strokeRect(this.left, this.top, this.right - this.left, this.bottom - this.top);
  }

  px(x) {
    return this.left + ((x - this.x[0]) / (this.x[1] - this.x[0])) * (this.right - this.left);
  }

  py(y) {
    return this.bottom - ((y - this.y[0]) / (this.y[1] - this.y[0])) * (this.bottom - this.top);
  }

  // What lies under a point of the screen, within the axes.
  under(event) {
    const box = this.canvas.getBoundingClientRect();
    const u = (event.clientX - box.left - this.left) / (this.right - this.left);
    const w = (this.bottom - (event.clientY - box.top)) / (this.bottom - this.top);
    const inside = u >= 0 && u <= 1 && w >= 0 && w <= 1;
    const at = (r, t) => r[0] + (r[1] - r[0]) * Math.min(1, Math.max(0, t));
    return { x: at(this.x, u), y: at(this.y, w), inside };
  }

  line(x1, y1, x2, y2) {
    this.c.beginPath();
    this.c.moveTo(x1, y1);
    this.c.lineTo(x2, y2);
    this.c.stroke();
  }

  style(color, width = 1.2, dash = []) {
    this.c.strokeStyle = this.c.fillStyle = paint(color);
    this.c.lineWidth = width;
    this.c.setLineDash(dash);
    this.c.lineJoin = "round";
  }

  // Steps of less than a pixel, in which spirals end, would take most of the time. Of rows of
  // more than two numbers `k` says which are drawn.
  curve(points, shift = 0, k = [0, 1]) {
    const { c } = this;
    const [i, j] = k;
    c.beginPath();
    let down = false;
    let atX = 0;
    let atY = 0;
    for (let n = 0; n < points.length; n++) {
      const x = points[n][i];
      const y = points[n][j];
      if (!Number.isFinite(x + y)) {
        down = false;
        continue;
      }
      const px = this.px(x + shift);
      const py = this.py(y);
      if (down && Math.abs(px - atX) + Math.abs(py - atY) < 1) continue;
      if (down) c.lineTo(px, py);
      else c.moveTo(px, py);
      down = true;
      atX = px;
      atY = py;
    }
    c.stroke();
  }

  dot(x, y, kind, radius = 4.5) {
    const { c } = this;
    c.setLineDash([]);
    c.beginPath();
    if (kind === SADDLE) {
      const [px, py] = [this.px(x), this.py(y)];
      c.moveTo(px, py - radius - 1);
      c.lineTo(px + radius + 1, py);
      c.lineTo(px, py + radius + 1);
      c.lineTo(px - radius - 1, py);
      c.closePath();
    } else c.arc(this.px(x), this.py(y), radius, 0, TWO_PI);
    c.fillStyle = paint(kind);
    c.fill();
    c.lineWidth = 1.5;
    c.strokeStyle = paint("card");
    c.stroke();
  }

  // A cross of hairlines, where the keyboard or the system is.
  cross(x, y, color = "ink") {
    this.style(color, 1, [3, 3]);
    this.line(this.px(x), this.top, this.px(x), this.bottom);
    if (y !== null) {
      this.line(this.left, this.py(y), this.right, this.py(y));
      this.c.setLineDash([]);
      this.c.lineWidth = 2;
      this.c.beginPath();
      this.c.arc(this.px(x), this.py(y), 5, 0, TWO_PI);
      this.c.stroke();
    }
  }
}
