// The page of equations: its controls, and what follows from them: one scene, drawn at once; searches follow in pieces.

const plots = Object.fromEntries(["portrait", "series", "diagram", "map"].map((id) => [id, new Plot($(id))]));
const scene = { timing: 0, rests: [], cycles: [], manifolds: [], motions: [], stale: [], diagram: null, searched: "", cursor: null };
const STARTS = 400; // of Newton's method, where equilibria are looked for

const nameOf = (i) => FACTS.states[i].name;
const unitsOfState = (i) => (FACTS.states[i].angle ? "rad" : FACTS.states[i].units);
const unitsOfParameter = (name) => FACTS.parameters[NAMES.indexOf(name)].units;
const scaleOfState = (i) => tickScale(unitsOfState(i));
const scaleOfParameter = (name) => tickScale(unitsOfParameter(name));
function withUnit(name, units) {
  const shown = shownUnit(units);
  return shown ? `${name}, ${unitWords(shown)}` : name;
}
const stateWords = (i) => withUnit(nameOf(i), unitsOfState(i));
const parameterWords = (name) => withUnit(name, unitsOfParameter(name));
const valueText = (name, value) => `${name} = ${digits(value / factorOf(unitsOfParameter(name)))}${unitsOfParameter(name) ? ` ${unitWords(shownUnit(unitsOfParameter(name)))}` : ""}`;
const stateText = (i, x, n) => `${digits(x / factorOf(unitsOfState(i)), n)}${FACTS.states[i].angle && state.angles === "deg" && Number.isFinite(x) ? "°" : ""}`;

// ---------------------------------------------------------------- controls

function makeControls() {
  FACTS.parameters.forEach((one, i) => {
    const write = (value) => {
      const why = refused(i, value);
      if (!why) setValue(one.name, value);
      return why;
    };
    addSlider($("sliders"), one.name, one.meaning === `parameter ${one.name}` ? "" : one.meaning, one.units, () => state.values[i], write, () => ranges[i]);
  });
  $("parameters").hidden = !NAMES.length;
  addSlider($("extras"), "duration", LAW.discrete ? "iterations that are shown" : "time for which motions are shown", "", () => state.duration,
    (value) => {
      const why = refusedTime(value);
      if (!why) setDuration(value);
      return why;
    }, () => durationRange);
  FACTS.states.forEach((one, i) => {
    const id = `start-${i}`;
    const line = element("p", "", { class: "start" });
    const input = element("input", "", { type: "text", inputmode: "decimal", id });
    line.append(element("label", one.name, { for: id }), input);
    $("starts").append(line);
    input.addEventListener("change", () => {
      const value = readNumber(input.value, unitsOfState(i), factorOf(unitsOfState(i)));
      const why = Number.isFinite(value) ? "" : `${one.name}: wants ${doubt(input.value) || "a number"}`;
      input.setAttribute("aria-invalid", String(why !== ""));
      complain(why ? [why] : []);
      if (!why) state.next[i] = value;
    });
  });
  for (const [id, key] of [["plane-x", "x"], ["plane-y", "y"], ["series-of", "series"]]) choice(id, key, STATES);
  choice("diagram-x", "diagram", NAMES);
  MAPS.forEach((one, i) => $("map-of").append(element("option", `${one.x} and ${one.y}`, { value: i })));
  $("map-of").addEventListener("change", () => {
    state.map = Number($("map-of").value);
    update(null);
  });
  $("plane").hidden = LAW.n < 3;
  $("diagram-part").hidden = !NAMES.length;
  $("map-part").hidden = !MAPS.length;
  $("cycles-part").hidden = !PLANAR;
  $("equilibria-part").hidden = FORCED;
  if (LAW.discrete) $("equilibria-title").textContent = "Fixed points";
  if (LAW.n === 1) $("portrait-title").textContent = LAW.discrete ? "Graph of the map" : "Rate";
  if (LAW.n > 2) $("portrait-title").textContent = "Projection";
}

function choice(id, key, names) {
  names.forEach((name) => $(id).append(element("option", name, { value: name })));
  $(id).addEventListener("change", () => {
    state[key] = $(id).value;
    update(null);
  });
}

function showControls(moved) {
  showSliders(moved);
  $("basins").checked = state.basins;
  $("basins-label").hidden = !BASINS;
  for (const [id, key] of [["plane-x", "x"], ["plane-y", "y"], ["series-of", "series"], ["diagram-x", "diagram"], ["map-of", "map"], ["angles", "angles"]]) $(id).value = state[key];
  FACTS.states.forEach((_, i) => {
    const input = $(`start-${i}`);
    if (document.activeElement === input) return;
    input.value = digits(state.next[i] / factorOf(unitsOfState(i)), 8).replace("−", "-");
    input.setAttribute("aria-invalid", "false");
  });
}

// ---------------------------------------------------------------- drawing

const INVALID = "With these parameters the equations have no finite value in the window";
const UNTIMED = "With these parameters the force has no period > 0";

// Draws what a change needs; `moved` is the slider under the hand.
function update(moved) {
  const start = performance.now();
  showControls(moved);
  const system = make([...state.values]);
  if (!state.basins || scene.basins?.key !== JSON.stringify(state.values)) scene.basins = null;
  scene.plane = [STATES.indexOf(state.x), STATES.indexOf(state.y)];
  if (scene.plane[0] === scene.plane[1] && LAW.n > 1) scene.plane[1] = scene.plane[0] ? 0 : 1;
  const [i, k] = scene.plane;
  scene.words = LAW.n > 1
    ? { x: stateWords(i), y: stateWords(k), xScale: scaleOfState(i), yScale: scaleOfState(k) }
    : { x: stateWords(0), y: LAW.discrete ? `next ${nameOf(0)}` : `d${nameOf(0)}/dt`, xScale: scaleOfState(0), yScale: LAW.discrete ? scaleOfState(0) : "" };
  scene.system = system;
  const why = system.timed ? (isValid(system) ? "" : INVALID) : UNTIMED;
  document.body.classList.toggle("invalid", why !== "");
  if (why) {
    complain([why]);
    $("status").textContent = why;
    cancel();
    for (const id of ["equilibria", "cycles", "motions"]) $(id).replaceChildren();
    for (const id of ["equilibria-note", "cycles-note", "hover", "portrait-text", "series-text", "map-text"]) $(id).textContent = "";
    later(tellTaken);
    scene.searched = "";
    scene.diagram = null;
    rewind();
    drawOver(plots.portrait, []);
    return;
  }
  if ([INVALID, UNTIMED].includes($("alert").textContent)) complain([]);
  if (PLANAR) scene.grid = system.nullclineGrid(56);
  scene.rests = system.equilibria(scene.rests.map((one) => one.x), LAW.n > 2 ? 12 : 40);
  settleFlow(system);
  scene.motions = motionsOf(system, moved);
  scene.stale = staleOf();
  drawPortrait(plots.portrait, scene);
  setClock(clock.t);
  startDiagram();
  if (MAPS.length) drawMap(plots.map, scene);
  hover(scene.pointed);
  $("copied").textContent = "";
  scene.timing = performance.now() - start;
  later(tell);
  search();
}

// Under the hand motions go as far as they come in a few milliseconds; the rest follows when it rests.
const HAND = 6; // ms, of all motions
function motionsOf(system, moved) {
  const start = performance.now();
  const share = HAND / state.motions.length;
  return state.motions.map((x0, n) => system.motion(x0, state.duration, moved === null ? {} : { until: start + (n + 1) * share }));
}

function* goOn() {
  const { system } = scene;
  for (let n = 0; n < scene.motions.length; n++) {
    if (scene.motions[n].why !== "hurried") continue;
    scene.motions[n] = system.motion(state.motions[n], state.duration);
    yield;
  }
  drawPortrait(plots.portrait, scene);
  setClock(clock.t);
  later(tell);
}

// What belongs to the equilibria and cycles at hand.
function settleFlow(system) {
  const flows = !LAW.discrete && !FORCED && LAW.n > 1;
  scene.manifolds = flows ? scene.rests.filter((one) => one.unstable && one.unstable < LAW.n && one.kind === SADDLE).flatMap((one) => system.manifolds(one, scene.rests)) : [];
  if (PLANAR) scene.cycles = new Returns(system, scene.rests).again(scene.cycles);
}

function isValid(system) {
  const out = new Float64Array(LAW.n);
  for (let i = 0; i < 60; i++) {
    LAW.rates(Float64Array.from(system.spread(i)), system.p, 0, out);
    if (out.every(Number.isFinite)) return true;
  }
  return false;
}

// Parameters beside those of the map that have moved since its curves were computed.
function staleOf() {
  const map = MAPS[state.map];
  if (!map) return [];
  return FACTS.parameters.filter((one, i) => one.name !== map.x && one.name !== map.y && state.values[i] !== one.value);
}

// ---------------------------------------------------------------- searches, in pieces

const BASINS = LAW.n === 2 && !FORCED;

function search() {
  const key = JSON.stringify(state.values);
  const tasks = [];
  if (scene.motions.some((one) => one.why === "hurried")) tasks.push(goOn());
  if (key !== scene.searched && !FORCED && LAW.n > 1) tasks.push(searchAll(key));
  if (scene.basins && scene.basins.key !== key) scene.basins = null;
  if (scene.diagram && !scene.diagram.done) tasks.push(scene.diagram.work);
  if (BASINS && state.basins && !scene.basins?.done) tasks.push(searchBasins(key));
  begin(tasks);
}

function* searchBasins(key) {
  const { system } = scene;
  const made = new Basins(system.ends(scene.rests, scene.cycles), [system.low[0], system.high[0]], [system.low[1], system.high[1]]);
  made.key = key;
  yield* made.work(() => {
    scene.basins = made;
    drawPortrait(plots.portrait, scene);
    later(tell);
  });
}

// Equilibria from more starts, and all cycles that the sections show.
function* searchAll(key) {
  const { system } = scene;
  if (LAW.n > 2) {
    const found = scene.rests.map((one) => Float64Array.from(one.x));
    for (let i = 12; i < STARTS; i++) {
      system.keep(found, system.spread(i));
      if (i % 8 === 0) yield;
    }
    if (found.length !== scene.rests.length) scene.rests = found.sort((one, other) => one[0] - other[0]).map((x) => system.described(x));
  }
  if (PLANAR) {
    const returns = new Returns(system, scene.rests);
    scene.cycles = returns.apart([...(yield* returns.search()), ...scene.cycles]);
    scene.family = returns.family;
  }
  if (LAW.n > 2) settleFlow(system);
  scene.searched = key;
  drawPortrait(plots.portrait, scene);
  later(tell);
}

// Where motions end up, value by value of a parameter, beside the equilibria.
function startDiagram() {
  if (!NAMES.length) return;
  const i = STATES.indexOf(state.series);
  const range = rangeOf(state.diagram);
  const fixed = state.values.filter((_, k) => NAMES[k] !== state.diagram);
  const key = JSON.stringify([state.diagram, range, i, fixed, state.duration]);
  if (!scene.diagram || key !== scene.diagram.key) {
    const columns = LAW.discrete ? 300 : 120;
    const diagram = { key, columns, found: [], done: false };
    diagram.work = diagramWork(diagram, i, [...range], columns);
    scene.diagram = diagram;
  }
  drawDiagram(plots.diagram, scene);
}

function* diagramWork(diagram, i, range, columns) {
  const place = NAMES.indexOf(state.diagram);
  const values = [...state.values];
  const begin = () => Float64Array.from(state.motions.at(-1) ?? state.next);
  let last = begin();
  let rests = [];
  for (let column = 0; column < columns; column++) {
    const value = range[0] + ((range[1] - range[0]) * (column + 0.5)) / columns;
    values[place] = value;
    const system = make([...values]);
    if (!system.timed) continue;
    rests = system.equilibria(rests.map((one) => one.x), LAW.n === 1 ? 24 : LAW.n === 2 ? 20 : 10);
    yield;
    const { samples, x } = samplesOf(system, last, i);
    yield;
    // A motion that has come to rest where it is not stable any more would stay there.
    last = x ? x.map((one, k) => one + 1e-4 * system.scales[k] * (k % 2 ? -1 : 1)) : begin();
    diagram.found.push({ value, samples, rests });
    if (column % 10 === 9) drawDiagram(plots.diagram, scene);
  }
  diagram.done = true;
  drawDiagram(plots.diagram, scene);
}

// Of a map its iterates, of a forced flow the states once a period, else largest (of two states also least) values.
function samplesOf(system, start, i) {
  const samples = [];
  if (LAW.discrete) {
    const { rows, why, x } = system.iterates(start, 500);
    if (why === "escaped") return { samples, x: null };
    return { samples: rows.slice(380).map((row) => row[i + 1]), x };
  }
  const { scales, turns, low } = system;
  const duration = FORCED ? 60 * system.period : state.duration;
  const before = follow(system.rates, start, 0, duration, { scales, rtol: 1e-6, most: 3000 });
  // After so many steps, too, it is where motions end up.
  const away = !["end", "steps"].includes(before.why) || before.x.some((one, k) => !turns[k] && Math.abs(one - low[k]) > 100 * scales[k]);
  if (away) return { samples, x: null };
  if (LAW.n === 1) return { samples: [before.x[0]], x: before.x };
  const seen = (value) => (turns[i] ? low[i] + (value - low[i] - turns[i] * Math.floor((value - low[i]) / turns[i])) : value);
  let next = system.period;
  // Greatest values between swings that can be seen; a rate that is nearly zero may change its sign by rounding.
  const swing = 1e-3 * scales[i];
  let [way, top, bottom] = [0, before.x[i], before.x[i]];
  const extremes = (value) => {
    [top, bottom] = [Math.max(top, value), Math.min(bottom, value)];
    if (way >= 0 && value < top - swing) {
      if (way) samples.push(seen(top));
      [way, bottom] = [-1, value];
    } else if (way <= 0 && value > bottom + swing) {
      if (way && LAW.n === 2) samples.push(seen(bottom));
      [way, top] = [1, value];
    }
  };
  const end = follow(system.rates, before.x, 0, FORCED ? 30 * system.period : duration, {
    scales, rtol: 1e-6, most: 3000,
    each: (t, x, was, from, h, stepper) => {
      if (FORCED) {
        while (t >= next * (1 - 1e-12)) {
          samples.push(seen(between(was, x, stepper, (next - from) / h, h)[i]));
          next += system.period;
        }
        return false;
      }
      const [a, b] = [stepper.k[0][i], stepper.k[6][i]];
      if (a * b < 0) {
        const stiff = stepper instanceof StiffStepper; // a cubic over its long steps would go too far
        extremes((stiff ? located(stepper, was, from, h, (z, f) => f[i]).x : between(was, x, stepper, a / (a - b), h))[i]);
      }
      extremes(x[i]);
      return false;
    },
  });
  // What goes round and round, or is on its way, has no greatest value yet.
  if (!samples.length && top - bottom <= swing) samples.push(seen(end.x[i]));
  return { samples, x: end.x };
}

// ---------------------------------------------------------------- a moving dot

const playLength = () => (scene.motions.length && !document.body.classList.contains("invalid") ? state.duration : 0);

function showTime() {
  drawSeries(plots.series, scene);
  const dots = [];
  scene.motions.forEach(({ rows }, n) => {
    const row = rowAt(rows, clock.t, LAW.discrete);
    if (!row) return;
    const x = row.slice(1);
    const [at] = LAW.n > 1 ? folded([x], ...scene.plane, scene.system) : [[x[0], LAW.discrete ? x[0] : 0]];
    dots.push({ x: at[0], y: at[1], color: motionPaint(n) });
  });
  drawOver(plots.portrait, dots);
}

// ---------------------------------------------------------------- hands

function startMotion(x0) {
  rewind();
  complain([]);
  state.next = x0;
  state.motions = [...state.motions.slice(1 - MOST_MOTIONS), x0];
  update(null);
  $("status").textContent = `Motion started at ${x0.map((x, i) => `${nameOf(i)} = ${stateText(i, x, 5)}`).join(", ")}`;
}

// A start at a place of the portrait; states that are not seen stay as they are set.
function stateAt(x, y) {
  const made = [...state.next];
  made[scene.plane[0]] = x;
  if (LAW.n > 1) made[scene.plane[1]] = y;
  return made;
}

function moveTo(pairs) {
  for (const [name, value] of pairs) if (!refused(NAMES.indexOf(name), value)) setValue(name, value);
  complain([]);
  update(null);
}

function wire() {
  onPlot(plots.portrait, (at, dragged) => dragged || startMotion(stateAt(at.x, at.y)), hover);
  onPlot(plots.diagram, (at) => moveTo([[state.diagram, at.x]]));
  onPlot(plots.map, (at) => moveTo([[MAPS[state.map].x, at.x], [MAPS[state.map].y, at.y]]));
  onKeys(plots.portrait, (key, step) => {
    const { portrait } = plots;
    if (key === "Delete") {
      rewind();
      state.motions = [];
    }
    else if (key === "Escape") scene.cursor = null;
    else if (step) {
      const [x, y] = scene.cursor ?? [0.5 * (portrait.x[0] + portrait.x[1]), 0.5 * (portrait.y[0] + portrait.y[1])];
      scene.cursor = [within(x + step[0], portrait.x), within(y + step[1], portrait.y)];
      hover(scene.cursor);
      $("status").textContent = $("hover").textContent;
      drawPortrait(portrait, scene);
      return undefined;
    } else if (scene.cursor) return startMotion(stateAt(...scene.cursor));
    return update(null);
  });
  onKeys(plots.diagram, (key, step) => {
    if (!step || step[1]) return false;
    return moveTo([[state.diagram, within(valueOf(state.diagram) + step[0], plots.diagram.x)]]);
  });
  onKeys(plots.map, (key, step) => {
    if (!step || !MAPS[state.map]) return false;
    const { x, y } = MAPS[state.map];
    return moveTo([[x, within(valueOf(x) + step[0], plots.map.x)], [y, within(valueOf(y) + step[1], plots.map.y)]]);
  });
  $("start").addEventListener("click", () => startMotion([...state.next]));
  $("clear").addEventListener("click", () => { rewind(); state.motions = []; update(null); });
  wirePlay(plots.series);
  $("controls").addEventListener("submit", (event) => event.preventDefault());
  $("reset").addEventListener("click", () => {
    Object.assign(state, startState(), { theme: state.theme, angles: state.angles, units: state.units });
    complain([]);
    rewind();
    update(null);
  });
  $("angles").addEventListener("change", () => { state.angles = $("angles").value; update(null); });
  $("theme").addEventListener("click", () => {
    state.theme = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    applyTheme();
  });
  $("save-picture").addEventListener("click", async () => {
    const values = NAMES.map((name, i) => `${name} = ${digits(state.values[i])}`).join(", ");
    download("phasekit.png", await picture(Object.values(plots).map((one) => one.canvas), `${FACTS.law.join(", ")}: ${values}`));
  });
  $("save-data").addEventListener("click", () => download("phasekit.json", new Blob([toText(dataOf())], { type: "application/json" })));
  $("save-python").addEventListener("click", () => download("phasekit.py", new Blob([pythonOf()], { type: "text/x-python" })));
  wireCopies();
  wireBasins();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", applyTheme);
  window.addEventListener("hashchange", () => { if (location.hash !== writeLink()) load(); });
  new ResizeObserver(() => update(null)).observe($("portrait"));
}

function load() {
  const { theme } = state;
  Object.assign(state, startState(), { theme });
  complain(location.hash ? readLink(location.hash) : []);
  applyTheme();
}

$("model").textContent = FACTS.model;
FACTS.law.forEach((line) => $("law").append(element("span", line), " "));
$("angles-label").hidden = !FACTS.states.some((one) => one.angle) && !FACTS.parameters.some((one) => one.units === "rad");
addUnits();
makeControls();
wire();
load();

// For tests and for the console of the browser.
window.phasekit = { state, scene, clock, plots, law: LAW, make, Returns, System, follow, readNumber, searches, dataOf, update, special };
