// The controls, and what follows from them: one scene, drawn at once.

const plots = Object.fromEntries(["portrait", "series", "machine", "well", "diagram", "map", "force"].map((id) => [id, new Plot($(id))]));
const LABELS = {
  lower_center: "lower center", upper_center: "upper center", lower_saddle: "lower saddle", upper_saddle: "upper saddle",
  lower_well: "lower well", upper_well: "upper well", outer: "outer, round both wells", well: "well", none: "–",
};
const scene = { timing: 0, mapCells: null, history: { rows: [], length: 1 } };
let pending = 0;

const unitsOfAxis = (name) => FACTS.parameters[NAMES.indexOf(name)]?.units ?? "";
const scaleOf = (name) => tickScale(unitsOfAxis(name));
const valueText = (name) => `${name} = ${digits(valueOf(name) / factorOf(unitsOfAxis(name)))}${unitsOfAxis(name) ? ` ${unitWords(shownUnit(unitsOfAxis(name)))}` : ""}`;
const coordinate = () => (FACTS.coordinate === "phi" ? "φ" : FACTS.coordinate);
const angleText = (x, n) => (FACTS.angle && state.angles === "deg" && Number.isFinite(x) ? `${digits(x / (Math.PI / 180), n)}°` : digits(x, n));

function axisWords(name) {
  if (name === TORQUE) return LAW.kind === "trigonometric" ? "torque, s⁻²" : "torque";
  const shown = shownUnit(unitsOfAxis(name));
  return shown ? `${name}, ${unitWords(shown)}` : name;
}

// ---------------------------------------------------------------- controls

function makeControls() {
  FACTS.parameters.forEach((one, i) => {
    const write = (value) => {
      const why = refused(i, value);
      if (!why) setValue(one.name, value);
      return why;
    };
    addSlider($("sliders"), one.name, one.meaning, one.units, () => state.values[i], write, () => ranges[i]);
  });
  const mechanical = LAW.kind === "trigonometric";
  const finite = (name, low, keep) => (value) => {
    if (!Number.isFinite(value) || value < low) return `${name}: wants a number${low === 0 ? " >= 0" : ""}`;
    keep(value);
    return "";
  };
  addSlider($("extras"), "damping", "δ in the force −δ × velocity", mechanical ? "s-1" : "", () => state.damping,
    finite("damping", 0, (x) => { state.damping = x; dampingRange[1] = Math.max(dampingRange[1], x); }), () => dampingRange, true);
  addSlider($("extras"), TORQUE, "constant, added to −V′", mechanical ? "s-2" : "", () => state.torque,
    finite(TORQUE, -Infinity, (x) => setValue(TORQUE, x)), () => torqueRange, true);
  for (const [id, key] of [["diagram-x", "diagram"], ["map-x", "x"], ["map-y", "y"]]) {
    AXES.forEach((name) => $(id).append(element("option", name, { value: name })));
    $(id).addEventListener("change", () => {
      state[key] = $(id).value;
      update(null);
    });
  }
  SERIES.forEach((key, i) => $("series-of").append(element("option", i ? `d${coordinate()}/dt` : coordinate(), { value: key })));
  $("series-of").addEventListener("change", () => {
    state.series = $("series-of").value;
    update(null);
  });
  $("machine-part").hidden = !FACTS.angle;
  $("machine-title").textContent = FACTS.machine ? "Machine" : `${coordinate()} on its circle`;
  $("machine-help").textContent = FACTS.machine
    ? "The carrier turns with omega1 about the vertical; blue: the bearings; black: O2; red: the mass center."
    : `${coordinate()} is counted from below, against the clock.`;
}

function showControls(moved) {
  showSliders(moved);
  $("diagram-x").value = state.diagram;
  $("map-x").value = state.x;
  $("map-y").value = state.y;
  $("angles").value = state.angles;
  $("basins").checked = state.basins;
  $("basins-label").hidden = !(state.damping > 0);
  $("series-of").value = state.series;
}

// ---------------------------------------------------------------- drawing

const INVALID = "At these parameters there is no such system, or a number is not finite";

// Draws what a change needs; `moved` is the slider under the hand.
function update(moved) {
  const start = performance.now();
  showControls(moved);
  [scene.p] = potentialAt();
  const pot = make(scene.p, state.torque);
  Object.assign(scene, { pot, orbits: state.orbits, damping: state.damping, scale: FACTS.angle ? state.angles : "" });
  const x = coordinate();
  const seconds = LAW.kind === "trigonometric";
  scene.words = { x: FACTS.angle ? `${x}, ${state.angles}` : x, v: seconds ? `d${x}/dt, s⁻¹` : `d${x}/dt`, V: seconds ? "V, s⁻²" : "V" };
  scene.loaded = Boolean(LAW.loads) && scene.p.every(Number.isFinite);
  document.body.classList.toggle("invalid", !pot.valid);
  if (!pot.valid) {
    complain([INVALID]);
    rewind();
    cancel();
    scene.basins = null;
    drawOver(plots.portrait, []);
    later(tellInvalid);
    return;
  }
  if ($("alert").textContent === INVALID) complain([]);
  scene.view = view(pot, state.orbits);
  scene.curves = state.orbits.map((one) => orbitCurve(pot, one, state.damping, scene.view));
  startBasins();
  drawPortrait(plots.portrait, pot, scene);
  scene.history = state.orbits.length ? timeHistory(pot, state.orbits.at(-1), state.damping, scene.view) : { rows: [], length: 1 };
  setClock(clock.t);
  drawDiagram(plots.diagram, diagramScene(), (value) => make(...potentialAt(state.diagram, value)));
  drawForces();
  startMap();
  hover(scene.pointed);
  $("copied").textContent = "";
  scene.timing = performance.now() - start;
  later(tell);
}

function diagramScene() {
  const name = state.diagram;
  return { view: scene.view, pot: scene.pot, words: scene.words, scale: scene.scale, range: rangeOf(name), axis: axisWords(name), axisScale: scaleOf(name), at: valueOf(name) };
}

// Where damped motions end, point by point of the portrait, when nothing has moved for a while.
function startBasins() {
  const { pot, view: { low, high, speed } } = scene;
  const wanted = state.basins && state.damping > 0 && pot.points.length > 0;
  const key = JSON.stringify([state.values, state.damping, state.torque, low, high, speed]);
  if (!wanted) scene.basins = null;
  else if (scene.basins?.key !== key) {
    scene.basins = new Basins(endsOf(pot, state.damping), [low, high], [-speed, speed]);
    scene.basins.key = key;
  }
  const { basins } = scene;
  if (basins && !basins.done) {
    basins.task ??= basins.work(() => {
      drawPortrait(plots.portrait, scene.pot, scene);
      later(tell);
    });
    begin([basins.task]);
  } else begin([]);
}

// ---------------------------------------------------------------- the newest orbit at a time

const playLength = () => (scene.history.rows.length && scene.pot.valid ? scene.history.length : 0);

function showTime() {
  const { pot, history } = scene;
  const row = rowAt(history.rows, clock.t);
  scene.now = row && wrapped(pot, [row.slice(1)])[0];
  drawSeries(plots.series, scene);
  drawWell(plots.well, pot, scene);
  if (FACTS.angle) drawMachine(plots.machine, row ?? [0, pot.points[0]?.x ?? 0]);
  drawOver(plots.portrait, row ? [{ x: scene.now[0], y: scene.now[1], color: "orbit" }] : []);
  $("series-text").textContent = timeText(row);
}

function drawForces() {
  $("forces").hidden = !FACTS.machine;
  if (!FACTS.machine) return;
  const points = scene.curves.at(-1);
  scene.forceRows = scene.loaded && points ? forceCurves(LAW, scene.p, points) : [];
  drawForce(plots.force, scene.forceRows, scene);
}

// The map belongs to all parameters but its own two; it is made in pieces, so that nothing waits. Where it is in closed
// form a coarse one is shown until it is whole.
function startMap() {
  const [xName, yName] = [state.x, state.y];
  const whole = xName !== yName;
  $("map").hidden = !whole;
  if (!whole) {
    scene.map = null;
    return;
  }
  const closed = LAW.kind === "trigonometric";
  const fixed = AXES.filter((name) => name !== xName && name !== yName).map(valueOf);
  const key = JSON.stringify([xName, yName, rangeOf(xName), rangeOf(yName), fixed]);
  if (key !== scene.mapKey) {
    scene.mapKey = key;
    const at = sampler(xName, yName);
    const count = (x, y) => countEquilibria(LAW, ...at(x, y));
    const over = (columns, rows) => new ParameterMap(count, [...rangeOf(xName)], [...rangeOf(yName)], columns, rows);
    scene.map = closed ? over(120, 90) : over(48, 36);
    scene.coarse = closed ? over(32, 24) : null;
    if (closed) scene.coarse.work(Infinity);
    else scene.map.work(2);
  }
  drawMap();
  if (scene.map.next <= scene.map.columns && !pending) pending = setTimeout(continueMap, 0);
}

function continueMap() {
  pending = 0;
  if (!scene.map || scene.map.next > scene.map.columns) return;
  if (scene.map.work(8) || !scene.coarse) drawMap();
  if (scene.map.next <= scene.map.columns) pending = setTimeout(continueMap, 0);
}

function drawMap() {
  const at = [valueOf(state.x), valueOf(state.y)];
  const whole = scene.map.next > scene.map.columns;
  (whole || !scene.coarse ? scene.map : scene.coarse).draw(plots.map, { xName: axisWords(state.x), yName: axisWords(state.y), xScale: scaleOf(state.x), yScale: scaleOf(state.y), at });
}

// ---------------------------------------------------------------- hands

function startOrbit(x, v) {
  rewind();
  state.orbits = [...state.orbits.slice(-7), [x, v]];
  update(null);
  const orbit = scene.pot.orbit(x, v);
  complain([]);
  $("status").textContent = `Orbit started: ${familyWords(orbit)}, period ${digits(orbit.period, 6)}`;
}

function moveTo(pairs) {
  for (const [name, value] of pairs) {
    const index = NAMES.indexOf(name);
    if (index >= 0 && refused(index, value)) continue;
    setValue(name, value);
  }
  complain([]);
  update(null);
}

function wire() {
  onPlot(plots.portrait, (at, dragged) => dragged || startOrbit(at.x, at.y), hover);
  onPlot(plots.map, (at) => moveTo([[state.x, at.x], [state.y, at.y]]));
  onPlot(plots.diagram, (at) => moveTo([[state.diagram, at.x]]));
  onKeys(plots.portrait, (key, step) => {
    if (key === "Delete") {
      rewind();
      state.orbits = [];
    }
    else if (key === "Escape") scene.cursor = null;
    else if (step) {
      const [x, v] = scene.cursor ?? [0.5 * (scene.view.low + scene.view.high), 0];
      scene.cursor = [within(x + step[0], plots.portrait.x), within(v + step[1], plots.portrait.y)];
      hover(scene.cursor);
      $("status").textContent = $("hover").textContent;
    } else if (scene.cursor) return startOrbit(...scene.cursor);
    return update(null);
  });
  onKeys(plots.map, (key, step) => {
    if (!step) return false;
    return moveTo([[state.x, within(valueOf(state.x) + step[0], plots.map.x)], [state.y, within(valueOf(state.y) + step[1], plots.map.y)]]);
  });
  onKeys(plots.diagram, (key, step) => {
    if (!step || step[1]) return false;
    return moveTo([[state.diagram, within(valueOf(state.diagram) + step[0], plots.diagram.x)]]);
  });
  $("clear").addEventListener("click", () => { rewind(); state.orbits = []; update(null); });
  wirePlay(plots.series);
  $("reset").addEventListener("click", () => {
    Object.assign(state, startState(), { theme: state.theme, angles: state.angles, units: state.units });
    state.orbits = firstOrbits();
    rewind();
    complain([]);
    update(null);
  });
  $("angles").addEventListener("change", () => { state.angles = $("angles").value; update(null); });
  $("theme").addEventListener("click", () => {
    state.theme = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    applyTheme();
  });
  wireExports();
  wireBasins();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", applyTheme);
  window.addEventListener("hashchange", () => { if (location.hash !== writeLink()) load(); });
  new ResizeObserver(() => update(null)).observe($("portrait"));
}

function wireExports() {
  const canvases = () => Object.values(plots).map((one) => one.canvas);
  $("save-picture").addEventListener("click", async () => {
    const values = NAMES.map((name, i) => `${name} = ${digits(state.values[i])}`).join(", ");
    download("phasekit.png", await picture(canvases(), `${FACTS.model}: ${values}`));
  });
  $("save-data").addEventListener("click", () => download("phasekit.json", new Blob([toText(dataOf(scene))], { type: "application/json" })));
  $("save-python").addEventListener("click", () => download("phasekit.py", new Blob([pythonOf(scene)], { type: "text/x-python" })));
  wireCopies();
}

function load() {
  const { theme } = state;
  Object.assign(state, startState(), { theme });
  complain(location.hash ? readLink(location.hash) : []);
  state.orbits ??= firstOrbits();
  applyTheme();
}

// Ranges of damping and torque suit the system that the page starts with.
function suit() {
  const pot = make(...potentialAt());
  const nice = (x) => (x > 0 && Number.isFinite(x) ? Number(x.toPrecision(1)) : 1);
  const [low, high] = pot.window();
  let most = 0;
  for (let i = 0; i <= 60; i++) most = Math.max(most, Math.abs(pot.slope(low + ((high - low) * i) / 60)) || 0);
  torqueRange[1] = nice(1.2 * most);
  torqueRange[0] = -torqueRange[1];
  dampingRange[1] = nice(Math.sqrt(pot.size));
}

$("model").textContent = FACTS.model;
$("law").textContent = FACTS.law;
$("angles-label").hidden = !FACTS.angle && !FACTS.parameters.some((one) => one.units === "rad");
addUnits();
suit();
makeControls();
wire();
load();

// For tests and for the console of the browser.
window.phasekit = {
  state, scene, clock, plots, law: LAW, make, Potential, countEquilibria, forceCurves, orbitCurve, readNumber, dataOf: () => dataOf(scene), update, special,
};
