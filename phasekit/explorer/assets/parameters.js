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

// A number as people write it: 40deg, 24 mm, 300rpm, pi/4, 2*pi, 0,7; without a unit it is multiplied by `bare`.
// NaN where it is none.
const WRITTEN = /^([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|[-+]?pi)((?:\s*[*/]\s*(?:(?:\d+\.?\d*|\.\d+)|pi))*)\s*(.*)$/i;
function readNumber(text, units, bare = 1) {
  const plain = text.trim().replace(/−/g, "-").replace(/π/g, "pi").replace(/^([-+]?\d*),(\d+)/, "$1.$2");
  const found = WRITTEN.exec(plain.replace(/^([-+]?(?:\d+\.?\d*|\.\d+))\s*(pi)/i, "$1*$2"));
  if (!found) return NaN;
  const one = (word) => (/^[-+]?pi$/i.test(word) ? Math.sign(parseFloat(`${word[0] === "-" ? "-" : ""}1`)) * Math.PI : Number(word));
  let value = one(found[1]);
  for (const [, sign, word] of found[2].matchAll(/([*/])\s*([\d.]+|pi)/gi)) value = sign === "*" ? value * one(word) : value / one(word);
  if (!found[3]) return value * bare;
  const factors = FACTS.units?.[units] ?? {};
  return Object.hasOwn(factors, found[3]) ? value * factors[found[3]] : NaN;
}
