// What the page of equations shows, and how a link says it.

const STATES = FACTS.states.map((one) => one.name);
const MAPS = FACTS.maps;
const FORCED = Boolean(LAW.period);
const PLANAR = LAW.n === 2 && !LAW.discrete && !FORCED;
const MOST_MOTIONS = 6;

function startState() {
  const [x, y] = FACTS.plane;
  return {
    values: FACTS.parameters.map((one) => one.value),
    motions: [FACTS.states.map((one) => one.start)],
    next: FACTS.states.map((one) => one.start),
    duration: FACTS.duration,
    x,
    y,
    series: x,
    diagram: MAPS.length ? MAPS[0].x : NAMES[0] ?? "",
    map: 0,
    angles: "rad",
    units: {},
    basins: true,
    theme: "",
  };
}

const state = startState();
const durationRange = [0, 2.5 * FACTS.duration];

const rangeOf = (name) => ranges[NAMES.indexOf(name)];
const valueOf = (name) => state.values[NAMES.indexOf(name)];

function setValue(name, value) {
  state.values[NAMES.indexOf(name)] = value;
  const range = rangeOf(name);
  if (value < range[0]) range[0] = value;
  if (value > range[1]) range[1] = value;
}

function refusedTime(value) {
  if (!(Number.isFinite(value) && value > 0)) return `duration: wants a number > 0`;
  if (LAW.discrete && value > 1e5) return "duration: wants at most 100000 iterations";
  return "";
}

function setDuration(value) {
  state.duration = LAW.discrete ? Math.max(1, Math.round(value)) : value;
  durationRange[1] = Math.max(durationRange[1], state.duration);
}

function writeLink() {
  const parts = state.values.map((value, i) => [`p.${NAMES[i]}`, String(value)]);
  parts.push(["motions", state.motions.map((one) => one.join("_")).join("~")], ["duration", String(state.duration)]);
  parts.push(["x", state.x], ["y", state.y], ["series", state.series], ["diagram", state.diagram], ["map", String(state.map)], ["angles", state.angles]);
  if (!state.basins) parts.push(["basins", "0"]);
  if (writeUnits()) parts.push(["units", writeUnits()]);
  if (state.theme) parts.push(["theme", state.theme]);
  return `#${parts.map(([key, value]) => `${encodeURIComponent(key)}=${encodeURIComponent(value)}`).join("&")}`;
}

// Takes what is legal of a link, and says what is not.
function readLink(text) {
  const complaints = [];
  const given = new URLSearchParams(text.replace(/^#/, "").replace(/\+/g, "%2B"));
  const plain = (value) => (value.trim() === "" ? NaN : Number(value));
  for (const [key, value] of given) {
    const index = key.startsWith("p.") ? NAMES.indexOf(key.slice(2)) : -1;
    if (index >= 0) {
      const why = refused(index, plain(value));
      if (why) complaints.push(why);
      else setValue(NAMES[index], plain(value));
    } else if (key === "motions") {
      const found = value ? value.split("~").map((one) => one.split("_").map(plain)) : [];
      const whole = found.filter((one) => one.length === LAW.n && one.every(Number.isFinite));
      if (whole.length < found.length) complaints.push(`motions: wants ${LAW.n} numbers each`);
      state.motions = whole.slice(-MOST_MOTIONS);
    } else if (key === "duration") {
      const why = refusedTime(plain(value));
      if (why) complaints.push(why);
      else setDuration(plain(value));
    } else if (["x", "y", "series"].includes(key) && STATES.includes(value)) state[key] = value;
    else if (key === "diagram" && (NAMES.includes(value) || (value === "" && !NAMES.length))) state.diagram = value;
    else if (key === "map" && (MAPS[plain(value)] || (value === "0" && !MAPS.length))) state.map = plain(value);
    else if (key === "angles" && ["rad", "deg"].includes(value)) state.angles = value;
    else if (key === "basins" && ["0", "1"].includes(value)) state.basins = value === "1";
    else if (key === "units") {
      if (!readUnits(value)) complaints.push("units: wants pairs such as m:mm");
    } else if (key === "theme" && ["light", "dark"].includes(value)) state.theme = value;
    else complaints.push(`${key}: not known here`);
  }
  return complaints;
}

const make = (values = state.values) => new System(LAW, values, FACTS.states, FACTS.conservative);
