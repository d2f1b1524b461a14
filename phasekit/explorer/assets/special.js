// Functions that formulas may hold and JavaScript has not.

const special = {
  heaviside: (x) => (x > 0 ? 1 : x < 0 ? 0 : x === 0 ? 0.5 : NaN),

  power(x, n) {
    let [result, base] = [1, x];
    for (let k = n; k > 0; k >>= 1) {
      if (k & 1) result *= base;
      base *= base;
    }
    return result;
  },

  erf(x) {
    if (Math.abs(x) > 2) return Math.sign(x) * (1 - special.erfc(Math.abs(x)));
    let [term, sum] = [x, x];
    for (let n = 1; n < 60; n++) {
      term *= (-x * x) / n;
      sum += term / (2 * n + 1);
    }
    return (2 / Math.sqrt(Math.PI)) * sum;
  },

  erfc(x) {
    if (x < 2) return 1 - special.erf(x);
    let fraction = 0; // Laplace's continued fraction
    for (let n = 120; n > 0; n--) fraction = (0.5 * n) / (x + fraction);
    return Math.exp(-x * x) / Math.sqrt(Math.PI) / (x + fraction);
  },

  erfi(x) {
    let [term, sum] = [x, x];
    for (let n = 1; n < 800 && Math.abs(term) > 1e-17 * Math.abs(sum); n++) {
      term *= (x * x) / n;
      sum += term / (2 * n + 1);
    }
    return (2 / Math.sqrt(Math.PI)) * sum;
  },

  // Stirling's series, after the argument has been raised.
  loggamma(x) {
    if (!(x > 0)) return NaN;
    let shift = 0;
    while (x < 15) shift -= Math.log(x++);
    const z = 1 / (x * x);
    const series = (1 / 12 - z * (1 / 360 - z * (1 / 1260 - z * (1 / 1680 - z / 1188)))) / x;
    return shift + (x - 0.5) * Math.log(x) - x + 0.5 * Math.log(TWO_PI) + series;
  },

  gamma(x) {
    if (x < 0.5) return Math.PI / (Math.sin(Math.PI * x) * special.gamma(1 - x));
    return Math.exp(special.loggamma(x));
  },

  LambertW(x) {
    if (x < -Math.exp(-1)) return NaN;
    let w = x < 1 ? Math.sqrt(2 * (Math.E * x + 1)) - 1 : Math.log(x);
    for (let i = 0; i < 60; i++) {
      const e = Math.exp(w);
      const f = w * e - x;
      const step = f / (e * (w + 1) - ((w + 2) * f) / (2 * w + 2));
      if (!Number.isFinite(step)) break;
      w -= step;
      if (Math.abs(step) <= 1e-16 * Math.abs(w)) break;
    }
    return w;
  },

  // Whole orders only: means over a turn, where the trapezoidal rule converges exponentially.
  besselj: (n, x) => special.turn(n, x, (t) => Math.cos(n * t - x * Math.sin(t))),
  besseli: (n, x) => special.turn(n, x, (t) => Math.exp(x * Math.cos(t)) * Math.cos(n * t)),

  turn(n, x, f) {
    if (!Number.isInteger(n)) return NaN;
    const count = 32 + 2 * Math.ceil(Math.abs(x) + Math.abs(n));
    let sum = 0;
    for (let i = 0; i < count; i++) sum += f((TWO_PI * i) / count);
    return sum / count;
  },

  elliptic_k: (m) => special.elliptic(m)[0],
  elliptic_e: (m) => special.elliptic(m)[1],

  elliptic(m) {
    if (!(m <= 1)) return [NaN, NaN];
    let [a, b, sum, power] = [1, Math.sqrt(1 - m), 0.5 * m, 0.5];
    if (m === 1) return [Infinity, 1];
    for (let i = 0; i < 40 && Math.abs(a - b) > 1e-16 * a; i++) {
      const c = 0.5 * (a - b);
      [a, b] = [0.5 * (a + b), Math.sqrt(a * b)];
      power *= 2;
      sum += power * c * c;
    }
    const k = Math.PI / (2 * a);
    return [k, k * (1 - sum)];
  },

  Si: (x) => integral((t) => (t ? Math.sin(t) / t : 1), special.stretches(x)) * 1,
  Ci: (x) =>
    x > 0
      ? 0.5772156649015329 + Math.log(x) + integral((t) => (t ? (Math.cos(t) - 1) / t : 0), special.stretches(x))
      : NaN,
  Ei: (x) =>
    x
      ? 0.5772156649015329 + Math.log(Math.abs(x)) + integral((t) => (t ? Math.expm1(t) / t : 1), special.stretches(x))
      : -Infinity,
  fresnels: (x) => integral((t) => Math.sin((Math.PI / 2) * t * t), special.stretches(x)),
  fresnelc: (x) => integral((t) => Math.cos((Math.PI / 2) * t * t), special.stretches(x)),

  stretches(x) {
    const count = 1 + Math.ceil(Math.abs(x));
    return Array.from({ length: count + 1 }, (_, i) => (x * i) / count);
  },
};
