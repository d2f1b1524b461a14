// Sliders with numbers, hands on plots, and what else every page has; `state` and `update` are the page's own.

const $ = (id) => document.getElementById(id);

function element(tag, text, attributes = {}) {
  const made = document.createElement(tag);
  if (text !== "") made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

const unitWords = (units) => units.replace(/-(\d)/g, (_, n) => `⁻${"⁰¹²³⁴⁵⁶⁷⁸⁹"[n]}`).replace(/([a-z])(\d)/g, (_, a, n) => a + "⁰¹²³⁴⁵⁶⁷⁸⁹"[n]);

const STEPS = 1000;
const controls = new Map();

// Choices of the units in which the page shows things.
const UNIT_NAMES = { m: "Lengths", kg: "Masses", "s-1": "Rates", "s-2": "Accelerations", s: "Times", N: "Forces" };
function addUnits() {
  for (const units of HELD.toReversed()) {
    const label = element("label", `${UNIT_NAMES[units] ?? unitWords(units)} in `);
    const select = element("select", "", { id: `unit-${units}` });
    choices(units).forEach((one) => select.append(element("option", unitWords(one), { value: one })));
    label.append(select);
    $("angles-label").after(label);
    select.addEventListener("change", () => {
      state.units[units] = select.value;
      update(null);
    });
  }
}

// With `fixed` the unit stays as it is, whatever is chosen for others.
function addSlider(parent, name, words, units, read, write, range, fixed = false) {
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
  const control = { name, number, slider, unit, units, read, write, range, fixed };
  controls.set(name, control);
  slider.addEventListener("input", () => {
    const [low, high] = range();
    const value = low + ((high - low) * slider.valueAsNumber) / STEPS;
    if (control.write(value) === "") {
      complain([]);
      soon(control);
    }
  });
  number.addEventListener("change", () => {
    const doubts = doubt(number.value);
    const why = doubts ? `${name}: wants ${doubts}` : control.write(readNumber(number.value, units, fixed ? 1 : factorOf(units)));
    number.setAttribute("aria-invalid", String(why !== ""));
    complain(why ? [why] : []);
    if (why === "") update(null);
  });
}

// Shows the values; `moved` is the slider under the hand.
function showSliders(moved) {
  HELD.forEach((units) => { $(`unit-${units}`).value = shownUnit(units); });
  for (const control of controls.values()) {
    const { number, slider, unit, units, read, range, fixed } = control;
    const value = read();
    const factor = fixed ? 1 : factorOf(units);
    unit.textContent = unitWords(fixed ? units : shownUnit(units));
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
}

function complain(lines) {
  $("alert").hidden = !lines.length;
  $("alert").textContent = lines.join("; ");
}

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

function wireCopies() {
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

let telling = 0;
function later(task) {
  clearTimeout(telling);
  telling = setTimeout(task, 60);
}

function table(id, heads, rows) {
  const head = element("tr", "");
  heads.forEach((text) => head.append(element("th", text, { scope: "col" })));
  const body = element("tbody", "");
  for (const row of rows) {
    const line = element("tr", "", { role: "row" });
    // On a narrow screen each stands on a line of its own, after the head of its column.
    row.forEach((text, i) => line.append(i ? element("td", text, { role: "cell", "data-head": heads[i] }) : element("th", text, { role: "rowheader", scope: "row", "data-head": heads[i] })));
    body.append(line);
  }
  const top = element("thead", "");
  top.append(head);
  $(id).setAttribute("role", "table");
  $(id).replaceChildren(top, body);
}
