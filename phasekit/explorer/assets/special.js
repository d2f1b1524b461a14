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

  besselk(n, x) {
    if (!(x > 0)) return NaN;
    const most = Math.acosh(1 + 750 / x); // beyond, nothing is left
    const f = (t) => Math.exp(-x * Math.cosh(t)) * Math.cosh(n * t);
    return integral(f, special.stretches(most));
  },

  bessely(n, x) {
    if (!(x > 0) || !Number.isInteger(n)) return NaN;
    const sign = n % 2 ? -1 : 1;
    const wave = (t) => Math.sin(x * Math.sin(t) - n * t);
    const most = Math.asinh((750 + 40 * Math.abs(n)) / x);
    const tail = (t) => (Math.exp(n * t) + sign * Math.exp(-n * t)) * Math.exp(-x * Math.sinh(t));
    const turns = special.stretches(Math.PI);
    const whole = integral(wave, turns, 1e-14) - integral(tail, special.stretches(most));
    return whole / Math.PI;
  },

  polygamma(n, x) {
    if (!Number.isInteger(n) || n < 0) return NaN;
    let factorial = 1; // of n
    for (let k = 2; k <= n; k++) factorial *= k;
    const sign = n % 2 ? 1 : -1;
    let shift = 0;
    while (x < 20 + n) shift += (sign * factorial) / x++ ** (n + 1);
    const bernoulli = [1 / 6, -1 / 30, 1 / 42, -1 / 30, 5 / 66, -691 / 2730];
    let sum = n ? factorial / n / x ** n : -Math.log(x);
    sum += factorial / (2 * x ** (n + 1));
    bernoulli.forEach((b, i) => {
      const k = i + 1;
      let ratio = n ? 1 : 1 / (2 * k); // (2k + n - 1)!/(2k)!
      for (let j = 2 * k + 1; j < 2 * k + n; j++) ratio *= j;
      sum += (b * ratio) / x ** (2 * k + n);
    });
    return shift + sign * sum;
  },

  erfinv(y) {
    if (!(Math.abs(y) < 1)) return Math.abs(y) === 1 ? y * Infinity : NaN;
    const w = -Math.log((1 - y) * (1 + y));
    const a = 2 / (Math.PI * 0.147) - 0.5 * w;
    let x = Math.sign(y) * Math.sqrt(Math.max(0, Math.sqrt(a * a + w / 0.147) - a));
    for (let i = 0; i < 20; i++) {
      const f = Math.abs(y) < 0.5 ? special.erf(x) - y : Math.sign(y) * (1 - Math.abs(y) - special.erfc(Math.abs(x)));
      const u = (f * Math.sqrt(Math.PI) * Math.exp(x * x)) / 2;
      const step = u / (1 + x * u);
      x -= step;
      if (Math.abs(step) <= 1e-16 * Math.abs(x)) break;
    }
    return x;
  },

  airyai: (x) => special.airy(x)[0],
  airyaiprime: (x) => special.airy(x)[1],
  airybi: (x) => special.airy(x)[2],
  airybiprime: (x) => special.airy(x)[3],

  // Ai, Ai', Bi, Bi': the series about 0, beyond it asymptotic ones; Ai by K where it is small.
  airy(x) {
    const [a, b] = [0.355028053887817239, 0.258819403792806798];
    const far = Math.abs(x) > 8;
    if (far && x < 0) return special.airyWave(-x);
    let [f, df, g, dg] = [1, 0, x, 1];
    let [s, t] = [1, x];
    for (let k = 1; k < 400; k++) {
      const cube = x * x * x;
      const [n, m] = [3 * k, 3 * k + 1];
      s *= cube / ((n - 1) * n);
      t *= cube / (n * m);
      f += s;
      g += t;
      df += x ? (n * s) / x : 0;
      dg += x ? (m * t) / x : 0;
      if (Math.abs(s) + Math.abs(t) < 1e-17 * (Math.abs(f) + Math.abs(g))) break;
    }
    const root3 = Math.sqrt(3);
    let [ai, aip] = [a * f - b * g, a * df - b * dg];
    if (x > 2) {
      const z = (2 / 3) * x ** 1.5;
      ai = (Math.sqrt(x / 3) / Math.PI) * special.besselk(1 / 3, z);
      aip = (-x / (Math.PI * root3)) * special.besselk(2 / 3, z);
    }
    return [ai, aip, root3 * (a * f + b * g), root3 * (a * df + b * dg)];
  },

  airyWave(x) {
    const z = (2 / 3) * x ** 1.5;
    const sums = [0, 0, 0, 0]; // even and odd terms, of the functions and of their derivatives
    let u = 1;
    for (let k = 0; k < 12; k++) {
      const v = k ? (-(6 * k + 1) / (6 * k - 1)) * u : 1;
      const sign = k % 4 < 2 ? 1 : -1;
      sums[k % 2] += (sign * u) / z ** k;
      sums[2 + (k % 2)] += (sign * v) / z ** k;
      u *= ((6 * k + 5) * (6 * k + 3) * (6 * k + 1)) / (216 * (k + 1) * (2 * k + 1));
    }
    const [p, q, r, s] = sums;
    const [c, d] = [Math.cos(z - Math.PI / 4), Math.sin(z - Math.PI / 4)];
    const small = 1 / (Math.sqrt(Math.PI) * x ** 0.25);
    const large = x ** 0.25 / Math.sqrt(Math.PI);
    return [small * (c * p + d * q), large * (d * r - c * s), small * (c * q - d * p), large * (c * r + d * s)];
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
