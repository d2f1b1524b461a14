// The parameters of the page, and what they may be.

const FACTS = JSON.parse(document.getElementById("facts").textContent);
const NAMES = FACTS.parameters.map((one) => one.name);

// Ranges of the sliders: as they came, widened where a value lies outside.
const ranges = FACTS.parameters.map((one) => [one.low, one.high]);

// Why a parameter cannot have a value, or "".
function refused(index, value) {
  const one = FACTS.parameters[index];
  const low = one.least ?? -Infinity;
  const high = one.most ?? Infinity;
  const inside = Number.isFinite(value) && value >= low && value <= high && !(one.positive && !(value > 0));
  return inside ? "" : `${one.name}: wants ${one.wants}`;
}

// How Python reads numbers that people write; both read by the same patterns and the same units.
const TYPED = new RegExp(`^(?:${FACTS.written.typed})$`);
const THOUSANDS = new RegExp(`^(?:${FACTS.written.thousands})$`);
const unitsOf = (units) => FACTS.written.units[units] ?? {};
const readTyped = (text) => TYPED.exec(text.replaceAll("−", "-"));

// A number as people write it: 40deg, 24 mm, 300rpm, pi/4, 0,7; without a unit it is multiplied by `bare`, but for parts of
// pi. NaN where it is none, or where its comma may be one of thousands.
function readNumber(text, units, bare = 1) {
  const found = readTyped(text)?.groups;
  if (!found || THOUSANDS.test(found.digits ?? "")) return NaN;
  const turned = found.digits === undefined;
  const plain = found.unit.replaceAll("**", "").replaceAll("^", "");
  const unit = Object.hasOwn(FACTS.written.aliases, plain) ? FACTS.written.aliases[plain] : plain;
  const factors = unitsOf(units);
  if (unit && !Object.hasOwn(factors, unit)) return NaN;
  const factor = unit ? factors[unit] : turned && units === "rad" ? 1 : bare;
  if (turned) return ((found.sign === "-" ? -1 : 1) * Number(found.times ?? 1) * Math.PI * factor) / Number(found.over ?? 1);
  const [digits, power = "0"] = found.digits.replace(",", ".").toLowerCase().split("e");
  // Powers of ten are rounded once.
  const tens = Math.round(Math.log10(factor));
  return factor === Number(`1e${tens}`) ? Number(`${digits}e${Number(power) + tens}`) : Number(`${digits}e${power}`) * factor;
}

// What a comma of thousands may mean, or "".
function doubt(text) {
  const digits = readTyped(text)?.groups.digits ?? "";
  return THOUSANDS.test(digits) ? `${digits.replace(",", "")} or ${digits.replace(",", ".")}` : "";
}

// Units in which things are shown: one for all that are held in the same; `state` is the page's own.
const HELD = [...new Set([...FACTS.parameters, ...(FACTS.states ?? [])].map((one) => one.units))].filter((units) => units !== "rad" && choices(units).length > 1);
const shownUnit = (units) => (units === "rad" ? state.angles : state.units[units] ?? units);
const factorOf = (units) => unitsOf(units)[shownUnit(units)] ?? 1;
// How an axis counts: angles by their own ticks, others by a factor.
const tickScale = (units) => (units === "rad" ? state.angles : factorOf(units));

// Units that differ, the one that values are held in first.
function choices(units) {
  const known = Object.entries(unitsOf(units));
  return [units, ...known.filter(([name, factor]) => factor !== 1 && name !== "°").map(([name]) => name)];
}

const writeUnits = () => HELD.filter((units) => state.units[units]).map((units) => `${units}:${state.units[units]}`).join("~");

// Takes what is known of `m:mm~s-1:rpm`; says whether all is.
function readUnits(text) {
  const pairs = text ? text.split("~").map((one) => one.split(":")) : [];
  const whole = pairs.filter(([held, shown, more]) => HELD.includes(held) && choices(held).includes(shown) && more === undefined);
  state.units = Object.fromEntries(whole);
  return whole.length === pairs.length;
}
