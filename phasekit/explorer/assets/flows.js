// Equations of n states: steps, motions, equilibria, eigenvalues, manifolds of saddles and limit cycles.

// Dormand's and Prince's pair of orders 5 and 4.
const NODES = [0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1];
const STAGES = [
  [],
  [1 / 5],
  [3 / 40, 9 / 40],
  [44 / 45, -56 / 15, 32 / 9],
  [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
  [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
  [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
];
const ERRORS = [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40];

class Stepper {
  constructor(rates, n) {
    Object.assign(this, { rates, n });
    this.k = Array.from({ length: 7 }, () => new Float64Array(n));
    this.y = new Float64Array(n);
    this.out = new Float64Array(n);
  }

  // One step from x, whose rates stand in k[0]; the new state is in `out`, its rates in k[6].
  step(x, t, h) {
    const { k, y, n, out } = this;
    for (let s = 1; s < 7; s++) {
      const row = STAGES[s];
      const to = s === 6 ? out : y;
      for (let i = 0; i < n; i++) {
        let sum = 0;
        for (let j = 0; j < s; j++) sum += row[j] * k[j][i];
        to[i] = x[i] + h * sum;
      }
      this.rates(to, t + NODES[s] * h, k[s]);
    }
  }

  error(x, h, scales, rtol) {
    let worst = 0;
    for (let i = 0; i < this.n; i++) {
      let sum = 0;
      for (let j = 0; j < 7; j++) sum += ERRORS[j] * this.k[j][i];
      const size = Math.max(Math.abs(x[i]), Math.abs(this.out[i]), scales[i]);
      worst = Math.max(worst, Math.abs(h * sum) / (rtol * size));
      if (Number.isNaN(sum)) return Infinity;
    }
    return worst;
  }

  // Whether stability, not accuracy, has bounded the step: h times the largest rate of decay, from the last two stages.
  get strained() {
    const { k, y, out, n, scales } = this;
    let [rates, gap] = [0, 0];
    for (let i = 0; i < n; i++) {
      rates += ((k[6][i] - k[5][i]) / scales[i]) ** 2;
      gap += ((out[i] - y[i]) / scales[i]) ** 2;
    }
    return gap > 0 && this.h * Math.sqrt(rates / gap) > 3.25;
  }

  twin() {
    return new this.constructor(this.rates, this.n);
  }
}

// Stiff motions: Rodas5P, as the library takes it, with its coefficients; each of eight stages solves a linear system.
class StiffStepper extends Stepper {
  constructor(rates, n) {
    super(rates, n);
    this.stages = Array.from({ length: 8 }, () => new Float64Array(n));
    [this.matrix, this.lu] = [new Float64Array(n * n), new Float64Array(n * n)];
    [this.drift, this.u, this.moved] = [new Float64Array(n), new Float64Array(n), new Float64Array(n)];
    this.pivots = new Int32Array(n);
  }

  // Derivatives by the states and by time at the start of a step; by differences where no formula is known.
  derivatives(x, t, h) {
    const { n, rates, k, u, moved, matrix, drift, out } = this;
    const from = k[0];
    if (rates.slopes) rates.slopes(x, t, matrix);
    else {
      u.set(x);
      for (let j = 0; j < n; j++) {
        const d = 1.5e-8 * Math.max(Math.abs(x[j]), Math.abs(h * from[j]), 1e-8);
        u[j] = x[j] + d;
        const step = u[j] - x[j];
        rates(u, t, moved);
        for (let i = 0; i < n; i++) matrix[i * n + j] = (moved[i] - from[i]) / step;
        u[j] = x[j];
      }
    }
    drift.fill(0);
    if (rates.steady) return;
    const d = 1e-6 * h;
    rates(x, t + d, moved);
    rates(x, t - d, out);
    for (let i = 0; i < n; i++) drift[i] = (moved[i] - out[i]) / (2 * d);
  }

  step(x, t, h) {
    const { gamma, a, c, times: nodes, rates: drifts } = FACTS.rodas;
    const { n, stages, matrix, lu, drift, u, k, out, pivots } = this;
    this.derivatives(x, t, h);
    for (let i = 0; i < n * n; i++) lu[i] = -matrix[i];
    for (let i = 0; i < n; i++) lu[i * n + i] += 1 / (gamma * h);
    this.whole = decompose(lu, pivots, n);
    let f = k[0];
    for (let s = 0; s < 8; s++) {
      const b = stages[s];
      u.set(x);
      for (let j = 0; j < s; j++) for (let i = 0; i < n; i++) u[i] += a[s][j] * stages[j][i];
      if (s > 0) {
        f = k[1];
        this.rates(u, t + nodes[s] * h, f);
      }
      for (let i = 0; i < n; i++) {
        b[i] = f[i] + h * drifts[s] * drift[i];
        for (let j = 0; j < s; j++) b[i] += (c[s][j] / h) * stages[j][i];
      }
      backward(lu, pivots, b, n);
    }
    for (let i = 0; i < n; i++) out[i] = u[i] + stages[7][i];
    this.rates(out, t + h, k[6]);
  }

  error(x, h, scales, rtol) {
    let worst = this.whole ? 0 : Infinity;
    for (let i = 0; i < this.n; i++) {
      // States that stay small, as those of reactions do, are hardly measured by the window.
      const size = Math.max(Math.abs(x[i]), Math.abs(this.out[i]), 1e-3 * scales[i]);
      worst = Math.max(worst, Math.abs(this.stages[7][i]) / (rtol * size));
      if (!Number.isFinite(this.stages[7][i] + this.k[6][i])) return Infinity;
    }
    return worst;
  }

  get strained() {
    return false;
  }
}

// Follows a motion from t0 to t1. After each step `each(t, x, before, h, stepper)` may return true to end it;
// `before` is where the step began. The end says why: "end", "stopped", "steps", "undefined".
function follow(rates, x0, t0, t1, { scales, rtol = 1e-8, most = 20000, each = null }) {
  const n = x0.length;
  let stepper = new Stepper(rates, n);
  let [strained, free, stiff] = [0, 0, false];
  const x = Float64Array.from(x0);
  const before = new Float64Array(n);
  let t = t0;
  const way = Math.sign(t1 - t0) || 1;
  rates(x, t, stepper.k[0]);
  let fast = 0;
  for (let i = 0; i < n; i++) fast = Math.max(fast, Math.abs(stepper.k[0][i]) / scales[i]);
  if (!Number.isFinite(fast)) return { t, x, why: "undefined", stiff };
  let h = Math.min(Math.abs(t1 - t0), fast > 0 ? 0.01 / fast : Math.abs(t1 - t0) / 100);
  const least = 1e-10 * h;
  for (let count = 0; count < most; count++) {
    const left = Math.abs(t1 - t);
    if (left <= 1e-14 * Math.abs(t1)) return { t, x, why: "end", stiff };
    const taken = h >= left * (1 - 1e-12) ? left : h;
    stepper.step(x, t, way * taken);
    const error = stepper.error(x, taken, scales, rtol);
    const factor = error > 0 ? Math.min(5, Math.max(0.2, 0.9 * error ** -0.2)) : 5;
    if (!(error <= 1)) {
      h = taken * (Number.isFinite(error) ? factor : 0.2);
      if (h < Math.max(1e-14 * Math.abs(t), least)) return { t, x, why: "undefined", stiff };
      continue;
    }
    before.set(x);
    x.set(stepper.out);
    const from = t;
    t = taken === left ? t1 : t + way * taken;
    if (each && each(t, x, before, from, way * taken, stepper)) return { t, x, why: "stopped", stiff };
    h = taken * factor;
    Object.assign(stepper, { h: taken, scales });
    // Fifteen strained steps, with fewer than six free ones in a row between them, are those of a stiff motion.
    if (stepper.strained) [strained, free] = [strained + 1, 0];
    else if (++free === 6) strained = 0;
    if (strained === 15 && !stiff) {
      const last = stepper.k[6];
      stepper = new StiffStepper(rates, n);
      stepper.k[6].set(last);
      stiff = true;
    }
    stepper.k[0].set(stepper.k[6]);
  }
  return { t, x, why: "steps", stiff };
}

// Where g vanishes within the step that began at `before`: the share of it, by steps of that size.
function located(stepper, before, from, h, g) {
  const other = stepper.twin();
  other.rates(before, from, other.k[0]);
  const at = (s) => {
    other.step(before, from, s * h);
    return g(other.out, other.k[6]);
  };
  let [a, b] = [0, 1];
  let [fa, fb] = [g(before, other.k[0]), at(1)];
  for (let i = 0; i < 60 && b - a > 1e-15; i++) {
    let s = (a * fb - b * fa) / (fb - fa);
    if (!(s > a && s < b)) s = 0.5 * (a + b);
    const f = at(s);
    if (f === 0) {
      [a, b] = [s, s];
      break;
    }
    if (f > 0 === fb > 0) {
      [b, fb] = [s, f];
      fa *= 0.5;
    } else {
      [a, fa] = [s, f];
      fb *= 0.5;
    }
    if (b - a < 1e-14) break;
  }
  const s = 0.5 * (a + b);
  at(s);
  return { share: s, x: Float64Array.from(other.out), rates: Float64Array.from(other.k[6]) };
}

// Rows of the factors of a matrix in its place, and which were exchanged; false where it is singular.
function decompose(a, pivots, n) {
  for (let c = 0; c < n; c++) {
    let pivot = c;
    for (let r = c + 1; r < n; r++) if (Math.abs(a[r * n + c]) > Math.abs(a[pivot * n + c])) pivot = r;
    pivots[c] = pivot;
    const head = a[pivot * n + c];
    if (!(Math.abs(head) > 0 && Math.abs(head) < Infinity)) return false;
    if (pivot !== c) for (let k = 0; k < n; k++) [a[c * n + k], a[pivot * n + k]] = [a[pivot * n + k], a[c * n + k]];
    for (let r = c + 1; r < n; r++) {
      const factor = (a[r * n + c] /= head);
      if (factor !== 0) for (let k = c + 1; k < n; k++) a[r * n + k] -= factor * a[c * n + k];
    }
  }
  return true;
}

function backward(a, pivots, b, n) {
  for (let c = 0; c < n; c++) {
    const other = b[pivots[c]];
    b[pivots[c]] = b[c];
    b[c] = other;
  }
  for (let r = 1; r < n; r++) for (let k = 0; k < r; k++) b[r] -= a[r * n + k] * b[k];
  for (let r = n - 1; r >= 0; r--) {
    for (let k = r + 1; k < n; k++) b[r] -= a[r * n + k] * b[k];
    b[r] /= a[r * n + r];
  }
}

// Solves a x = b in place, by rows of one array; false where a is singular.
function solve(a, b, n) {
  const pivots = new Int32Array(n);
  if (!decompose(a, pivots, n)) return false;
  backward(a, pivots, b, n);
  return true;
}

// Eigenvalues [re, im] of a real matrix, by QR steps with Wilkinson's shifts on its complex Hessenberg form.
function eigenvalues(matrix, n) {
  if (n === 1) return [[matrix[0], 0]];
  if (n === 2) {
    const [a, b, c, d] = matrix;
    const half = 0.5 * (a + d);
    const gap = 0.25 * (a - d) ** 2 + b * c;
    if (gap < 0) return [[half, Math.sqrt(-gap)], [half, -Math.sqrt(-gap)]];
    const far = half + (half >= 0 ? 1 : -1) * Math.sqrt(gap);
    const near = far !== 0 ? (a * d - b * c) / far : 0;
    return [[Math.max(far, near), 0], [Math.min(far, near), 0]];
  }
  const re = Array.from({ length: n }, (_, i) => Float64Array.from({ length: n }, (_, j) => matrix[i * n + j]));
  const im = Array.from({ length: n }, () => new Float64Array(n));
  for (let c = 0; c < n - 2; c++) hessenberg(re, n, c);
  const found = [];
  const size = Math.hypot(...matrix) || 1;
  for (let m = n - 1; m >= 0;) {
    if (m === 0) {
      found.push([re[0][0], im[0][0]]);
      break;
    }
    let small = 0;
    for (let i = 0; i < 300; i++) {
      for (small = m; small > 0; small--) {
        const here = Math.hypot(re[small][small - 1], im[small][small - 1]);
        const beside = Math.hypot(re[small][small], im[small][small]) + Math.hypot(re[small - 1][small - 1], im[small - 1][small - 1]);
        if (here <= 1e-16 * (beside || size)) break;
      }
      if (small === m) break;
      qrStep(re, im, small, m, i % 11 === 10);
    }
    found.push([re[m][m], im[m][m]]);
    m -= 1;
  }
  // Eigenvalues of a real matrix that are real, or come in pairs, but for rounding.
  const whole = found.map(([x, y]) => [x, Math.abs(y) < 1e-13 * size ? 0 : y]);
  const below = whole.filter((one) => one[1] < 0);
  for (const one of whole.filter(([, y]) => y > 0)) {
    if (!below.length) break;
    const far = (other) => Math.hypot(one[0] - other[0], one[1] + other[1]);
    const other = below.reduce((best, next) => (far(next) < far(best) ? next : best));
    below.splice(below.indexOf(other), 1);
    one[0] = other[0] = 0.5 * (one[0] + other[0]);
    one[1] = 0.5 * (one[1] - other[1]);
    other[1] = -one[1];
  }
  return whole.sort((one, other) => other[0] - one[0] || other[1] - one[1]);
}

function hessenberg(h, n, c) {
  let norm = 0;
  for (let i = c + 1; i < n; i++) norm = Math.hypot(norm, h[i][c]);
  if (norm === 0) return;
  const v = new Float64Array(n);
  for (let i = c + 1; i < n; i++) v[i] = h[i][c];
  v[c + 1] += (v[c + 1] >= 0 ? 1 : -1) * norm;
  let square = 0;
  for (let i = c + 1; i < n; i++) square += v[i] * v[i];
  for (let j = 0; j < n; j++) {
    let sum = 0;
    for (let i = c + 1; i < n; i++) sum += v[i] * h[i][j];
    for (let i = c + 1; i < n; i++) h[i][j] -= (2 * sum * v[i]) / square;
  }
  for (let i = 0; i < n; i++) {
    let sum = 0;
    for (let j = c + 1; j < n; j++) sum += h[i][j] * v[j];
    for (let j = c + 1; j < n; j++) h[i][j] -= (2 * sum * v[j]) / square;
  }
}

const times = (a, b) => [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
function root2([x, y]) {
  const r = Math.hypot(x, y);
  const s = Math.sqrt(0.5 * (r + Math.abs(x)));
  if (s === 0) return [0, 0];
  return x >= 0 ? [s, y / (2 * s)] : [Math.abs(y) / (2 * s), y >= 0 ? s : -s];
}

function qrStep(re, im, low, high, odd) {
  const at = (i, j) => [re[i][j], im[i][j]];
  const [a, b, c, d] = [at(high - 1, high - 1), at(high - 1, high), at(high, high - 1), at(high, high)];
  const half = [0.5 * (a[0] - d[0]), 0.5 * (a[1] - d[1])];
  const square = times(half, half);
  const product = times(b, c);
  const far = root2([square[0] + product[0], square[1] + product[1]]);
  const one = [d[0] + half[0] + far[0], d[1] + half[1] + far[1]];
  const two = [d[0] + half[0] - far[0], d[1] + half[1] - far[1]];
  const nearer = Math.hypot(one[0] - d[0], one[1] - d[1]) < Math.hypot(two[0] - d[0], two[1] - d[1]);
  const shift = odd ? [d[0] + Math.hypot(...c), d[1]] : nearer ? one : two;
  for (let i = low; i <= high; i++) {
    re[i][i] -= shift[0];
    im[i][i] -= shift[1];
  }
  const turns = [];
  for (let i = low; i < high; i++) {
    const [x, y] = [at(i, i), at(i + 1, i)];
    const r = Math.hypot(...x, ...y);
    const [cos, sin] = r === 0 ? [[1, 0], [0, 0]] : [[x[0] / r, x[1] / r], [y[0] / r, y[1] / r]];
    turns.push([cos, sin]);
    for (let j = i; j <= high; j++) {
      const [u, v] = [at(i, j), at(i + 1, j)];
      const [p, q] = [times([cos[0], -cos[1]], u), times([sin[0], -sin[1]], v)];
      const [s, w] = [times(sin, u), times(cos, v)];
      re[i][j] = p[0] + q[0]; im[i][j] = p[1] + q[1];
      re[i + 1][j] = w[0] - s[0]; im[i + 1][j] = w[1] - s[1];
    }
  }
  for (let i = low; i < high; i++) {
    const [cos, sin] = turns[i - low];
    for (let j = low; j <= Math.min(high, i + 1); j++) {
      const [u, v] = [at(j, i), at(j, i + 1)];
      const [p, q] = [times(cos, u), times(sin, v)];
      const [s, w] = [times([sin[0], -sin[1]], u), times([cos[0], -cos[1]], v)];
      re[j][i] = p[0] + q[0]; im[j][i] = p[1] + q[1];
      re[j][i + 1] = w[0] - s[0]; im[j][i + 1] = w[1] - s[1];
    }
  }
  for (let i = low; i <= high; i++) {
    re[i][i] += shift[0];
    im[i][i] += shift[1];
  }
}

// A direction that the matrix multiplies by a real eigenvalue, by inverse iteration.
function eigenvector(matrix, n, value) {
  const size = Math.hypot(...matrix) || 1;
  let v = Float64Array.from({ length: n }, (_, i) => 1 + 0.37 * i);
  for (let k = 0; k < 3; k++) {
    const a = Float64Array.from(matrix);
    for (let i = 0; i < n; i++) a[i * n + i] -= value + 1e-12 * size;
    if (!solve(a, v, n)) break;
    const norm = Math.hypot(...v);
    v = v.map((x) => x / norm);
  }
  return v;
}

const [STABLE_NODE, UNSTABLE_NODE, STABLE_FOCUS, UNSTABLE_FOCUS] = ["stable node", "unstable node", "stable focus", "unstable focus"];
const attracts = (one) => one.kind === STABLE_NODE || one.kind === STABLE_FOCUS;

const MOST_STROBES = 20000; // of one motion

// The law at values of the parameters, in a box of states.
class System {
  constructor(law, p, states, conservative) {
    Object.assign(this, { law, p, states, conservative, n: law.n });
    this.low = states.map((one) => one.low);
    this.high = states.map((one) => one.high);
    this.scales = states.map((one) => one.high - one.low);
    this.turns = states.map((one) => one.period ?? 0);
    this.period = law.period ? law.period(p) : 0;
    this.timed = !law.period || (this.period > 0 && this.period < Infinity);
    this.rates = (x, t, out) => law.rates(x, p, t, out);
    this.rates.slopes = (x, t, out) => law.slopes(x, p, t, out);
    this.rates.steady = FACTS.time === null;
    this.f = new Float64Array(this.n);
    this.j = new Float64Array(this.n * this.n);
  }

  // What is zero at an equilibrium, in f; and its derivatives, in j.
  defect(x) {
    const { law, p, f, j, n } = this;
    if (!law.discrete) {
      law.rates(x, p, 0, f);
      law.slopes(x, p, 0, j);
      return;
    }
    let y = Float64Array.from(x);
    let whole = null;
    for (let k = 0; k < law.times; k++) {
      law.slopes(y, p, 0, j);
      whole = whole ? product(j, whole, n) : Float64Array.from(j);
      const next = new Float64Array(n);
      law.rates(y, p, 0, next);
      y = next;
    }
    for (let i = 0; i < n; i++) {
      f[i] = y[i] - x[i];
      if (this.turns[i]) f[i] -= this.turns[i] * Math.round(f[i] / this.turns[i]);
    }
    j.set(whole);
    for (let i = 0; i < n; i++) j[i * n + i] -= 1;
  }

  iterate(x, out) {
    const { law, p, n } = this;
    let y = x;
    for (let k = 0; k < law.times; k++) {
      const next = k === law.times - 1 ? out : new Float64Array(n);
      law.rates(y, p, 0, next);
      y = next;
    }
  }

  newton(start, tries = 40) {
    const { f, j, n, scales } = this;
    const x = Float64Array.from(start);
    let last = Infinity;
    for (let i = 0; i < tries; i++) {
      this.defect(x);
      const step = Float64Array.from(f);
      if (!solve(Float64Array.from(j), step, n)) return null;
      let size = 0;
      for (let k = 0; k < n; k++) size = Math.max(size, Math.abs(step[k]) / scales[k]);
      if (!Number.isFinite(size)) return null;
      const factor = size > 0.3 ? 0.3 / size : 1;
      for (let k = 0; k < n; k++) x[k] -= factor * step[k];
      if (size < 1e-14 || (size < 1e-11 && size >= last)) return x;
      last = size;
    }
    return last < 1e-7 ? x : null;
  }

  // Puts angles into the box.
  folded(x) {
    return x.map((value, i) => (this.turns[i] ? value - this.turns[i] * Math.floor((value - this.low[i]) / this.turns[i] + 1e-9) : value));
  }

  inside(x, more = 1e-9) {
    return x.every((value, i) => value >= this.low[i] - more * this.scales[i] && value <= this.high[i] + more * this.scales[i]);
  }

  gap(x, y) {
    let worst = 0;
    for (let i = 0; i < this.n; i++) {
      let d = x[i] - y[i];
      if (this.turns[i]) d -= this.turns[i] * Math.round(d / this.turns[i]);
      worst = Math.max(worst, Math.abs(d) / this.scales[i]);
    }
    return worst;
  }

  keep(found, start) {
    const x = this.newton(start);
    if (!x) return;
    const y = this.folded(x);
    if (this.inside(y) && !found.some((one) => this.gap(one, y) < 1e-6)) found.push(y);
  }

  // Equilibria, or fixed points of a map, from where some were and from a grid of `cells` (of more than two states: starts).
  equilibria(near = [], cells = 48) {
    if (this.law.period) return [];
    const found = [];
    near.forEach((x) => this.keep(found, x));
    if (this.n === 1) this.alongLine(found, 8 * cells);
    else if (this.n === 2) this.overPlane(found, cells);
    else for (let i = 0; i < cells; i++) this.keep(found, this.spread(i));
    return found.sort((one, other) => one[0] - other[0] || one[1] - other[1]).map((x) => this.described(x));
  }

  // The i-th of points that fill the box evenly.
  spread(i) {
    const primes = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89];
    return this.low.map((low, k) => {
      let [share, part, rest] = [0, 1, i + 1];
      while (rest > 0) {
        part /= primes[k];
        share += part * (rest % primes[k]);
        rest = Math.floor(rest / primes[k]);
      }
      return low + share * this.scales[k];
    });
  }

  alongLine(found, cells) {
    const at = (i) => [this.low[0] + (this.scales[0] * i) / cells];
    let last = NaN;
    for (let i = 0; i <= cells; i++) {
      this.defect(at(i));
      const value = this.f[0];
      if (value === 0 || value * last < 0) {
        const g = (x) => (this.defect([x]), this.f[0]);
        const x = value === 0 ? at(i)[0] : root(g, null, at(i - 1)[0], at(i)[0], last);
        this.keep(found, [x]);
      }
      last = value;
    }
    for (let i = 0; i < 12; i++) this.keep(found, at(((i + 0.5) * cells) / 12));
  }

  overPlane(found, cells) {
    const { values } = this.grid(cells);
    const side = cells + 1;
    for (let i = 0; i < cells; i++) {
      for (let j = 0; j < cells; j++) {
        const corner = [j * side + i, j * side + i + 1, (j + 1) * side + i, (j + 1) * side + i + 1];
        const crosses = (k) => {
          let [low, high] = [Infinity, -Infinity];
          for (const at of corner) {
            low = Math.min(low, values[2 * at + k]);
            high = Math.max(high, values[2 * at + k]);
          }
          return low <= 0 && high >= 0;
        };
        if (crosses(0) && crosses(1)) this.keep(found, [this.low[0] + ((i + 0.5) * this.scales[0]) / cells, this.low[1] + ((j + 0.5) * this.scales[1]) / cells]);
      }
    }
    for (let i = 0; i < 16; i++) this.keep(found, this.spread(i));
  }

  // Rates of a planar flow (or how far a map moves states) on a grid over the box.
  grid(cells) {
    const values = new Float64Array(2 * (cells + 1) ** 2);
    const [x, f] = [new Float64Array(2), new Float64Array(2)];
    for (let j = 0, at = 0; j <= cells; j++) {
      x[1] = this.low[1] + (j * this.scales[1]) / cells;
      for (let i = 0; i <= cells; i++, at += 2) {
        x[0] = this.low[0] + (i * this.scales[0]) / cells;
        if (this.law.discrete) {
          this.iterate(x, f);
          f[0] -= x[0];
          f[1] -= x[1];
        } else this.rates(x, 0, f);
        values[at] = f[0];
        values[at + 1] = f[1];
      }
    }
    return { cells, values };
  }

  // The factors of both rates, whose zeros are the nullclines, on a grid over the box.
  nullclineGrid(cells) {
    const count = this.law.part_of.length;
    const values = new Float64Array(count * (cells + 1) ** 2);
    const [x, f] = [new Float64Array(2), new Float64Array(count)];
    for (let j = 0, at = 0; j <= cells; j++) {
      x[1] = this.low[1] + (j * this.scales[1]) / cells;
      for (let i = 0; i <= cells; i++, at += count) {
        x[0] = this.low[0] + (i * this.scales[0]) / cells;
        this.law.parts(x, this.p, f);
        values.set(f, at);
      }
    }
    return { cells, values };
  }

  described(x) {
    const { n, law } = this;
    this.defect(x);
    const slopes = Float64Array.from(this.j);
    if (law.discrete) for (let i = 0; i < n; i++) slopes[i * n + i] += 1;
    const found = eigenvalues(slopes, n);
    const size = Math.max(Math.hypot(...slopes), law.discrete ? 1 : 0);
    const growth = found.map(([re, im]) => (law.discrete ? Math.hypot(re, im) - 1 : re));
    const doubt = 1e-10 * size;
    const order = found.map((_, i) => i).sort((i, k) => growth[k] - growth[i] || found[k][1] - found[i][1]);
    const unstable = growth.filter((one) => one > doubt).length;
    const nearest = growth.reduce((best, one, i) => (Math.abs(one) < Math.abs(growth[best]) ? i : best), 0);
    const turns = Math.abs(found[nearest][1]) > doubt;
    const flat = growth.some((one) => Math.abs(one) <= doubt);
    let kind;
    if (!found.every((one) => one.every(Number.isFinite))) kind = DEGENERATE;
    else if (this.conservative && !unstable) kind = found.every(([re, im]) => Math.hypot(re, im) > doubt) ? CENTER : DEGENERATE;
    else if (flat && !(this.conservative && unstable)) kind = DEGENERATE;
    else if (unstable && unstable < n) kind = SADDLE;
    else if (unstable) kind = turns ? UNSTABLE_FOCUS : UNSTABLE_NODE;
    else kind = turns ? STABLE_FOCUS : STABLE_NODE;
    return { x: Array.from(x), kind, unstable, eigenvalues: order.map((i) => found[i]), slopes };
  }

  // The number of what the motion from a place ends at: stable equilibria in order, stable cycles, then far away; -1 where it
  // is none of them, or is not known.
  ends(rests, cycles) {
    const places = rests.filter(attracts).map((one) => one.x);
    const rings = cycles.filter((one) => one.multiplier < 1).map((one) => this.thinned(one.points));
    const { scales, turns, n } = this;
    const middles = this.low.map((low, i) => low + 0.5 * scales[i]);
    // Farther than motions go that come back, however steep the way is.
    const far = (x) => x.some((value, i) => !turns[i] && !(Math.abs(value - middles[i]) < 2e4 * scales[i]));
    const at = (x) => {
      const near = places.findIndex((one) => this.gap(one, x) < 1e-3);
      return near >= 0 ? near : far(x) ? places.length + rings.length : -1;
    };
    if (this.law.discrete) {
      return (...x0) => {
        let [x, next] = [Float64Array.from(x0), new Float64Array(n)];
        for (let i = 0; i < 2000; i++) {
          const found = at(x);
          if (found >= 0) return found;
          this.iterate(x, next);
          [x, next] = [next, x];
        }
        return -1;
      };
    }
    const on = (x) => rings.findIndex((ring) => this.lies(ring, x));
    return (...x0) => {
      let found = -1;
      let count = 0;
      follow(this.rates, x0, 0, 1e12, {
        scales, rtol: 1e-5, most: 1500,
        each: (t, x) => {
          found = at(x);
          if (found < 0 && rings.length && ++count % 8 === 0) {
            const ring = on(x);
            if (ring >= 0) found = places.length + ring;
          }
          return found >= 0;
        },
      });
      return found;
    };
  }

  // Points of a closed curve in widths of the box, at distances of 0.004 or more.
  thinned(points) {
    const kept = [];
    for (const one of points) {
      const [u, v] = [one[0] / this.scales[0], one[1] / this.scales[1]];
      const n = kept.length;
      if (!n || Math.hypot(u - kept[n - 2], v - kept[n - 1]) > 4e-3) kept.push(u, v);
    }
    return Float64Array.from([...kept, points[0][0] / this.scales[0], points[0][1] / this.scales[1]]);
  }

  // Whether a state lies within 0.002 widths of the box of a thinned curve.
  lies(ring, x) {
    const { scales, turns } = this;
    const [u, v] = [x[0] / scales[0], x[1] / scales[1]];
    const [turnU, turnV] = [turns[0] / scales[0], turns[1] / scales[1]];
    for (let i = 2; i < ring.length; i += 2) {
      let [du, dv] = [u - ring[i - 2], v - ring[i - 1]];
      if (turnU) du -= turnU * Math.round(du / turnU);
      if (turnV) dv -= turnV * Math.round(dv / turnV);
      const [cu, cv] = [ring[i] - ring[i - 2], ring[i + 1] - ring[i - 1]];
      const share = Math.min(1, Math.max(0, (cu * du + cv * dv) / (cu * cu + cv * cv || 1)));
      const [gu, gv] = [du - share * cu, dv - share * cv];
      if (gu * gu + gv * gv < 4e-6) return true;
    }
    return false;
  }

  // A motion for pictures: rows of t and the states; `until` is when it has to end, on the clock of the browser.
  motion(x0, duration, { rtol = 1e-8, most = 20000, until = Infinity } = {}) {
    if (this.law.discrete) return this.iterates(x0, duration);
    const rows = [[0, ...x0]];
    const far = (x) => x.some((value, i) => !this.turns[i] && Math.abs(value - 0.5 * (this.low[i] + this.high[i])) > 1e4 * this.scales[i]);
    const strobes = [];
    let next = this.period || Infinity;
    let [left, crowded, hurried, count] = [false, false, false, 0];
    const end = follow(this.rates, x0, 0, duration, {
      scales: this.scales, rtol, most,
      each: (t, x, before, from, h, stepper) => {
        // Between the ends of a long step the curve bends: its middle is drawn as well.
        if (!(stepper instanceof StiffStepper)) rows.push(middle(before, x, stepper, from, h));
        rows.push([t, ...x]);
        while (t >= next && !crowded) {
          crowded = strobes.length === MOST_STROBES;
          strobes.push(between(before, x, stepper, (next - from) / h, h));
          next += this.period;
        }
        left = far(x);
        hurried = !left && !crowded && until < Infinity && ++count % 64 === 0 && performance.now() > until;
        return left || crowded || hurried;
      },
    });
    return { rows, strobes, why: left ? "escaped" : crowded ? "steps" : hurried ? "hurried" : end.why, stiff: end.stiff, t: end.t, x: Array.from(end.x) };
  }

  iterates(x0, count) {
    const rows = [[0, ...x0]];
    let x = Float64Array.from(x0);
    for (let i = 1; i <= count; i++) {
      const next = new Float64Array(this.n);
      this.iterate(x, next);
      if (!next.every((value, k) => Math.abs(value) < 1e4 * (this.scales[k] + Math.abs(this.low[k]) + Math.abs(this.high[k])))) {
        return { rows, strobes: [], why: "escaped", t: i, x: Array.from(next) };
      }
      rows.push([i, ...next]);
      x = next;
    }
    return { rows, strobes: [], why: "end", t: count, x: Array.from(x) };
  }

  // One-dimensional stable and unstable manifolds of a saddle: curves in both directions.
  manifolds(saddle, rests) {
    const curves = [];
    const { n } = this;
    for (const stable of [true, false]) {
      const count = stable ? n - saddle.unstable : saddle.unstable;
      const value = saddle.eigenvalues.find(([re]) => (stable ? re < 0 : re > 0));
      if (count !== 1 || !value || value[1] !== 0) continue;
      const v = eigenvector(saddle.slopes, n, value[0]);
      const length = Math.max(...v.map((one, i) => Math.abs(one) / this.scales[i]));
      for (const side of [1, -1]) {
        const start = saddle.x.map((one, i) => one + (side * 1e-4 * v[i]) / length);
        curves.push({ stable, points: this.line(start, stable ? -1 : 1, 60 / Math.abs(value[0]), rests, saddle) });
      }
    }
    return curves;
  }

  // A curve of the flow until it leaves the box or comes to rest.
  line(start, way, slow, rests, saddle) {
    const points = [saddle.x, start];
    const low = this.low.map((one, i) => one - 0.5 * this.scales[i]);
    const high = this.high.map((one, i) => one + 0.5 * this.scales[i]);
    let length = 0;
    follow(this.rates, start, 0, way * 40 * slow, {
      scales: this.scales, rtol: 1e-7, most: 3000,
      each: (t, x, before, from, h, stepper) => {
        points.push(middle(before, x, stepper, from, h).slice(1), Array.from(x));
        for (let i = 0; i < this.n; i++) {
          length += Math.abs(x[i] - before[i]) / this.scales[i];
          if (!this.turns[i] && (x[i] < low[i] || x[i] > high[i])) return true;
        }
        return length > (this.n > 2 ? 8 : 30) || rests.some((one) => one !== saddle && this.gap(one.x, x) < 1e-3);
      },
    });
    return points;
  }
}

function product(a, b, n) {
  const c = new Float64Array(n * n);
  for (let i = 0; i < n; i++) for (let k = 0; k < n; k++) for (let j = 0; j < n; j++) c[i * n + j] += a[i * n + k] * b[k * n + j];
  return c;
}

// Hermite's cubic over a step, at a share of it.
function between(before, x, stepper, s, h) {
  const [first, last] = [stepper.k[0], stepper.k[6]];
  return Array.from(x, (value, i) => {
    const from = before[i];
    const gap = value - from;
    return from + s * (h * first[i] + s * (3 * gap - h * (2 * first[i] + last[i]) + s * (h * (first[i] + last[i]) - 2 * gap)));
  });
}

const middle = (before, x, stepper, from, h) => [from + 0.5 * h, ...between(before, x, stepper, 0.5, h)];
