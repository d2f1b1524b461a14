// One degree of freedom, x'' = -V'(x), at one set of parameters: equilibria, separatrices, orbits.
// A torque tilts the potential; then a circle is looked at unrolled.

const SCAN = 256; // steps in which V' is looked at where nothing more is known of it

// Stretches in which V' changes sign once: between the places where V'' does.
function brackets(slope, bend, a, b, n) {
  const found = [];
  let x = a;
  let d = slope(x);
  let k = bend(x);
  for (let i = 1; i <= n; i++) {
    const y = i === n ? b : a + ((b - a) * i) / n;
    const e = slope(y);
    const l = bend(y);
    if (d === 0) found.push([x, x, 0]);
    else if (d * e < 0) {
      // A pole changes the sign, too; there V' grows where the bracket shrinks.
      const at = root(slope, bend, x, y, d);
      const pole = !(Math.abs(slope(at)) <= Math.min(Math.abs(d), Math.abs(e)));
      if (!pole) found.push([x, y, d]);
    } else if (k * l < 0 && d * k < 0 && e !== 0) {
      const middle = root(bend, null, x, y, k);
      const f = slope(middle);
      if (f * d < 0) found.push([x, middle, d], [middle, y, f]);
      else if (f === 0) found.push([middle, middle, 0]);
    }
    x = y;
    d = e;
    k = l;
  }
  return found;
}

// A potential at given parameters, whatever the law: V, V', V'', exact rises, equilibria in order.
class Landscape {
  constructor(law, p, torque = 0) {
    this.law = law;
    this.p = p;
    this.torque = torque;
    this.period = law.kind === "trigonometric" ? TWO_PI : law.period;
    this.circle = this.period !== null;
    this.ends = this.circle ? [-this.period / 2, this.period / 2] : law.ends;
    if (law.kind === "trigonometric") this.setTrigonometric(law, p, torque);
    else this.setFormula(law, p, torque);
  }

  // Equilibria in order, found when they are first asked for.
  get points() {
    if (this.found) return this.found;
    this.found = this.valid ? this.equilibria() : [];
    this.found.forEach((one) => {
      one.energy = this.V(one.x);
      one.curvature = this.bend(one.x);
      const merged = one.kind === DEGENERATE || !(Math.abs(one.curvature) > 1e-12 * this.size);
      one.kind = merged ? DEGENERATE : one.curvature > 0 ? CENTER : SADDLE;
    });
    this.found.sort((a, b) => a.x - b.x);
    return this.found;
  }

  // How large V'' gets, about.
  get size() {
    if (this.sized !== undefined) return this.sized;
    const [low, high] = this.window();
    this.sized = 0;
    for (let i = 0; i <= 32; i++) {
      const bend = Math.abs(this.bend(low + ((high - low) * i) / 32));
      if (bend < Infinity) this.sized = Math.max(this.sized, bend);
    }
    return this.sized;
  }

  setTrigonometric(law, p, torque) {
    const [a, b, c, n] = law.products(p);
    const positive = n > 0 ? n : NaN;
    const [A, B, C] = [a / positive, b / positive, c / positive];
    this.coefficients = [A, B, C];
    this.valid = Number.isFinite(A + B + C + torque);
    this.sized = Math.abs(A) + Math.abs(B) + Math.abs(C) + Math.abs(torque);
    this.V = (x) => {
      const k = Math.cos(x);
      return (0.5 * A * k - B) * k - C * Math.sin(x) - torque * x;
    };
    this.slope = (x) => (B - A * Math.cos(x)) * Math.sin(x) - C * Math.cos(x) - torque;
    this.bend = (x) => B * Math.cos(x) - A * Math.cos(2 * x) + C * Math.sin(x);
    // V(x + d) - V(x), with all digits for small d.
    this.rise = (x, d) => {
      const middle = x + 0.5 * d;
      const [s, k] = [Math.sin(middle), Math.cos(middle)];
      const half = 0.5 * d;
      return 2 * Math.sin(half) * (B * s - A * s * k * Math.cos(half) - C * k) - torque * d;
    };
  }

  setFormula(law, p, torque) {
    this.V = (x) => law.potential(x, p) - torque * x;
    this.slope = (x) => law.slope(x, p) - torque;
    this.bend = (x) => law.bend(x, p);
    this.valid = p.every(Number.isFinite) && Number.isFinite(torque);
    let near = null;
    this.rise = (x, d) => {
      if (near === null) near = 0.02 * (this.window()[1] - this.window()[0]);
      const whole = Math.abs(d) > near || law.joints.some((f) => f(x, p) * f(x + d, p) < 0);
      if (whole) return this.V(x + d) - this.V(x);
      let sum = 0;
      for (const [node, weight] of GAUSS) sum += weight * this.slope(x + node * d);
      return sum * d;
    };
  }

  // What is looked at: the circle, the interval, or the line about its equilibria.
  window() {
    if (this.shown) return this.shown;
    let [low, high] = this.ends;
    if (!Number.isFinite(high - low)) {
      const roots = this.law.powers ? realRoots(this.powers()) : [];
      const [first, last] = roots.length ? [roots[0], roots[roots.length - 1]] : [0, 0];
      const margin = Math.max(0.6 * (last - first), roots.length < 2 ? 2 : 0);
      low = Math.max(low, first - margin);
      high = Math.min(high, last + margin);
    }
    this.shown = [low, high];
    return this.shown;
  }

  powers() {
    const powers = this.law.powers(this.p);
    powers[0] -= this.torque;
    return powers;
  }

  equilibria() {
    if (this.law.kind === "trigonometric" && this.torque === 0) return this.closedForm();
    if (this.law.powers && !this.circle) {
      const [low, high] = this.ends;
      return realRoots(this.powers())
        .filter((x) => x >= low && x <= high)
        .map((x) => ({ x }));
    }
    // A circle is cut where no symmetry puts an equilibrium.
    const [low, high] = this.window();
    const shift = this.circle ? 0.01234 * this.period : 0;
    return brackets(this.slope, this.bend, low + shift, high + shift, SCAN).map(([a, b, sign]) => {
      const x = sign === 0 ? a : root(this.slope, this.bend, a, b, sign);
      return { x: x > high ? Math.max(low, x - this.period) : x };
    });
  }

  // The theorem on their location, for A, B, C >= 0; symmetries lead there. One is in the first
  // quadrant, one in the third, and two or none in the fourth.
  closedForm() {
    let [a, b, c] = this.coefficients;
    if (a === 0 && b === 0 && c === 0) return [];
    const swap = a < 0;
    if (swap) [a, b, c] = [-a, c, b];
    const [flipB, flipC] = [b < 0, c < 0];
    b = Math.abs(b);
    c = Math.abs(c);
    const slope = (x) => (b - a * Math.cos(x)) * Math.sin(x) - c * Math.cos(x);
    const bend = (x) => b * Math.cos(x) - a * Math.cos(2 * x) + c * Math.sin(x);
    const quarter = Math.PI / 2;
    const find = (low, high, before) => root(slope, bend, low, high, before);
    const found = [
      { x: find(0, quarter, -1), label: "lower_center" },
      { x: find(-Math.PI, -quarter, 1), label: "upper_saddle" },
    ];
    const gap = astroid(a, b, c);
    const edge = b === 0 && c === 0 ? Math.PI / 4 : Math.atan(Math.cbrt(c / b));
    if (gap < 0) {
      found.push({ x: find(-edge, 0, 1), label: "lower_saddle" });
      found.push({ x: find(-quarter, -edge, -1), label: "upper_center" });
    } else if (gap === 0) {
      if (c === 0) found[0] = { x: 0, label: "lower_center", kind: DEGENERATE };
      else if (b === 0) found[1] = { x: -quarter, label: "upper_saddle", kind: DEGENERATE };
      else found.push({ x: -edge, label: "lower_saddle", kind: DEGENERATE });
    }
    for (const one of found) {
      if (Math.abs(one.x) < 1e-9 && slope(0) === 0) one.x = 0; // halving comes near a zero, not to it
      if (flipC) one.x = -one.x;
      if (flipB) one.x = Math.PI - one.x;
      if (swap) one.x = quarter - one.x;
      one.x = wrap(one.x);
    }
    return found;
  }
}

// Number of zeros of B sin x - A sin x cos x - C cos x - torque on the circle. In t = tan(y/2), with x = y + turn, they are
// the real roots of a quartic: four, two or none by its invariants. The turn keeps them away from t = infinity.
const PLACES = [0, 1, 2, 3, 4, 5, 6].map((i) => (TWO_PI * i) / 7);
function countTilted(A, B, C, torque) {
  const size = Math.max(Math.abs(A), Math.abs(B), Math.abs(C), Math.abs(torque));
  const [u, v, w, level] = [A / size, B / size, C / size, torque / size];
  const slope = (x) => (v - u * Math.cos(x)) * Math.sin(x) - w * Math.cos(x) - level;
  const far = PLACES.reduce((best, x) => (Math.abs(slope(x)) > Math.abs(slope(best)) ? x : best), 0);
  const turn = far - Math.PI;
  const [s, k] = [Math.sin(turn), Math.cos(turn)];
  const [s1, c1] = [v * k + w * s, v * s - w * k];
  const [s2, c2] = [-0.5 * u * (k * k - s * s), -u * s * k];
  const [a, b, c, d, e] = [c2 - c1 - level, 2 * s1 - 4 * s2, -6 * c2 - 2 * level, 2 * s1 + 4 * s2, c1 + c2 - level];
  const one = 12 * a * e - 3 * b * d + c * c;
  const two = 72 * a * c * e + 9 * b * c * d - 27 * (a * d * d + e * b * b) - 2 * c ** 3;
  if (4 * one ** 3 < two * two) return 2;
  const inner = 8 * a * c - 3 * b * b;
  const outer = 64 * a ** 3 * e - 16 * a * a * c * c + 16 * a * b * b * c - 16 * a * a * b * d - 3 * b ** 4;
  return inner < 0 && outer < 0 ? 4 : 0;
}

// Negative where there are four equilibria, positive where two, 0 on the fold; for A, B, C >= 0.
function astroid(a, b, c) {
  if (b === 0 || c === 0) return b + c - a;
  return Math.hypot(Math.cbrt(b), Math.cbrt(c)) ** 3 - a;
}
