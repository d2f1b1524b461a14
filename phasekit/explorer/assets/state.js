// What the page shows, and how a link says it.

const TORQUE = "torque";

// Axes of diagram and map: parameters that the law depends on, and the torque.
const AXES = [...FACTS.parameters.filter((one) => FACTS.used.includes(one.name)).map((one) => one.name), TORQUE];

function startState() {
  return {
    values: FACTS.parameters.map((one) => one.value),
    damping: 0,
    torque: 0,
    orbits: null, // until a link or the system says which
    series: "x",
    diagram: AXES[0],
    x: AXES[0],
    y: AXES.includes("a") ? "a" : AXES[1] ?? TORQUE,
    angles: "rad",
    units: {},
    basins: true,
    theme: "",
  };
}

const state = startState();

// Ranges of the sliders beside those of the parameters.
const torqueRange = [-1, 1];
const dampingRange = [0, 1];

function rangeOf(name) {
  return name === TORQUE ? torqueRange : ranges[NAMES.indexOf(name)];
}

function valueOf(name) {
  return name === TORQUE ? state.torque : state.values[NAMES.indexOf(name)];
}

function setValue(name, value) {
  if (name === TORQUE) state.torque = value;
  else state.values[NAMES.indexOf(name)] = value;
  const range = rangeOf(name);
  if (value < range[0]) range[0] = value;
  if (value > range[1]) range[1] = value;
}

function writeLink() {
  const parts = [];
  state.values.forEach((value, i) => {
    if (value !== null) parts.push([`p.${NAMES[i]}`, String(value)]);
  });
  if (state.damping) parts.push(["damping", String(state.damping)]);
  if (state.torque) parts.push(["torque", String(state.torque)]);
  parts.push(["orbits", state.orbits.map((one) => one.join("_")).join("~")]);
  parts.push(["diagram", state.diagram], ["x", state.x], ["y", state.y], ["series", state.series], ["angles", state.angles]);
  if (!state.basins) parts.push(["basins", "0"]);
  if (writeUnits()) parts.push(["units", writeUnits()]);
  if (state.theme) parts.push(["theme", state.theme]);
  return `#${parts.map(([key, value]) => `${encodeURIComponent(key)}=${encodeURIComponent(value)}`).join("&")}`;
}

// Takes what is legal of a link, and says what is not.
function readLink(text) {
  const complaints = [];
  const given = new URLSearchParams(text.replace(/^#/, "").replace(/\+/g, "%2B"));
  const finite = (key, value, low) => {
    const number = value.trim() === "" ? NaN : Number(value);
    if (Number.isFinite(number) && number >= low) return number;
    complaints.push(`${key}: wants a number${low === 0 ? " >= 0" : ""}`);
    return null;
  };
  for (const [key, value] of given) {
    const index = key.startsWith("p.") ? NAMES.indexOf(key.slice(2)) : -1;
    if (index >= 0) {
      const number = value.trim() === "" ? NaN : Number(value);
      const why = refused(index, number);
      if (why) complaints.push(why);
      else setValue(NAMES[index], number);
    } else if (key === "damping") {
      state.damping = finite(key, value, 0) ?? state.damping;
      dampingRange[1] = Math.max(dampingRange[1], state.damping);
    } else if (key === "torque") setValue(TORQUE, finite(key, value, -Infinity) ?? state.torque);
    else if (key === "orbits") {
      const plain = (one) => (one.trim() === "" ? NaN : Number(one));
      const found = value ? value.split("~").map((one) => one.split("_").map(plain)) : [];
      const whole = found.filter((one) => one.length === 2 && one.every(Number.isFinite));
      if (whole.length < found.length) complaints.push("orbits: wants pairs of numbers");
      state.orbits = whole.slice(-8);
    } else if (["diagram", "x", "y"].includes(key) && AXES.includes(value)) state[key] = value;
    else if (key === "series" && ["x", "v"].includes(value)) state[key] = value;
    else if (key === "angles" && ["rad", "deg"].includes(value)) state.angles = value;
    else if (key === "basins" && ["0", "1"].includes(value)) state.basins = value === "1";
    else if (key === "units") {
      if (!readUnits(value)) complaints.push("units: wants pairs such as m:mm");
    } else if (key === "theme" && ["light", "dark"].includes(value)) state.theme = value;
    else complaints.push(`${key}: not known here`);
  }
  return complaints;
}

// The potential at the page's state, or with an axis at another value.
function potentialAt(name = null, value = 0, other = null, second = 0) {
  const p = state.values.slice();
  let { torque } = state;
  for (const [axis, x] of [[name, value], [other, second]]) {
    if (axis === TORQUE) torque = x;
    else if (axis !== null) p[NAMES.indexOf(axis)] = x;
  }
  return [p.map((x) => (x === null ? NaN : x)), torque];
}

// The same over two axes, in one array that the next call changes.
function sampler(name, other) {
  const [p, constant] = potentialAt();
  const [i, j] = [NAMES.indexOf(name), NAMES.indexOf(other)];
  return (x, y) => {
    if (i >= 0) p[i] = x;
    if (j >= 0) p[j] = y;
    return [p, name === TORQUE ? x : other === TORQUE ? y : constant];
  };
}

const make = (p, torque) => new Potential(LAW, p, torque);

// An orbit to begin with: round the deepest center, from some way to the next equilibrium.
function firstOrbits() {
  const pot = make(...potentialAt());
  const centers = pot.points.filter((one) => one.kind === CENTER);
  if (!centers.length) return [];
  const center = centers.reduce((a, b) => (b.energy < a.energy ? b : a));
  const i = pot.points.indexOf(center);
  const [low, high] = pot.window();
  const sides = [pot.at(i + 1) ?? high, pot.at(i - 1) ?? low];
  for (const share of [0.6, 0.3, 0.1]) {
    for (const next of sides) {
      const x = Number((center.x + share * (next - center.x)).toPrecision(3));
      if (x > low && x < high && pot.orbit(x, 0).kind === "libration") return [[x, 0]];
    }
  }
  return [];
}
