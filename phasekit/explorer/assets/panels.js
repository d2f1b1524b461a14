// The pictures: portrait, well, bifurcation diagram, parameter map, bearing force.

const LEVELS = 3; // drawn between neighboring critical energies
const SAMPLES = 90; // of a level curve on one stretch

// Stretches of a window where a level of energy is not below the potential.
function arcs(pot, energy, low, high) {
  const depth = (x) => energy - pot.V(x);
  const slope = (x) => -pot.slope(x);
  const nodes = [low, ...pot.points.map((one) => one.x).filter((x) => x > low && x < high), high];
  const found = [];
  let open = depth(low) >= 0 ? low : null;
  for (let i = 1; i < nodes.length; i++) {
    const [a, b] = [nodes[i - 1], nodes[i]];
    const [da, db] = [depth(a), depth(b)];
    if (da < 0 && db >= 0) open = root(depth, slope, a, b, da);
    if (da >= 0 && db < 0) {
      found.push([open, root(depth, slope, a, b, 1)]);
      open = null;
    }
  }
  if (open !== null) found.push([open, high]);
  return found;
}

// The upper half of a level curve on a stretch, dense at its ends.
function half(pot, energy, [a, b]) {
  const points = [];
  for (let i = 0; i <= SAMPLES; i++) {
    const x = a + (b - a) * Math.sin((Math.PI * i) / (2 * SAMPLES)) ** 2;
    points.push([x, Math.sqrt(2 * Math.max(0, energy - pot.V(x)))]);
  }
  return points;
}

const mirrored = (points) => points.map(([x, v]) => [x, -v]);

// What portrait and well show: a stretch of the coordinate, speeds and energies.
function view(pot, orbits) {
  const [low, high] = pot.window();
  let [least, most] = [Infinity, -Infinity];
  for (let i = 0; i <= 200; i++) {
    const V = pot.V(low + ((high - low) * i) / 200);
    if (V < least) least = V;
    if (V > most) most = V;
  }
  pot.points.forEach((one) => (least = Math.min(least, one.energy)));
  const saddles = pot.points.filter((one) => one.kind !== CENTER).map((one) => one.energy);
  const whole = pot.circle && !pot.torque;
  const top = whole || !saddles.length ? most : Math.max(...saddles);
  let speed = Math.sqrt(2 * Math.max(top - least, 0)) * (whole || saddles.length ? 1.45 : 1);
  for (const one of orbits) {
    const fastest = Math.sqrt(2 * Math.max(0, 0.5 * one[1] ** 2 + pot.V(one[0]) - least));
    if (Number.isFinite(fastest)) speed = Math.max(speed, 1.05 * Math.min(fastest, 20 * (speed || 1)));
  }
  if (!(speed > 0)) speed = 1;
  return { low, high, least, most, top, speed };
}

// Energies of the curves that fill the portrait.
function levels(pot, { least, top, speed }) {
  const critical = [...new Set([least, ...pot.points.map((one) => one.energy).sort((a, b) => a - b), top])];
  critical.sort((a, b) => a - b);
  const found = [];
  for (let i = 1; i < critical.length; i++) {
    const [a, b] = [critical[i - 1], critical[i]];
    if (b - a < 1e-6 * (top - least)) continue;
    for (let k = 1; k <= LEVELS; k++) found.push(a + (b - a) * (k / (LEVELS + 1)) ** 1.4);
  }
  const above = least + 0.5 * speed * speed;
  for (let k = 1; k <= 4; k++) found.push(top + (above - top) * (k / 4.5) ** 1.3);
  return found;
}

function drawPortrait(plot, pot, scene) {
  const { low, high, speed } = scene.view;
  plot.begin([low, high], [-speed, speed], { x: scene.words.x, y: scene.words.v, xScale: scene.scale });
  scene.basins?.draw(plot);
  if (scene.damping > 0) drawStreams(plot, pot, scene);
  else {
    plot.style("level", 1);
    for (const energy of levels(pot, scene.view)) {
      for (const arc of arcs(pot, energy, low, high)) {
        const points = half(pot, energy, arc);
        plot.curve(points);
        plot.curve(mirrored(points));
      }
    }
    drawSeparatrices(plot, pot, scene);
  }
  plot.style("orbit", 2.2);
  scene.orbits.forEach((one, i) => {
    plot.c.globalAlpha = i === scene.orbits.length - 1 ? 1 : 0.55;
    drawOrbit(plot, pot, scene, one, scene.curves[i]);
    plot.style("orbit", 2.2);
  });
  plot.c.globalAlpha = 1;
  for (const one of pot.points) plot.dot(one.x, 0, one.kind);
  if (scene.cursor) plot.cross(scene.cursor[0], scene.cursor[1], "ink");
  plot.end();
}

function drawSeparatrices(plot, pot, { view: { low, high } }) {
  plot.style("separatrix", 2);
  for (const { saddle, left, right } of pot.separatrices()) {
    for (const [one, side] of [[left, -1], [right, 1]]) {
      const reach = { winding: pot.period * side, unbounded: side > 0 ? high - saddle.x : low - saddle.x };
      const end = saddle.x + (reach[one.kind] ?? one.offset);
      const points = half(pot, saddle.energy, [saddle.x, end]);
      const turns = pot.circle && !pot.torque ? [-pot.period, 0, pot.period] : [0];
      for (const shift of turns) {
        plot.curve(points, shift);
        plot.curve(mirrored(points), shift);
      }
    }
  }
}

// With damping: what comes out of the saddles and goes into them, and some streams.
function drawStreams(plot, pot, { view: { low, high, speed }, damping }) {
  const force = (x, v) => -pot.slope(x) - damping * v;
  const rate = Math.sqrt(pot.size) + damping;
  const stop = (x, v) =>
    !(Math.abs(v) < 2 * speed) ||
    Math.abs(x - 0.5 * (low + high)) > 3.5 * (high - low) ||
    (Math.abs(v) < 1e-5 * speed && Math.abs(pot.slope(x)) < 1e-3 * speed * rate);
  plot.style("level", 1);
  for (let i = 0; i < 6; i++) {
    for (let j = 0; j < 6; j++) {
      const x = low + ((high - low) * (i + (j % 2 ? 0.25 : 0.75))) / 6;
      const v = speed * (-0.95 + (1.9 * j) / 5);
      plot.curve(wrapped(pot, path(force, x, v, 0.08 / rate, 60, stop)));
    }
  }
  for (const saddle of pot.points.filter((one) => one.kind === SADDLE)) {
    const root2 = Math.sqrt(0.25 * damping * damping - saddle.curvature);
    for (const [way, width] of [[1, 1.4], [-1, 2.2]]) {
      const exponent = -0.5 * damping + way * root2;
      plot.style("separatrix", width, way > 0 ? [5, 3] : []);
      for (const side of [-1, 1]) {
        const d = side * 1e-4 * (high - low);
        plot.curve(wrapped(pot, path(force, saddle.x + d, d * exponent, (way * 0.09) / rate, 320, stop)));
      }
    }
  }
}

// A path on the circle, cut where it leaves the window.
function wrapped(pot, points) {
  if (!pot.circle || pot.torque) return points;
  const out = [];
  let turn = null;
  for (const [x, v] of points) {
    const now = Math.floor((x - pot.ends[0]) / pot.period);
    if (turn !== null && now !== turn) {
      out.push([x - turn * pot.period, v], [NaN, NaN]);
      if (out.length > 2) {
        const [y, w] = out[out.length - 3];
        out.push([y + (turn - now) * pot.period, w]);
      }
    }
    out.push([x - now * pot.period, v]);
    turn = now;
  }
  return out;
}

// States along an orbit, for pictures and tables.
function orbitCurve(pot, [x, v], damping, view) {
  if (damping > 0) {
    const rate = Math.sqrt(pot.size) + damping + Math.abs(v);
    const far = 6 * (view.high - view.low);
    const away = (y, w) => !(Math.abs(w) < 1e3 * view.speed && Math.abs(y - x) < far) && !pot.circle;
    const settled = (y, w) => Math.abs(w) < 1e-4 * view.speed && Math.abs(pot.slope(y)) < 1e-4 * view.speed * rate;
    const stop = (y, w) => away(y, w) || settled(y, w);
    const count = Math.min(3000, Math.ceil((30 * rate) / damping / 0.08) + 400);
    return path((y, w) => -pot.slope(y) - damping * w, x, v, 0.08 / rate, count, stop);
  }
  const orbit = pot.orbit(x, v);
  const energy = orbit.energy;
  if (orbit.kind === "equilibrium") return [[x, 0]];
  if (orbit.kind === "libration") {
    const kinetic = (y) => Math.max(0, 0.5 * v * v - pot.rise(x, y - x));
    const upper = half({ V: (y) => energy - kinetic(y) }, energy, [orbit.low, orbit.high]);
    return [...upper, ...mirrored(upper).reverse()];
  }
  const sign = v < 0 ? -1 : 1;
  if (orbit.kind === "rotation") {
    const [a, b] = pot.ends;
    return half(pot, energy, [a, b]).map(([y, w]) => [y, sign * w]);
  }
  const arc = arcs(pot, energy, view.low, view.high).find(([a, b]) => a <= x && x <= b) ?? [x, x];
  const upper = half(pot, energy, arc);
  return v === 0 || orbit.kind === "unbounded" ? [...upper, [NaN, NaN], ...mirrored(upper)] : upper.map(([y, w]) => [y, sign * w]);
}

function drawOrbit(plot, pot, scene, one, points) {
  if (scene.damping > 0) plot.curve(wrapped(pot, points));
  else {
    const turns = pot.circle && !pot.torque ? [-pot.period, 0, pot.period] : [0];
    for (const shift of turns) plot.curve(points, shift);
  }
  const [x, v] = wrapped(pot, [one])[0];
  plot.c.setLineDash([]);
  plot.c.beginPath();
  plot.c.arc(plot.px(x), plot.py(v), 3, 0, TWO_PI);
  plot.c.fill();
}

function drawWell(plot, pot, scene) {
  const { low, high, least, top, speed } = scene.view;
  const above = Math.min(Math.max(top + 0.12 * (top - least), least + 0.5 * speed * speed * 0.6), scene.view.most);
  const span = above - least || 1;
  plot.begin([low, high], [least - 0.06 * span, above + 0.08 * span], { x: scene.words.x, y: scene.words.V, xScale: scene.scale });
  for (const { saddle } of pot.separatrices()) {
    plot.style("separatrix", 1, [4, 3]);
    plot.curve([[low, saddle.energy], [high, saddle.energy]]);
  }
  plot.style("orbit", 1.6);
  for (const [x, v] of scene.orbits) {
    const energy = 0.5 * v * v + pot.V(x);
    for (const [a, b] of arcs(pot, energy, low, high)) plot.curve([[a, energy], [b, energy]]);
  }
  plot.style("ink", 2);
  plot.curve(Array.from({ length: 241 }, (_, i) => low + ((high - low) * i) / 240).map((x) => [x, pot.V(x)]));
  for (const one of pot.points) plot.dot(one.x, one.energy, one.kind);
  if (scene.now) plot.dot(scene.now[0], pot.V(scene.now[0]), "orbit", 6);
  plot.end();
}

// The zeros of V' over a parameter: squares in which it changes sign, cut by straight lines.
function drawDiagram(plot, scene, make) {
  const { low, high } = scene.view;
  const [a, b] = scene.range;
  plot.begin([a, b], [low, high], { x: scene.axis, y: scene.words.x, xScale: scene.axisScale, yScale: scene.scale });
  const [columns, rows] = [150, 90];
  const made = Array.from({ length: columns + 1 }, (_, i) => make(a + ((b - a) * i) / columns));
  const dy = (high - low) / rows;
  const grid = made.map(({ slope }) => {
    const column = new Float64Array(rows + 1);
    for (let j = 0; j <= rows; j++) column[j] = slope(low + dy * j);
    return column;
  });
  const stretches = { solid: [], dashed: [] };
  for (let i = 0; i < columns; i++) {
    const [left, right] = [grid[i], grid[i + 1]];
    for (let j = 0; j < rows; j++) {
      const below = left[j] < 0;
      if (below === right[j] < 0 && below === right[j + 1] < 0 && below === left[j + 1] < 0) continue;
      const corners = [grid[i][j], grid[i + 1][j], grid[i + 1][j + 1], grid[i][j + 1]];
      for (const [p, q] of crossings(corners)) {
        const at = ([u, w]) => [a + ((b - a) * (i + u)) / columns, low + dy * (j + w)];
        const middle = at([0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])]);
        const bend = made[i].bend(middle[1]);
        stretches[bend > 0 ? "solid" : "dashed"].push([at(p), at(q)]);
      }
    }
  }
  plot.style("center", 2);
  plot.c.beginPath();
  stretches.solid.forEach((one) => segment(plot, one));
  plot.c.stroke();
  plot.style("saddle", 2);
  plot.c.beginPath();
  stretches.dashed.forEach((one) => {
    const [du, dw] = [plot.px(one[1][0]) - plot.px(one[0][0]), plot.py(one[1][1]) - plot.py(one[0][1])];
    const where = Math.abs(du) > Math.abs(dw) ? plot.px(one[0][0]) : plot.py(one[0][1]);
    if (where % 9 < 5.5) segment(plot, one);
  });
  plot.c.stroke();
  if (scene.at >= a && scene.at <= b) {
    plot.cross(scene.at, null, "muted");
    for (const one of scene.pot.points) plot.dot(scene.at, one.x, one.kind);
  }
  plot.end();
}

function segment(plot, [p, q]) {
  plot.c.moveTo(plot.px(p[0]), plot.py(p[1]));
  plot.c.lineTo(plot.px(q[0]), plot.py(q[1]));
}

// Where a function that is known at the corners of a unit square vanishes on its edges, in pairs.
const CORNERS = [[0, 0], [1, 0], [1, 1], [0, 1]];
function crossings(values) {
  const found = [];
  for (let k = 0; k < 4; k++) {
    const [f, g] = [values[k], values[(k + 1) % 4]];
    if (f < 0 === g < 0 || !Number.isFinite(f - g)) continue;
    const t = f / (f - g);
    const [p, q] = [CORNERS[k], CORNERS[(k + 1) % 4]];
    found.push([p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]);
  }
  return found.length === 4 ? [[found[0], found[1]], [found[2], found[3]]] : found.length === 2 ? [found] : [];
}

// The number of equilibria over two parameters, and the curve on which it changes, by halving.
class ParameterMap {
  constructor(count, x, y, columns, rows) {
    Object.assign(this, { count, x, y, columns, rows, counts: [], edges: [], next: 0 });
  }

  // Goes on for some milliseconds; true when it is whole.
  work(milliseconds) {
    const start = performance.now();
    while (this.next <= this.columns) {
      const i = this.next++;
      this.counts.push(Int8Array.from({ length: this.rows + 1 }, (_, j) => this.count(...this.place(i, j))));
      if (i > 0) this.trace(i - 1);
      if (performance.now() - start > milliseconds) break;
    }
    return this.next > this.columns;
  }

  place(i, j) {
    const at = ([a, b], t) => a + (b - a) * t;
    return [at(this.x, i / this.columns), at(this.y, j / this.rows)];
  }

  trace(i) {
    for (let j = 0; j < this.rows; j++) {
      const nodes = CORNERS.map(([u, w]) => [i + u, j + w]);
      const points = [];
      for (let k = 0; k < 4; k++) {
        const [p, q] = [nodes[k], nodes[(k + 1) % 4]];
        const [m, n] = [this.counts[p[0]][p[1]], this.counts[q[0]][q[1]]];
        if (m !== n && m >= 0 && n >= 0) points.push(this.halve(p, q, m));
      }
      for (let k = 0; k + 1 < points.length; k += 2) this.edges.push([points[k], points[k + 1]]);
    }
  }

  halve(p, q, m) {
    let [low, high] = [0, 1];
    const at = (t) => this.place(p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]));
    for (let n = 0; n < this.halvings; n++) {
      const middle = 0.5 * (low + high);
      if (this.count(...at(middle)) === m) low = middle;
      else high = middle;
    }
    return at(0.5 * (low + high));
  }

  get halvings() {
    return this.columns > 100 ? 40 : 9;
  }

  draw(plot, scene) {
    plot.begin(this.x, this.y, { x: scene.xName, y: scene.yName, xScale: scene.xScale, yScale: scene.yScale });
    const [dx, dy] = [(this.x[1] - this.x[0]) / this.columns, (this.y[1] - this.y[0]) / this.rows];
    let few = Infinity;
    for (const row of this.counts) for (const n of row) if (n >= 0 && n < few) few = n;
    plot.c.setLineDash([]);
    this.counts.forEach((row, i) => {
      const left = plot.px(this.x[0] + dx * (i - 0.5));
      const width = plot.px(this.x[0] + dx * (i + 0.5)) - left + 0.6;
      for (let j = 0; j <= this.rows; ) {
        let k = j;
        while (k <= this.rows && row[k] === row[j]) k++;
        if (row[j] >= 0) {
          plot.c.fillStyle = paint(row[j] <= few ? "two" : row[j] <= few + 2 ? "four" : "more");
          const top = plot.py(this.y[0] + dy * (k - 0.5));
          plot.c.fillRect(left, top, width, plot.py(this.y[0] + dy * (j - 0.5)) - top + 0.6);
        }
        j = k;
      }
    });
    plot.style("fold", 2);
    plot.c.beginPath();
    this.edges.forEach((one) => segment(plot, one));
    plot.c.stroke();
    plot.cross(scene.at[0], scene.at[1], "ink");
    plot.end();
  }
}

// Sizes of the forces at A2 and B2 along an orbit.
function forceCurves(law, p, points) {
  return points.map(([x, v]) => {
    if (!Number.isFinite(x)) return [NaN, NaN, NaN, NaN];
    const [ua, va, ub, vb, axial] = law.loads(p, x, v);
    return [x, v, Math.hypot(ua, va, axial), Math.hypot(ub, vb)];
  });
}

function drawForce(plot, rows, scene) {
  let most = 0;
  for (const row of rows) {
    for (const size of [row[2], row[3]]) if (Number.isFinite(size) && size > most) most = size;
  }
  plot.begin([scene.view.low, scene.view.high], [0, 1.08 * most || 1], { x: scene.words.x, y: "force, N", xScale: scene.scale });
  for (const [k, color] of [[2, "accent"], [3, "second"]]) {
    plot.style(color, 2, k === 3 ? [6, 3] : []);
    if (scene.damping > 0) plot.curve(wrapped(scene.pot, rows.map((row) => [row[0], row[k]])));
    else for (const shift of [-TWO_PI, 0, TWO_PI]) plot.curve(rows, shift, [0, k]);
  }
  plot.end();
}
