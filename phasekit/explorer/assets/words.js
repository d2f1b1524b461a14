// Words and tables, the link and the lines of Python; they follow the pictures.

const familyWords = (orbit) => (orbit.kind === "libration" || orbit.kind === "rotation" ? `${orbit.kind}, ${LABELS[orbit.family] ?? orbit.family}` : orbit.kind);
const unitOf = (text) => (LAW.kind === "trigonometric" ? `, ${text}` : "");

function tell() {
  const { pot } = scene;
  const x = coordinate();
  table("equilibria", [x, "kind", `V${unitOf("s⁻²")}`, `V″${unitOf("s⁻²")}`],
    pot.points.map((one) => [angleText(one.x, 10), one.label ? `${one.kind} (${LABELS[one.label]})` : one.kind, digits(one.energy, 8), digits(one.curvature, 8)]));
  const loops = pot.separatrices();
  const words = (one, share) => (one.kind === "unbounded" ? one.kind : `${one.kind} ${digits(one.area, 9)}${share === undefined ? "" : ` (${digits(100 * share, 4)} %)`}`);
  table("separatrices", [`saddle at ${x}`, "left: area", "right: area"],
    loops.map(({ saddle, left, right, shares }) => [angleText(saddle.x, 8), words(left, shares?.[0]), words(right, shares?.[1])]));
  $("odds").textContent = loops.some((one) => one.shares)
    ? "With a little damping, an orbit that comes in from outside is caught by one of the two sides; the shares of the areas, in percent, are the odds of each (exact as the damping goes to zero)."
    : loops.length ? "Areas enclosed by the separatrices; of one that winds round the circle, the area under one turn." : "There is no saddle, and so no separatrix.";
  table("orbits", [`start (${x}, d${x}/dt)`, "family", `period${unitOf("s")}`, `action${unitOf("s⁻¹")}`, "from … to", `energy${unitOf("s⁻²")}`],
    state.orbits.map((one) => {
      const orbit = pot.orbit(...one);
      return [`${angleText(one[0], 6)}, ${digits(one[1], 6)}`, familyWords(orbit), digits(orbit.period, 11), digits(orbit.action, 11), Number.isFinite(orbit.low) ? `${angleText(orbit.low, 8)} … ${angleText(orbit.high, 8)}` : "–", digits(orbit.energy, 9)];
    }));
  $("orbit-note").textContent = !state.orbits.length
    ? "A click in the portrait starts one."
    : state.damping > 0 ? "Family, period, action and turning points are those that the start has without damping." : "";
  $("values").textContent = pot.coefficients
    ? ["A", "B", "C"].map((name, i) => `${name} = ${digits(pot.coefficients[i], 8)}`).join(", ") + unitOf("s⁻²") : "";
  tellTaken();
  $("legend").textContent = scene.basins?.words([...pot.points.map((one) => `${x} = ${angleText(one.x, 4)}`), "far away", "lasting rotation"]) ?? "";
  const counts = { [CENTER]: 0, [SADDLE]: 0, [DEGENERATE]: 0 };
  pot.points.forEach((one) => (counts[one.kind] += 1));
  const say = `${counts[CENTER]} centers and ${counts[SADDLE]} saddles${counts[DEGENERATE] ? `, ${counts[DEGENERATE]} degenerate` : ""}`;
  if (say !== scene.said) $("status").textContent = scene.said = say;
  $("portrait-text").textContent = `${say}, at ${pot.points.map((one) => `${angleText(one.x, 4)} (${one.kind})`).join(", ")}; the tables below have the numbers.`;
  $("map-text").textContent = scene.map ? `${valueText(state.x)}, ${valueText(state.y)}: ${pot.points.length} equilibria` : "Choose two different parameters.";
  tellForces();
}

function tellTaken() {
  const base = location.protocol === "about:" ? "" : location.href.split("#")[0];
  $("link").value = base + writeLink();
  $("python").value = pythonOf(scene);
}

// Without a system there are no numbers of it.
function tellInvalid() {
  for (const id of ["equilibria", "separatrices", "orbits"]) $(id).replaceChildren();
  for (const id of ["values", "odds", "legend", "orbit-note", "series-text", "hover", "portrait-text", "map-text", "force-text"]) $(id).textContent = "";
  $("status").textContent = scene.said = INVALID;
  tellTaken();
}

function timeText(row) {
  if (!state.orbits.length) return "Start an orbit in the portrait.";
  if (!row) return "The orbit has left the window.";
  const [t, x, v] = row;
  const seconds = LAW.kind === "trigonometric" ? " s" : "";
  return `t = ${digits(t, 4)}${seconds}: ${coordinate()} = ${angleText(x, 4)}, d${coordinate()}/dt = ${digits(v, 4)}. Play takes ${PLAYED / 1000} s for ${digits(scene.history.length, 3)}${seconds}.`;
}

function tellForces() {
  if (!FACTS.machine) return;
  const missing = NAMES.filter((name, i) => state.values[i] === null);
  const rows = scene.forceRows ?? [];
  const peak = (k) => Math.max(...rows.map((row) => row[k]).filter(Number.isFinite));
  $("force-text").textContent = missing.length
    ? `Give ${missing.join(" and ")} for the forces.`
    : rows.length
      ? `Solid: bearing A2, at most ${digits(peak(2))} N; dashed: B2, at most ${digits(peak(3))} N`
      : "Start an orbit in the portrait.";
}

function hover(at) {
  scene.pointed = at;
  if (!at) {
    $("hover").textContent = "\u00a0";
    return;
  }
  const orbit = scene.pot.orbit(...at);
  const action = Number.isFinite(orbit.action) ? `, action ${digits(orbit.action, 7)}` : "";
  const before = state.damping > 0 ? "without damping: " : "";
  $("hover").textContent = `${angleText(at[0], 4)}, ${digits(at[1], 4)}: ${before}${familyWords(orbit)}, period ${digits(orbit.period, 7)}${action}`;
}
