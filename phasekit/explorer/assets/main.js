// The controls, and what follows from them: one scene, drawn at once.

const $ = (id) => document.getElementById(id);
const plots = Object.fromEntries(["portrait", "well", "diagram", "map", "force"].map((id) => [id, new Plot($(id))]));
const LABELS = {
  lower_center: "lower center", upper_center: "upper center", lower_saddle: "lower saddle", upper_saddle: "upper saddle",
  lower_well: "lower well", upper_well: "upper well", outer: "outer, round both wells", well: "well", none: "–",
};
const scene = { timing: 0, mapCells: null };
let pending = 0;

function element(tag, text, attributes = {}) {
  const made = document.createElement(tag);
  if (text !== "") made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

const isAngle = (name) => FACTS.parameters.some((one) => one.name === name && one.units === "rad");
const scaleOf = (name) => (isAngle(name) ? state.angles : "");
const inDegrees = (yes) => (yes && state.angles === "deg" ? Math.PI / 180 : 1);
const coordinate = () => (FACTS.coordinate === "phi" ? "φ" : FACTS.coordinate);
const angleText = (x, n) => (FACTS.angle && state.angles === "deg" && Number.isFinite(x) ? `${digits(x / (Math.PI / 180), n)}°` : digits(x, n));

function axisWords(name) {
  if (name === TORQUE) return LAW.kind === "trigonometric" ? "torque, s⁻²" : "torque";
  const { units } = FACTS.parameters[NAMES.indexOf(name)];
  const shown = units === "rad" ? state.angles : units;
  return shown ? `${name}, ${unitWords(shown)}` : name;
}

const unitWords = (units) => units.replace(/-(\d)/g, (_, n) => `⁻${"⁰¹²³⁴⁵⁶⁷⁸⁹"[n]}`).replace(/([a-z])(\d)/g, (_, a, n) => a + "⁰¹²³⁴⁵⁶⁷⁸⁹"[n]);

// ---------------------------------------------------------------- controls

const STEPS = 1000;
const controls = new Map();

function addSlider(parent, name, words, units, read, write, range) {
  const id = `value-${controls.size}`;
  const box = element("div", "", { class: "slider" });
  const line = element("div", "", { class: "name" });
  const label = element("label", name, { for: id });
  const unit = element("span", "", { class: "unit" });
  label.append(" ", unit);
  const number = element("input", "", { type: "text", inputmode: "decimal", id, "aria-describedby": `${id}-meaning` });
  const slider = element("input", "", { type: "range", min: 0, max: STEPS, step: 1, "aria-label": `${name}, slider` });
  line.append(label, number);
  box.append(line, element("div", words, { class: "meaning", id: `${id}-meaning` }), slider);
  parent.append(box);
  const control = { name, number, slider, unit, units, read, write, range };
  controls.set(name, control);
  slider.addEventListener("input", () => {
    const [low, high] = range();
    const value = low + ((high - low) * slider.valueAsNumber) / STEPS;
    if (control.write(value) === "") soon(control);
  });
  number.addEventListener("change", () => {
    const factor = inDegrees(units === "rad");
    const text = number.value.trim().replace("−", "-");
    const why = control.write(text === "" ? NaN : Number(text) * factor);
    number.setAttribute("aria-invalid", String(why !== ""));
    complain(why ? [why] : []);
    if (why === "") update(null);
  });
}

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
    finite("damping", 0, (x) => { state.damping = x; dampingRange[1] = Math.max(dampingRange[1], x); }), () => dampingRange);
  addSlider($("extras"), TORQUE, "constant, added to −V′", mechanical ? "s-2" : "", () => state.torque,
    finite(TORQUE, -Infinity, (x) => setValue(TORQUE, x)), () => torqueRange);
  for (const [id, key] of [["diagram-x", "diagram"], ["map-x", "x"], ["map-y", "y"]]) {
    AXES.forEach((name) => $(id).append(element("option", name, { value: name })));
    $(id).addEventListener("change", () => {
      state[key] = $(id).value;
      update(null);
    });
  }
}

function showControls(moved) {
  for (const control of controls.values()) {
    const { number, slider, unit, units, read, range } = control;
    const value = read();
    const factor = inDegrees(units === "rad");
    unit.textContent = units === "rad" ? state.angles : unitWords(units);
    const [low, high] = range();
    if (control !== moved) slider.value = value === null ? 0 : String(Math.round(((value - low) / (high - low)) * STEPS));
    const text = value === null ? "not given" : digits(value / factor, 8);
    slider.setAttribute("aria-valuetext", `${text} ${unit.textContent}`);
    if (value === null) number.placeholder = "not given";
    if (document.activeElement !== number || moved === null) {
      number.value = value === null ? "" : text.replace("−", "-");
      number.setAttribute("aria-invalid", "false");
    }
  }
  $("diagram-x").value = state.diagram;
  $("map-x").value = state.x;
  $("map-y").value = state.y;
  $("angles").value = state.angles;
}

function complain(lines) {
  $("alert").hidden = !lines.length;
  $("alert").textContent = lines.join("; ");
}

// ---------------------------------------------------------------- drawing

// Draws at once, and then once a frame, however many changes come.
const frame = { open: true, due: null };
function soon(moved) {
  frame.due = moved;
  if (!frame.open) return;
  frame.open = false;
  frame.due = null;
  update(moved);
  requestAnimationFrame(() => {
    frame.open = true;
    if (frame.due) soon(frame.due);
  });
}

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
  if (!pot.valid) {
    complain(["At these parameters there is no such system, or a number is not finite"]);
    return;
  }
  if ($("alert").textContent.startsWith("At these")) complain([]);
  scene.view = view(pot, state.orbits);
  scene.curves = state.orbits.map((one) => orbitCurve(pot, one, state.damping, scene.view));
  drawPortrait(plots.portrait, pot, scene);
  drawWell(plots.well, pot, scene);
  drawDiagram(plots.diagram, diagramScene(), (value) => make(...potentialAt(state.diagram, value)));
  drawForces();
  startMap();
  scene.timing = performance.now() - start;
  later(tell);
}

function diagramScene() {
  const name = state.diagram;
  return { view: scene.view, pot: scene.pot, words: scene.words, scale: scene.scale, range: rangeOf(name), axis: axisWords(name), axisScale: scaleOf(name), at: valueOf(name) };
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
  const closed = LAW.kind === "trigonometric" && xName !== TORQUE && yName !== TORQUE && state.torque === 0;
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
  state.orbits = [...state.orbits.slice(-7), [x, v]];
  update(null);
  const orbit = scene.pot.orbit(x, v);
  $("status").textContent = `Orbit started: ${familyWords(orbit)}, period ${digits(orbit.period, 6)}`;
}

function moveTo(pairs) {
  for (const [name, value] of pairs) {
    const index = NAMES.indexOf(name);
    if (index >= 0 && refused(index, value)) continue;
    setValue(name, value);
  }
  update(null);
}

function onPlot(plot, act, follow) {
  const { canvas } = plot;
  let held = false;
  canvas.addEventListener("pointerdown", (event) => {
    const at = plot.under(event);
    if (!at.inside || event.button !== 0) return;
    held = true;
    act(at, false);
  });
  canvas.addEventListener("pointermove", (event) => {
    const at = plot.under(event);
    if (held && event.pointerType === "mouse") act(at, true);
    else if (follow) follow(at.inside ? [at.x, at.y] : null);
  });
  for (const name of ["pointerup", "pointercancel", "pointerleave"]) {
    canvas.addEventListener(name, () => {
      held = false;
      if (name === "pointerleave" && follow) follow(null);
    });
  }
}

function onKeys(plot, act) {
  plot.canvas.addEventListener("keydown", (event) => {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] };
    const way = ways[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (!way && !["Enter", " ", "Delete", "Escape"].includes(event.key)) return;
    const factor = event.shiftKey ? 10 : 1;
    const step = way ? [(way[0] * factor * (plot.x[1] - plot.x[0])) / 100, (way[1] * factor * (plot.y[1] - plot.y[0])) / 100] : null;
    if (act(event.key, step) !== false) event.preventDefault();
  });
}

const within = (value, [low, high]) => Math.min(high, Math.max(low, value));

function wire() {
  onPlot(plots.portrait, (at, dragged) => dragged || startOrbit(at.x, at.y), hover);
  onPlot(plots.map, (at) => moveTo([[state.x, at.x], [state.y, at.y]]));
  onPlot(plots.diagram, (at) => moveTo([[state.diagram, at.x]]));
  onKeys(plots.portrait, (key, step) => {
    if (key === "Delete") state.orbits = [];
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
  $("clear").addEventListener("click", () => { state.orbits = []; update(null); });
  $("reset").addEventListener("click", () => {
    Object.assign(state, startState(), { theme: state.theme, angles: state.angles });
    complain([]);
    update(null);
  });
  $("angles").addEventListener("change", () => { state.angles = $("angles").value; update(null); });
  $("theme").addEventListener("click", () => {
    state.theme = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    applyTheme();
  });
  wireExports();
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
  for (const id of ["link", "python"]) {
    $(`copy-${id}`).addEventListener("click", async () => {
      $(id).select();
      let done = true;
      try {
        await navigator.clipboard.writeText($(id).value);
      } catch {
        done = document.execCommand("copy");
      }
      $("copied").textContent = done ? "Copied." : "Selected; copy it with Ctrl+C.";
    });
  }
}

function applyTheme() {
  const dark = state.theme ? state.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  $("theme").setAttribute("aria-pressed", String(dark));
  paints.clear();
  update(null);
}

function load() {
  const { theme } = state;
  Object.assign(state, startState(), { theme });
  complain(location.hash ? readLink(location.hash) : []);
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
suit();
makeControls();
wire();
load();

// For tests and for the console of the browser.
window.phasekit = {
  state, scene, plots, law: LAW, make, Potential, countEquilibria, forceCurves, orbitCurve, dataOf: () => dataOf(scene), update, special,
};
