// Levels of energy: where they turn, the separatrices, and the orbits between them.

const TURNS = 40; // over which an orbit in a tilted potential is followed
const REACH = 60; // doublings of a line's width over which an orbit is followed

class Potential extends Landscape {
  // ------------------------------------------------------------------ levels

  // The i-th equilibrium on the unrolled circle, or on the line.
  at(i) {
    const n = this.points.length;
    if (!this.circle) return i >= 0 && i < n ? this.points[i].x : null;
    const turn = Math.floor(i / n);
    return this.points[i - turn * n].x + turn * this.period;
  }

  // From x, where v^2/2 = kinetic, to the first turning point on one side (+1, -1).
  // Returns {x}, or {x, saddle} if the level ends at an equilibrium, {turns} or {leaves}.
  turning(x, kinetic, side, from = null) {
    const depth = (y) => kinetic - this.rise(x, y - x);
    const slope = (y) => -this.slope(y);
    const n = this.points.length;
    const base = this.circle ? this.period * Math.floor((x - this.ends[0]) / this.period) : 0;
    let i = from;
    if (i === null) {
      i = this.points.findIndex((one) => one.x + base > x);
      if (i < 0) i = n;
      if (this.circle) i += n * Math.round(base / this.period);
      if (side < 0) i -= 1;
      if (n && this.at(i) === x) i += side;
    } else i += side;
    const first = i;
    let before = x;
    const most = this.torque && this.circle ? TURNS * n : n;
    for (; n; i += side) {
      const next = this.at(i);
      if (next === null) break;
      if (this.circle && Math.abs(i - first) >= most) {
        return this.torque ? { leaves: true } : { turns: true };
      }
      const left = depth(next);
      const point = this.points[((i % n) + n) % n];
      if (from !== null && point.kind !== CENTER && this.level(x, next, from, i)) {
        return Math.abs(i - from) === n && this.circle && !this.torque
          ? { turns: true }
          : { x: next, saddle: point };
      }
      if (left < 0) return { x: root(depth, slope, before, next, 1) };
      before = next;
    }
    if (this.circle) return n ? { turns: true } : { leaves: this.torque !== 0, turns: true };
    return this.outward(before, depth, slope, side);
  }

  // Whether two saddles have one energy: by the theorem where it holds, else within rounding.
  level(x, y, i, j) {
    const n = this.points.length;
    if (this.law.kind === "trigonometric" && this.torque === 0) {
      if ((j - i) % n === 0) return true;
      const [A, B, C] = this.coefficients;
      return A > 0 ? B === 0 : A < 0 && C === 0;
    }
    if (this.torque === 0 && this.circle && (j - i) % n === 0) return true;
    return Math.abs(this.rise(x, y - x)) <= 1e-13 * this.size * (1 + this.window()[1] - this.window()[0]);
  }

  outward(before, depth, slope, side) {
    const end = this.ends[side > 0 ? 1 : 0];
    let step = this.window()[1] - this.window()[0];
    let inner = before;
    for (let i = 0; i < REACH; i++) {
      const y = side > 0 ? Math.min(inner + step, end) : Math.max(inner - step, end);
      if (depth(y) < 0) return { x: root(depth, slope, inner, y, 1) };
      if (y === end || !Number.isFinite(depth(y))) break;
      inner = y;
      step *= 2;
    }
    return { leaves: true };
  }

  // ------------------------------------------------------------------ separatrices

  // Both sides of each saddle: a lobe, a way round the circle, to another saddle, or out.
  separatrices() {
    if (this.loops) return this.loops;
    this.loops = [];
    this.points.forEach((saddle, i) => {
      const upper = saddle.label === "upper_saddle";
      if (saddle.kind !== SADDLE && !(saddle.kind === DEGENERATE && upper)) return;
      const sides = {};
      for (const [name, side] of [["left", -1], ["right", 1]]) {
        const end = this.turning(saddle.x, 0, side, i);
        const one = { kind: "unbounded", area: Infinity, offset: NaN };
        if (end.turns) {
          one.kind = "winding";
          one.area = this.action(saddle.x, 0, saddle.x, saddle.x + side * this.period);
        } else if (end.x !== undefined) {
          one.kind = end.saddle ? "heteroclinic" : "lobe";
          one.offset = end.x - saddle.x;
          one.area = 2 * this.arc(saddle.x, end.x, Boolean(end.saddle));
        }
        sides[name] = one;
      }
      const [l, r] = [sides.left, sides.right];
      const total = l.area + r.area;
      const shares = l.kind === r.kind && (l.kind === "lobe" || l.kind === "heteroclinic");
      this.loops.push({
        saddle,
        ...sides,
        exponent: Math.sqrt(Math.max(0, -saddle.curvature)),
        shares: shares ? [l.area / total, r.area / total] : null,
      });
    });
    return this.loops;
  }

  // Integral of the speed on the saddle's level from s to t.
  arc(s, t, saddle) {
    const length = t - s;
    const f = (angle) => {
      const d = length * Math.sin(angle / 2) ** 2;
      const back = length * Math.cos(angle / 2) ** 2;
      const near = saddle || angle < Math.PI / 2;
      const depth = near && !(saddle && angle > Math.PI / 2) ? -this.rise(s, d) : -this.rise(t, -back);
      return Math.sqrt(2 * Math.max(0, depth)) * 0.5 * Math.sin(angle);
    };
    const [low, high] = [Math.min(s, t), Math.max(s, t)];
    const angles = this.stops(low, high).slice(1, -1).map((x) => 2 * Math.asin(Math.sqrt((x - s) / length)));
    return Math.abs(length) * integral(f, [0, Math.PI / 2, Math.PI, ...angles].sort((x, y) => x - y));
  }

  // Integral of the speed from a to b, of the motion that has v^2/2 = kinetic at x.
  action(x, kinetic, a, b) {
    const speed = (y) => Math.sqrt(2 * Math.max(0, kinetic - this.rise(x, y - x)));
    return Math.abs(integral(speed, this.stops(a, b)));
  }

  // Where an integral is cut: at equilibria, and where the formula changes its branch.
  stops(a, b) {
    const [low, high] = [Math.min(a, b), Math.max(a, b)];
    const inside = [];
    for (const joint of this.law.joints ?? []) {
      const f = (x) => joint(x, this.p);
      for (let i = 1; i <= SCAN; i++) {
        const [x, y] = [low + ((high - low) * (i - 1)) / SCAN, low + ((high - low) * i) / SCAN];
        if (f(y) === 0) inside.push(y);
        else if (f(x) * f(y) < 0) inside.push(root(f, null, x, y, f(x)));
      }
    }
    const n = this.points.length;
    for (let i = -n; n && i < 2 * n; i++) {
      const x = this.at(i);
      if (x !== null && x > low && x < high) inside.push(x);
    }
    return [low, ...inside.filter((x) => x > low && x < high).sort((x, y) => x - y), high];
  }

  // ------------------------------------------------------------------ orbits

  // The orbit through a state: kind, energy, period, action, turning points, family.
  orbit(x, v) {
    const energy = 0.5 * v * v + this.V(x);
    const out = { x, v, energy, kind: "none", period: NaN, action: NaN, low: NaN, high: NaN, family: "none" };
    const [low, high] = this.ends;
    if (!this.valid || !Number.isFinite(energy) || x < low - 1e9 || x > high + 1e9) return out;
    if (v === 0 && this.slope(x) === 0) {
      const bend = this.bend(x);
      const round = bend > 0;
      return { ...out, kind: "equilibrium", low: x, high: x, action: round ? 0 : NaN, period: round ? TWO_PI / Math.sqrt(bend) : Infinity };
    }
    const kinetic = 0.5 * v * v;
    for (const one of this.points) {
      if (one.kind !== CENTER && this.onLevel(x, kinetic, one.x)) {
        return { ...out, kind: "asymptotic", period: Infinity };
      }
    }
    const still = v === 0 ? -Math.sign(this.slope(x)) : 0;
    const left = still > 0 ? { x } : this.turning(x, kinetic, -1);
    const right = still < 0 ? { x } : this.turning(x, kinetic, 1);
    if (left.leaves || right.leaves) return { ...out, kind: "unbounded", period: Infinity };
    if (left.turns || right.turns) return this.rotation(out, x, v);
    return this.libration(out, left.x, right.x);
  }

  onLevel(x, kinetic, saddle) {
    const rise = this.rise(x, saddle - x);
    const rounding = 4e-16 * (kinetic + Math.abs(rise)) + 1e-16 * Math.abs(this.slope(x)) * Math.abs(x);
    return Math.abs(kinetic - rise) <= rounding;
  }

  rotation(out, x, v) {
    const kinetic = 0.5 * v * v;
    const low = this.points.reduce((a, b) => (b.energy < a.energy ? b : a), this.points[0] ?? { x: 0 }).x;
    const time = (y) => 1 / Math.sqrt(2 * (kinetic - this.rise(x, y - x)));
    const period = integral(time, this.stops(low, low + this.period));
    const action = this.action(x, kinetic, low, low + this.period) / TWO_PI;
    return { ...out, kind: "rotation", period, action, family: v > 0 ? "forward" : "backward" };
  }

  libration(out, low, high) {
    const width = high - low;
    const depth = (angle) =>
      angle < Math.PI / 2
        ? -this.rise(low, width * Math.sin(angle / 2) ** 2)
        : -this.rise(high, -width * Math.cos(angle / 2) ** 2);
    const speed = (angle) => Math.sqrt(2 * Math.max(0, depth(angle)));
    const dx = (angle) => 0.5 * width * Math.sin(angle);
    const stops = [0, ...this.stops(low, high).slice(1, -1).map((x) => 2 * Math.asin(Math.sqrt((x - low) / width))), Math.PI];
    stops.push(Math.PI / 2);
    stops.sort((a, b) => a - b);
    const period = 2 * integral((angle) => dx(angle) / speed(angle), stops);
    const action = (2 * integral((angle) => dx(angle) * speed(angle), stops)) / TWO_PI;
    return { ...out, kind: "libration", period, action, low, high, family: this.family(low, high) };
  }

  // Which wells an orbit goes round.
  family(low, high) {
    const inside = [];
    const n = this.points.length;
    const turns = this.circle ? Math.ceil(Math.max(Math.abs(low), Math.abs(high)) / this.period) + 1 : 0;
    for (let i = -n * turns; i < n * (turns + 1); i++) {
      const x = this.at(i);
      const one = this.points[((i % n) + n) % n];
      if (x !== null && one.kind !== SADDLE && x > low && x < high) inside.push(one);
    }
    const labels = inside.map((one) => one.label);
    if (labels.includes("lower_center") && labels.includes("upper_center")) return "outer";
    if (labels.length === 1 && labels[0]) return labels[0] === "lower_center" ? "lower_well" : "upper_well";
    const centers = inside.filter((one) => one.kind === CENTER).length;
    return centers === 1 ? "well" : centers ? `round ${centers} centers` : "none";
  }

  // States at times; whole periods are taken off first, so that they cost nothing.
  flow(x, v, times, damping = 0) {
    const force = (y, w) => -this.slope(y) - damping * w;
    const orbit = damping ? null : this.orbit(x, v);
    const periodic = orbit && Number.isFinite(orbit.period) && orbit.period > 0;
    const rate = Math.sqrt(Math.max(this.size, 1e-300)) + Math.abs(v) / (this.circle ? this.period : 1 + Math.abs(x));
    const longest = 0.5 / (rate + damping);
    return times.map((t) => {
      const turns = periodic ? Math.floor(t / orbit.period) : 0;
      const rest = periodic ? t - turns * orbit.period : t;
      const [[y, w]] = motion(force, x, v, [rest], longest);
      const round = orbit && orbit.kind === "rotation" ? Math.sign(v) * turns * this.period : 0;
      return [y + round, w];
    });
  }
}

// Where damped motions end: at the center of a well that they have no energy to leave, far away, or in lasting rotation.
function endsOf(pot, damping) {
  const { points, circle, period, torque } = pot;
  const n = points.length;
  const barriers = points.map((one, i) => (one.kind === SADDLE ? null : [pot.at(i - 1), pot.at(i + 1)]));
  const bounds = barriers.map((sides) => sides && sides.map((x) => (x === null ? Infinity : pot.V(x))));
  const [low, high] = pot.window();
  const rate = Math.sqrt(pot.size) + damping;
  const [LEAVES, TURNS] = [n, n + 1];
  return (x, v) => {
    let found = -1;
    let [last, speed, change] = [Math.floor((x - low) / (high - low)), v, NaN];
    const settled = (y, w) => {
      if (!Number.isFinite(y + w)) return true;
      const turn = circle ? Math.floor((y - points[0]?.x) / period) : 0;
      const energy = 0.5 * w * w + pot.V(y);
      for (let i = 0; i < n && found < 0; i++) {
        if (!barriers[i]) continue;
        // On the unrolled circle a well and its barriers fall by the torque each turn.
        for (const k of circle ? [turn, turn + 1] : [0]) {
          const [shift, fall] = [k * (period ?? 0), k * torque * (period ?? 0)];
          const [a, b] = barriers[i].map((at, side) => (at === null ? (side ? Infinity : -Infinity) : at + shift));
          if (y > a && y < b && energy < Math.min(...bounds[i]) - fall) found = i;
        }
      }
      if (found >= 0) return true;
      if (!circle) {
        if (Math.abs(y - 0.5 * (low + high)) > 3 * (high - low)) found = LEAVES;
      } else {
        const now = Math.floor((y - low) / period);
        if (now !== last) {
          // From turn to turn the speed goes to its last value as a geometric series does.
          const [next, share] = [w - speed, (w - speed) / change];
          const left = next === 0 ? 0 : (Math.abs(next) * share) / (1 - share);
          if (w * torque > 0 && (next === 0 || (share > 0 && share < 1)) && left < 0.02 * Math.abs(w)) found = TURNS;
          [last, speed, change] = [now, w, next];
        }
      }
      return found >= 0;
    };
    const speeds = Math.max(Math.abs(v), Math.abs(torque) / damping);
    const quick = 0.1 / (rate + (circle ? (TWO_PI * speeds) / period : speeds / (high - low)));
    path((y, w) => -pot.slope(y) - damping * w, x, v, quick, 3000, settled);
    return found;
  };
}

// Number of equilibria, for maps: the same, without their places.
function countEquilibria(law, p, torque) {
  if (law.kind === "trigonometric") {
    const [a, b, c, n] = law.products(p);
    if (!(n > 0) || !Number.isFinite((a + b + c) / n + torque)) return -1;
    if (torque !== 0) return countTilted(a / n, b / n, c / n, torque);
    if (a === 0 && b === 0 && c === 0) return 0;
    const [x, y, z] = [Math.abs(a), Math.abs(b), Math.abs(c)];
    return astroid(x, y, z) < 0 ? 4 : 2;
  }
  const potential = new Potential(law, p, torque);
  return potential.valid ? potential.points.length : -1;
}
