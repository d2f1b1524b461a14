// Limit cycles of planar flows: states that return to a section where they left it.

// Rays to the right of a point, or lines across a cylinder.
const ray = (center) => ({ center, turn: -1 });
const across = (turn) => ({ center: null, turn });

class Returns {
  constructor(system, rests) {
    Object.assign(this, { system, rests });
    const { law, p } = system;
    const slopes = new Float64Array(4);
    const [y, f] = [new Float64Array(2), new Float64Array(2)];
    // The third number grows with the divergence, whose integral over a cycle is the logarithm of its multiplier.
    this.widened = (x, t, out) => {
      y[0] = x[0]; y[1] = x[1];
      law.rates(y, p, t, f);
      law.slopes(y, p, t, slopes);
      out[0] = f[0]; out[1] = f[1]; out[2] = slopes[0] + slopes[3];
    };
    this.widened.steady = true;
  }

  start(section, s) {
    const { low } = this.system;
    if (section.turn < 0) return [section.center[0] + s, section.center[1]];
    return section.turn === 0 ? [low[0], s] : [s, low[1]];
  }

  span(section) {
    const { low, high } = this.system;
    if (section.turn < 0) return [0, high[0] - section.center[0]];
    const other = 1 - section.turn;
    return [low[other], high[other]];
  }

  // Where the motion from s on the section meets it again, and when; null where it does not. With `whole` its points, ends
  // and growth too.
  from(section, s, way, { rtol = 1e-7, whole = false, most = 2500 } = {}) {
    const { system, rests } = this;
    const { low, high, scales } = system;
    const x0 = this.start(section, s);
    const f0 = new Float64Array(2);
    system.rates(x0, 0, f0);
    const turn = section.turn;
    const axis = turn < 0 ? 1 : turn;
    const sign = Math.sign(f0[axis]) * way;
    if (sign === 0 || !Number.isFinite(f0[0] + f0[1])) return null;
    const goal = turn < 0 ? section.center[1] : x0[turn] + sign * system.turns[turn];
    const rates = whole ? this.widened : system.rates;
    let found = null;
    const points = [x0];
    const y = [0, 0];
    let moved = false;
    follow(rates, whole ? [...x0, 0] : x0, 0, way * 1e9, {
      scales: whole ? [...scales, 1] : scales, rtol, most,
      each: (t, x, before, start, h, stepper) => {
        if (whole) points.push(middle(before, x, stepper, start, h).slice(1, 3));
        const [a, b] = [(before[axis] - goal) * sign, (x[axis] - goal) * sign];
        if (a < 0 && b >= 0 && (turn >= 0 || moved)) {
          const at = located(stepper, before, start, h, (z) => (z[axis] - goal) * sign);
          const where = turn < 0 ? at.x[0] - section.center[0] : at.x[1 - turn];
          if (turn >= 0 || where > 0) {
            found = { s: where, period: Math.abs(start + at.share * h), growth: whole ? at.x[2] : 0, points };
            points.push([at.x[0], at.x[1]]);
            return true;
          }
        }
        if (b < 0) moved = true;
        points.push([x[0], x[1]]);
        for (let i = 0; i < 2; i++) {
          if (!system.turns[i] && (x[i] < low[i] - scales[i] || x[i] > high[i] + scales[i])) return true;
          y[i] = x[i];
        }
        return rests.some((one) => system.gap(one.x, y) < 1e-6);
      },
    });
    return found;
  }

  // A cycle between two states of a section of which one comes back before, the other behind itself.
  between(section, way, a, b, fa, fb) {
    for (let i = 0; i < 60 && Math.abs(b - a) > 1e-13 * (1 + Math.abs(a)); i++) {
      let s = (a * fb - b * fa) / (fb - fa);
      if (!(s > Math.min(a, b) && s < Math.max(a, b))) s = 0.5 * (a + b);
      const found = this.from(section, s, way, { rtol: 1e-10, most: 6000 });
      if (!found) return null;
      const f = found.s - s;
      if (f === 0) return this.cycle(section, s, way);
      if (f > 0 === fb > 0) {
        [b, fb] = [s, f];
        fa *= 0.5;
      } else {
        [a, fa] = [s, f];
        fb *= 0.5;
      }
      if (Math.abs(f) < 1e-12 * this.system.scales[0]) break;
    }
    return this.cycle(section, Math.abs(fa) < Math.abs(fb) ? a : b, way);
  }

  // The cycle through s, if that comes back to itself; Newton's steps by its multiplier bring it nearer.
  cycle(section, start, way) {
    const { system } = this;
    const size = system.scales[section.turn < 0 ? 0 : 1 - section.turn];
    let s = start;
    for (let i = 0; i < 8; i++) {
      const found = this.from(section, s, way, { rtol: 1e-11, whole: true, most: 12000 });
      if (!found) return null;
      const d = found.s - s;
      if (Math.abs(d) < 1e-9 * size || (i > 3 && Math.abs(d) < 1e-6 * size)) return this.described(section, s, way, found);
      const slope = Math.exp(found.growth) - 1;
      const step = Math.abs(slope) > 1e-9 ? -d / slope : d;
      if (!Number.isFinite(step) || Math.abs(step) > 0.3 * size) return null;
      s += step;
    }
    return null;
  }

  described(section, s, way, { period, growth, points }) {
    const { low, high, scales, turns } = this.system;
    const ends = [0, 1].map((i) => [Math.min(...points.map((x) => x[i])), Math.max(...points.map((x) => x[i]))]);
    const inside = [0, 1].every((i) => turns[i] || (ends[i][0] >= low[i] - 1e-9 * scales[i] && ends[i][1] <= high[i] + 1e-9 * scales[i]));
    // Growth is that of the motion followed, which may go back in time.
    return inside ? { section, s, way, period, multiplier: Math.exp(way * growth), points, ends } : null;
  }

  // The same cycles after a change of the parameters.
  again(cycles) {
    return this.apart(cycles.map(({ section, s, way }) => this.cycle(section, s, way)));
  }

  apart(cycles) {
    const kept = [];
    for (const one of cycles) if (one && !kept.some((other) => this.same(one, other))) kept.push(one);
    return kept;
  }

  same(one, other) {
    const { scales } = this.system;
    return Math.abs(one.period - other.period) < 1e-5 * one.period
      && [0, 1].every((i) => this.system.turns[i] || [0, 1].every((k) => Math.abs(one.ends[i][k] - other.ends[i][k]) < 1e-4 * scales[i]));
  }

  // Looks for all cycles that cross a section, forward and back in time; yields between motions.
  *search(count = 40) {
    const { system, rests } = this;
    const sections = [0, 1].filter((i) => system.turns[i]).map(across);
    const middles = rests.filter((one) => one.kind !== SADDLE);
    const cycles = [];
    this.family = false;
    for (const section of [...middles.map((one) => ray(one.x)), ...sections]) {
      const [low, high] = this.span(section);
      for (const way of [1, -1]) {
        let last = null;
        let still = 0;
        for (let k = 0; k < count; k++) {
          const s = low + ((high - low) * (k + 0.5)) / count;
          const found = this.from(section, s, way);
          const d = found ? found.s - s : NaN;
          still = Math.abs(d) < 1e-6 * (high - low) ? still + 1 : 0;
          if (still > 3) this.family = true;
          if (last && Number.isFinite(d) && d * last.d < 0 && still < 2) cycles.push(this.between(section, way, last.s, s, last.d, d));
          last = Number.isFinite(d) ? { s, d } : null;
          yield;
        }
      }
    }
    return this.apart(cycles);
  }
}
