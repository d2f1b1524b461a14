// Words and tables of equations, the data and the lines of Python; they follow the pictures.

const narrow = matchMedia("(max-width: 720px)");
const WHY = {
  end: "", hurried: "not yet followed to its end", escaped: "left for infinity", steps: "ended early: it takes too many steps here; phasekit follows it", undefined: "ended where the equations have no finite value",
};

// Eigenvalues, pairs of them once.
function spectrumText(found, n) {
  const words = [];
  for (let i = 0; i < found.length; i++) {
    const [re, im] = found[i];
    if (im > 0 && found[i + 1]?.[1] < 0) {
      words.push(`${digits(re, n)} ± ${digits(im, n)}i`);
      i += 1;
    } else words.push(complexText(found[i], n));
  }
  return words.join(", ");
}

const complexText = ([re, im], n) => (im === 0 ? digits(re, n) : `${digits(re, n)} ${im > 0 ? "+" : "−"} ${digits(Math.abs(im), n)}i`);

function tell() {
  const { rests, cycles, motions } = scene;
  const word = LAW.discrete ? "multipliers" : "eigenvalues";
  table("equilibria", [...STATES, "kind", word], rests.map((one) => [...one.x.map((x, i) => stateText(i, x, narrow.matches ? 5 : 9)), one.kind, spectrumText(one.eigenvalues, narrow.matches ? 4 : 6)]));
  $("equilibria-note").textContent = rests.length
    ? "Found from many starts in the window; a page proves nothing. pk.equilibria proves that there are no others."
    : "None was found in the window.";
  tellCycles(cycles);
  table("motions", ["start", "end", ""], motions.map(({ rows, x, why, stiff }, n) => {
    const text = (values) => values.map((one, i) => stateText(i, one, 5)).join(", ");
    return [`${n + 1}: ${text(rows[0].slice(1))}`, text(x), [WHY[why] ?? (why === "end" ? "" : why), stiff ? "stiff, by implicit steps" : ""].filter(Boolean).join("; ")];
  }));
  tellMap();
  const ended = motions.map(({ why }, n) => (WHY[why] ? `motion ${n + 1} ${WHY[why]}` : "")).filter(Boolean);
  $("series-text").textContent = motions.length ? ended.join("; ") || "\u00a0" : "Start a motion in the portrait.";
  const place = (one) => `(${[...one.x].map((x, i) => stateText(i, x, 3)).join(", ")})`;
  const attracting = rests.filter(attracts);
  const rings = cycles.filter((one) => one.multiplier < 1).map((one) => `the cycle of period ${digits(one.period, 4)}`);
  $("legend").textContent = (scene.basins?.words([...attracting.map(place), ...rings, "far away"]) ?? "") + legend();
  $("diagram-help").textContent = `${LAW.discrete ? "Gray: iterates" : FORCED ? "Gray: states once a period" : LAW.n === 1 ? "Gray: where the motion comes to rest" : LAW.n === 2 ? "Gray: greatest and least values along the motion" : "Gray: greatest values along the motion"} after a while.${FORCED ? "" : ` Blue: stable ${LAW.discrete ? "fixed points" : "equilibria"}; red: unstable ones.`} Click, or left and right arrow, moves the system.`;
  tellTaken();
  const counts = new Map();
  rests.forEach((one) => counts.set(one.kind, (counts.get(one.kind) ?? 0) + 1));
  const say = `${[...counts].map(([kind, count]) => `${count} ${kind}`).join(", ") || (FORCED ? "forced system" : "no equilibrium")}${PLANAR ? `, ${cycles.length} limit cycles` : ""}`;
  if (say !== scene.said) $("status").textContent = scene.said = say;
  $("portrait-text").textContent = `${say}; the tables below have the numbers.`;
}

function tellTaken() {
  const base = location.protocol === "about:" ? "" : location.href.split("#")[0];
  $("link").value = base + writeLink();
  $("python").value = pythonOf();
}

function tellCycles(cycles) {
  if (!PLANAR) return;
  table("cycles", ["period", "multiplier", "", ...STATES.map((name) => `${name} from … to`)], cycles.map(({ period, multiplier, ends }) =>
    [digits(period, 10), digits(multiplier, 6), multiplier < 1 ? "stable" : "unstable", ...ends.map(([low, high], i) => `${stateText(i, low, 6)} … ${stateText(i, high, 6)}`)]));
  const family = scene.family ? "Orbits round an equilibrium close up, many side by side. " : "";
  $("cycles-note").textContent = scene.searched !== JSON.stringify(state.values)
    ? "Looking for cycles …"
    : `${family}${cycles.length ? "Found by returns to rays; others may be missed. pk.periodic_orbits says whether these are all." : "None was found in the window."}`;
}

const PROPER = { hopf: "Hopf", bogdanov_takens: "Bogdanov-Takens", generalized_hopf: "generalized Hopf", zero_hopf: "zero-Hopf", hopf_hopf: "double Hopf" };
const kindWords = (kind) => PROPER[kind] ?? kind.replaceAll("_", " ");

function tellMap() {
  const map = MAPS[state.map];
  if (!map) return;
  const at = `${valueText(map.x, valueOf(map.x))}, ${valueText(map.y, valueOf(map.y))}`;
  const held = scene.stale.map((one) => valueText(one.name, one.value)).join(", ");
  $("map-text").textContent = held ? `${at}. The curves are those at ${held}, and gray for that.` : at;
  const kinds = [...new Set(map.curves.map((one) => kindWords(one.kind)))];
  const points = [...new Set(map.points.map((one) => kindWords(one.kind)))];
  const colors = { fold: "purple", Hopf: "green", "branch point": "orange dashes", "period doubling": "red", torus: "blue dashes" };
  const lines = kinds.map((kind) => `${kind} (${colors[kind] ?? "gray"})`).join(", ");
  $("map-legend").textContent = `${lines ? `Curves: ${lines}` : "No curve was found"}${points.length ? `; dots: ${points.join(", ")}` : ""}.${map.missing.length ? ` Not found: ${map.missing.join("; ")}.` : ""}`;
}

function legend() {
  if (LAW.n === 1) return LAW.discrete ? "Curve: the map; line: next value equals value; full marks: stable fixed points." : "Curve: the rate; arrows: where the state goes; full marks: stable equilibria.";
  const marks = "Squares: nodes, circles: foci, full: stable, empty: unstable; diamonds: saddles.";
  if (LAW.discrete) return marks;
  if (FORCED) return "Dots: states once a period.";
  const lines = "Blue dashes: stable manifolds; red: unstable manifolds";
  return PLANAR ? `Dashes: where d${nameOf(0)}/dt = 0; dots: where d${nameOf(1)}/dt = 0. ${marks} ${lines}; thick: limit cycles, dashed where unstable.` : `${marks} ${lines} of saddles.`;
}

function hover(at) {
  scene.pointed = at;
  if (!at) {
    $("hover").textContent = "\u00a0";
    return;
  }
  const { system } = scene;
  const x = stateAt(...at);
  const out = new Float64Array(LAW.n);
  if (LAW.discrete) system.iterate(Float64Array.from(x), out);
  else system.rates(x, 0, out);
  const shown = LAW.n > 1 ? scene.plane : [0];
  const rates = shown.map((i) => `${LAW.discrete ? `next ${nameOf(i)}` : `d${nameOf(i)}/dt`} = ${digits(out[i], 4)}`);
  $("hover").textContent = `${shown.map((i) => `${nameOf(i)} = ${stateText(i, x[i], 4)}`).join(", ")}${LAW.n < 3 && !FORCED ? `: ${rates.join(", ")}` : ""}`;
}

// Numbers of everything that is shown; what is not finite is written as text.
function dataOf() {
  const { rests, cycles, motions, system } = scene;
  return {
    law: FACTS.law,
    parameters: Object.fromEntries(NAMES.map((name, i) => [name, state.values[i]])),
    equilibria: rests.map(({ x, kind, eigenvalues: found }) => ({ x, kind, eigenvalues: found })),
    cycles: cycles.map(({ period, multiplier, ends, points }) => ({ period, multiplier, ends, points })),
    manifolds: scene.manifolds,
    motions: motions.map(({ rows, why }) => ({ columns: ["t", ...STATES], rows, end: why })),
    curves: MAPS,
    period: system.period || null,
  };
}

// Lines that make the same system and the same numbers with the library.
function pythonOf() {
  const { start, end } = FACTS.python;
  const values = NAMES.map((name, i) => `'${name}': ${state.values[i]}`).join(", ");
  const lines = ["import numpy as np", "import phasekit as pk", "", `system = ${start}${values}${end}`];
  const own = FACTS.missing.length > 0; // states without a window of the system's
  const box = `{${FACTS.states.filter((one) => FACTS.missing.includes(one.name)).map((one) => `'${one.name}': (${one.low}, ${one.high})`).join(", ")}}`;
  if (own && !FORCED) lines.push(`box = ${box}`);
  if (!FORCED) lines.push(`equilibria = pk.equilibria(system${own ? ", box=box" : ""})`);
  if (PLANAR) lines.push(`cycles = pk.periodic_orbits(system${own ? ", window=box" : ""})`);
  const starts = `[${state.motions.map((one) => `[${one.join(", ")}]`).join(", ")}]`;
  if (state.motions.length) {
    const t = LAW.discrete ? `np.arange(${state.duration + 1})` : `np.linspace(0.0, ${state.duration}, 2001)`;
    lines.push(`starts = ${starts}`, `t = ${t}`, "motions = [pk.flow(system, start, t) for start in starts]");
  }
  if (!LAW.discrete && !FORCED && LAW.n > 1) {
    const plane = LAW.n > 2 ? `, plane=('${nameOf(scene.plane[0])}', '${nameOf(scene.plane[1])}')` : "";
    lines.push(`pk.plot.phase_portrait(system${own ? ", window=box" : ""}${plane}${state.motions.length ? ", orbits=starts" : ""})`);
  } else if (state.motions.length) lines.push("pk.plot.time_history(motions[-1])");
  return `${lines.join("\n")}\n`;
}
