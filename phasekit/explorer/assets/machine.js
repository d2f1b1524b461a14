// The newest orbit in time: its time history, its dot, and the machine that moves as it does.

const STEP = 0.06; // of a fourth-order step, in times that the system needs
const MOST_STEPS = 2400;

// Rows of time, coordinate and velocity: three periods, or as long as there is something to see.
function timeHistory(pot, [x, v], damping, view) {
  const speed = Math.abs(v) + Math.sqrt(2 * Math.max(0, pot.V(x) - view.least));
  const rate = Math.sqrt(pot.size) + damping + (TWO_PI * speed) / (pot.circle ? pot.period : view.high - view.low);
  const { period } = damping > 0 ? {} : pot.orbit(x, v);
  const long = damping > 0 ? 8 / damping + 20 / rate : Number.isFinite(period) ? 3 * period : 40 / rate;
  const length = Math.min(long, (STEP * MOST_STEPS) / rate);
  const count = Math.max(400, Math.ceil((length * rate) / STEP));
  const middle = 0.5 * (view.low + view.high);
  const away = (y, w) => !Number.isFinite(y + w) || (!pot.circle && Math.abs(y - middle) > 2 * (view.high - view.low));
  const points = path((y, w) => -pot.slope(y) - damping * w, x, v, length / count, count, away);
  const rows = [];
  points.forEach(([y, w], i) => {
    if (Number.isFinite(y + w)) rows.push([(i * length) / count, y, w]);
  });
  return { length, rows };
}

const SERIES = ["x", "v"];
function drawSeries(plot, scene) {
  const { rows, length } = scene.history;
  const k = 1 + SERIES.indexOf(state.series);
  let [low, high] = rows.length ? [Infinity, -Infinity] : [-1, 1];
  for (const row of rows) {
    low = Math.min(low, row[k]);
    high = Math.max(high, row[k]);
  }
  const margin = 0.06 * (high - low) || 0.1 * (Math.abs(high) || 1);
  const angle = state.series === "x";
  plot.begin([0, length], [low - margin, high + margin], { x: LAW.kind === "trigonometric" ? "t, s" : "t", y: angle ? scene.words.x : scene.words.v, yScale: angle ? scene.scale : "" });
  plot.style("orbit", 1.6);
  plot.curve(rows, 0, [0, k]);
  if (rows.length) plot.cross(clock.t, null);
  plot.end();
}

// What moves, at a row of the time history: the disk on its shaft, or a point on its circle.
function drawMachine(plot, row) {
  plot.clear();
  const { c, width: w, height: h } = plot;
  c.translate(w / 2, h / 2);
  c.lineJoin = c.lineCap = "round";
  const draw = (points, color, width, dash = []) => {
    c.strokeStyle = paint(color);
    c.lineWidth = width;
    c.setLineDash(dash);
    c.beginPath();
    points.forEach(([x, y], i) => c[i ? "lineTo" : "moveTo"](x, y));
    c.stroke();
  };
  const spot = ([x, y], color, radius) => {
    c.fillStyle = paint(color);
    c.beginPath();
    c.arc(x, y, radius, 0, TWO_PI);
    c.fill();
  };
  const size = 0.44 * Math.min(w, h);
  if (FACTS.machine) drawDisk(c, draw, spot, size, row);
  else {
    const place = [0.85 * size * Math.sin(row[1]), 0.85 * size * Math.cos(row[1])];
    draw(Array.from({ length: 73 }, (_, i) => [0.85 * size * Math.sin((TWO_PI * i) / 72), 0.85 * size * Math.cos((TWO_PI * i) / 72)]), "rule", 1.2);
    draw([[0, 0], [0, 0.85 * size]], "rule", 1, [3, 4]);
    draw([[0, 0], place], "muted", 2.5);
    spot([0, 0], "muted", 3);
    spot(place, "orbit", 8);
  }
}

// The disk on its shaft, which the carrier turns about the vertical: O2 at (0, a, 0) of the carrier, the shaft along x.
function drawDisk(c, draw, spot, size, [t, phi]) {
  const value = (name) => state.values[NAMES.indexOf(name)];
  const [beta, e, a, r] = ["beta", "e", "a", "r"].map(value);
  const half = value("half_span") ?? 1.6 * r;
  const reach = Math.max(Math.hypot(a, half), Math.abs(a) + e + r) || 1;
  const turn = (value("omega1") * t) % TWO_PI;
  const [s, k] = [Math.sin(turn), Math.cos(turn)];
  const seen = ([x, y, z]) => {
    const [u, v] = [x * k - y * s, x * s + y * k];
    return [(size / reach) * (0.82 * u + 0.57 * v), -(size / reach) * (0.95 * z - 0.31 * (0.82 * v - 0.57 * u))];
  };
  const floor = -0.95 * (r + e);
  draw([[0, 0, 1.1 * floor], [0, 0, -1.1 * floor]].map(seen), "muted", 1.2, [7, 4, 2, 4]);
  for (const side of [-half, half]) draw([[0, 0, floor], [side, a, floor], [side, a, 0]].map(seen), "muted", 3);
  draw([[-half, a, 0], [half, a, 0]].map(seen), "ink", 4);
  // Directions in the plane of the disk: towards the mass center, and across.
  const [d, q] = [[Math.cos(beta), Math.sin(beta) * Math.sin(phi), -Math.sin(beta) * Math.cos(phi)], [0, Math.cos(phi), Math.sin(phi)]];
  const at = (u, v) => seen([u * d[0] + v * q[0], a + u * d[1] + v * q[1], u * d[2] + v * q[2]]);
  c.beginPath();
  for (let i = 0; i <= 72; i++) c[i ? "lineTo" : "moveTo"](...at(e + r * Math.cos((TWO_PI * i) / 72), r * Math.sin((TWO_PI * i) / 72)));
  c.globalAlpha = 0.3;
  c.fillStyle = paint("orbit");
  c.fill();
  c.globalAlpha = 1;
  c.strokeStyle = paint("orbit");
  c.lineWidth = 2;
  c.setLineDash([]);
  c.stroke();
  draw([at(0, 0), at(e + r, 0)], "orbit", 1.2);
  for (const side of [-half, half]) spot(seen([side, a, 0]), "accent", 5);
  spot(at(0, 0), "ink", 3);
  spot(at(e, 0), "separatrix", 5);
}
