// Roots, integrals and motions, to the last digits of doubles; they know no physics.

const TWO_PI = 2 * Math.PI;
// The sine of the double nearest to pi is 0 here, as in the library.
const sine = (x) => (x === Math.PI ? 0 : Math.sin(x));
const cosine = Math.cos;
const wrap = (x) => {
  const y = x - TWO_PI * Math.round(x / TWO_PI);
  return y <= -Math.PI ? y + TWO_PI : y;
};

// Root of f between a, where f has the sign of `before`, and b, where it has the other: Newton's
// method inside a bracket. The signs are given, for at an end f itself may vanish.
function root(f, df, a, b, before) {
  let x = 0.5 * (a + b);
  let last = Math.abs(b - a);
  for (let i = 0; i < 200; i++) {
    const y = f(x);
    if (y === 0) {
      // A zero inside is the root; one that is an end of the bracket is approached by halving.
      return x;
    }
    if (y > 0 === before > 0) a = x;
    else b = x;
    let next = df ? x - y / df(x) : NaN;
    const inside = next > Math.min(a, b) && next < Math.max(a, b);
    if (!inside || Math.abs(next - x) > 0.5 * last) next = 0.5 * (a + b);
    last = Math.abs(next - x);
    if (next === x || next === a || next === b || last <= 1e-17 * Math.abs(x)) return next;
    x = next;
  }
  return x;
}

// Nodes and weights of Gauss and Kronrod, 7 and 15, on [-1, 1].
const KRONROD = [
  [0.991455371120812639206854697526329, 0.022935322010529224963732008058970, 0],
  [0.949107912342758524526189684047851, 0.063092092629978553290700663189204, 0.129484966168869693270611432679082],
  [0.864864423359769072789712788640926, 0.104790010322250183839876322541518, 0],
  [0.741531185599394439863864773280788, 0.140653259715525918745189590510238, 0.279705391489276667901467771423780],
  [0.586087235467691130294144258951523, 0.169004726639267902826583426598550, 0],
  [0.405845151377397166906606412076961, 0.190350578064785409913256402421014, 0.381830050505118944950369775488975],
  [0.207784955007898467600689403773245, 0.204432940075298892414161999234649, 0],
  [0, 0.209482141084727828012999174891714, 0.417959183673469387755102040816327],
];

function panel(f, a, b) {
  const middle = 0.5 * (a + b);
  const half = 0.5 * (b - a);
  let fine = 0;
  let coarse = 0;
  for (const [node, weight, gauss] of KRONROD) {
    const y = node ? f(middle - half * node) + f(middle + half * node) : f(middle);
    fine += weight * y;
    coarse += gauss * y;
  }
  return { a, b, value: half * fine, error: Math.abs(half * (fine - coarse)) };
}

// Integral of f over the stretches between points; NaN where it does not converge.
function integral(f, points, tolerance = 1e-13) {
  const panels = [];
  for (let i = 1; i < points.length; i++) panels.push(panel(f, points[i - 1], points[i]));
  for (let n = 0; ; n++) {
    let total = 0;
    let error = 0;
    let worst = 0;
    panels.forEach((one, i) => {
      total += one.value;
      error += one.error;
      if (one.error > panels[worst].error) worst = i;
    });
    if (error <= tolerance * Math.abs(total)) return total;
    if (n === 400) return error <= 1e-9 * Math.abs(total) ? total : NaN;
    if (Number.isNaN(error)) return NaN;
    const { a, b } = panels[worst];
    const middle = 0.5 * (a + b);
    panels[worst] = panel(f, a, middle);
    panels.push(panel(f, middle, b));
  }
}

// Gauss's nodes and weights, 8 on [0, 1].
const GAUSS = [
  [0.0198550717512318841582, 0.0506142681451881295763],
  [0.1016667612931866302042, 0.1111905172266872352722],
  [0.2372337950418355070911, 0.1568533229389436436689],
  [0.4082826787521750975302, 0.1813418916891809914826],
].flatMap(([node, weight]) => [
  [node, weight],
  [1 - node, weight],
]);

// A step of Bulirsch and Stoer: midpoint rule with 2, 4, ..., 2k substeps, extrapolated.
const COLUMNS = 9;
function extrapolated(force, x, v, t) {
  const a0 = force(x, v);
  const rows = [];
  let error = Infinity;
  for (let k = 1; k <= COLUMNS; k++) {
    const n = 2 * k;
    const h = t / n;
    let [x0, v0] = [x, v];
    let [x1, v1] = [x + h * v, v + h * a0];
    for (let i = 1; i < n; i++) {
      const a = force(x1, v1);
      [x0, v0, x1, v1] = [x1, v1, x0 + 2 * h * v1, v0 + 2 * h * a];
    }
    let row = [0.5 * (x0 + x1 + h * v1), 0.5 * (v0 + v1 + h * force(x1, v1))];
    const earlier = rows.slice();
    rows[0] = row;
    for (let j = 1; j < k; j++) {
      const factor = 1 / ((k / (k - j)) ** 2 - 1);
      const before = earlier[j - 1];
      row = [row[0] + factor * (row[0] - before[0]), row[1] + factor * (row[1] - before[1])];
      rows[j] = row;
    }
    if (k === COLUMNS) {
      const near = rows[k - 2];
      error = Math.abs(row[0] - near[0]) / (1 + Math.abs(x)) + (Math.abs(row[1] - near[1]) * Math.abs(t)) / (1 + Math.abs(x));
      return { x: row[0], v: row[1], error };
    }
  }
}

// Motion of x'' = force(x, x') at times in order, each from the one before.
function motion(force, x, v, times, longest) {
  let t = 0;
  let step = longest;
  const out = [];
  for (const end of times) {
    let budget = 20000;
    while (Math.abs(end - t) > 0 && budget-- > 0) {
      const left = end - t;
      const h = Math.sign(left) * Math.min(Math.abs(left), step);
      const next = extrapolated(force, x, v, h);
      if (next.error > 1e-13 && Math.abs(h) > 1e-9 * longest) {
        step = 0.5 * Math.abs(h);
        continue;
      }
      if (!Number.isFinite(next.x + next.v)) break;
      ({ x, v } = next);
      t = Math.abs(h) === Math.abs(left) ? end : t + h;
      if (next.error < 1e-16) step = Math.min(longest, 1.5 * step);
    }
    if (t !== end) {
      x = NaN;
      v = NaN;
      t = end;
    }
    out.push([x, v]);
  }
  return out;
}

// Path for pictures: fourth-order steps until `stop` says so.
function path(force, x, v, step, count, stop) {
  const out = [[x, v]];
  for (let i = 0; i < count; i++) {
    const a1 = force(x, v);
    const v2 = v + 0.5 * step * a1;
    const a2 = force(x + 0.5 * step * v, v2);
    const v3 = v + 0.5 * step * a2;
    const a3 = force(x + 0.5 * step * v2, v3);
    const v4 = v + step * a3;
    const a4 = force(x + step * v3, v4);
    x += (step / 6) * (v + 2 * v2 + 2 * v3 + v4);
    v += (step / 6) * (a1 + 2 * a2 + 2 * a3 + a4);
    out.push([x, v]);
    if (stop(x, v)) break;
  }
  return out;
}

// All real roots of a polynomial, lowest coefficient first: between those of its derivative.
function realRoots(coefficients) {
  const c = coefficients.slice();
  while (c.length && c[c.length - 1] === 0) c.pop();
  const degree = c.length - 1;
  if (degree < 1) return [];
  const at = (x) => c.reduceRight((sum, one) => sum * x + one, 0);
  const slope = c.slice(1).map((one, i) => one * (i + 1));
  const slopeAt = (x) => slope.reduceRight((sum, one) => sum * x + one, 0);
  const top = c[degree];
  let reach = 0; // of all roots, by Fujiwara
  for (let i = 0; i < degree; i++) {
    const one = Math.abs(c[i] / top) ** (1 / (degree - i));
    reach = Math.max(reach, 2 * one);
  }
  if (reach === 0) return [0];
  reach *= 1.01;
  const ends = [-reach, ...realRoots(slope), reach];
  const found = [];
  const keep = (x) => {
    if (!found.length || x > found[found.length - 1]) found.push(x);
  };
  for (let i = 1; i < ends.length; i++) {
    const [a, b] = [ends[i - 1], ends[i]];
    const [fa, fb] = [at(a), at(b)];
    if (fa === 0 && i > 1) keep(a);
    if ((fa < 0 && fb > 0) || (fa > 0 && fb < 0)) keep(root(at, slopeAt, a, b, fa));
  }
  return found;
}
