// Pictures of equations: portrait, motions in time, diagram over one parameter, curves over two.

const MOTIONS = ["orbit", "second", "accent", "degenerate", "separatrix", "muted"];
const motionPaint = (i) => MOTIONS[i % MOTIONS.length];

// A mark of an equilibrium: nodes are squares, foci circles, saddles diamonds; the stable ones are full.
function mark(plot, x, y, kind, radius = 5) {
  const { c } = plot;
  const [px, py] = [plot.px(x), plot.py(y)];
  c.setLineDash([]);
  c.beginPath();
  if (kind === SADDLE) {
    const r = radius + 1;
    c.moveTo(px, py - r);
    c.lineTo(px + r, py);
    c.lineTo(px, py + r);
    c.lineTo(px - r, py);
    c.closePath();
  } else if (kind.endsWith("node")) c.rect(px - 0.85 * radius, py - 0.85 * radius, 1.7 * radius, 1.7 * radius);
  else c.arc(px, py, radius, 0, TWO_PI);
  const color = paint(kind === SADDLE ? "saddle" : kind === DEGENERATE ? "degenerate" : "center");
  c.fillStyle = kind.startsWith("unstable") ? paint("card") : color;
  c.fill();
  c.lineWidth = 1.8;
  c.strokeStyle = kind.startsWith("unstable") ? color : paint("card");
  c.stroke();
}

// Curves on a plane of which an axis may be an angle are drawn where they are seen, turn by turn.
function folded(points, i, k, system) {
  const out = [];
  let last = null;
  for (const row of points) {
    const place = [i, k].map((n) => {
      const turn = system.turns[n];
      return turn ? system.low[n] + (row[n] - system.low[n] - turn * Math.floor((row[n] - system.low[n]) / turn)) : row[n];
    });
    const jumps = last && [i, k].some((n, at) => system.turns[n] && Math.abs(place[at] - last[at]) > 0.5 * system.turns[n]);
    if (jumps) out.push([NaN, NaN]);
    out.push(place);
    last = place;
  }
  return out;
}

// Short pieces of the flow, with heads, evenly over the picture.
function drawField(plot, system) {
  const { c } = plot;
  const [across, down] = [Math.max(8, Math.round((plot.right - plot.left) / 30)), Math.max(6, Math.round((plot.bottom - plot.top) / 30))];
  const [wide, high] = [(plot.x[1] - plot.x[0]) / (plot.right - plot.left), (plot.y[1] - plot.y[0]) / (plot.bottom - plot.top)];
  const [x, f] = [new Float64Array(2), new Float64Array(2)];
  const step = 3.6;
  const way = (u, v) => {
    x[0] = plot.x[0] + (u - plot.left) * wide;
    x[1] = plot.y[0] + (plot.bottom - v) * high;
    system.rates(x, 0, f);
    const [du, dv] = [f[0] / wide, -f[1] / high];
    const size = Math.hypot(du, dv);
    return size > 0 && Number.isFinite(size) ? [du / size, dv / size] : null;
  };
  plot.style("level", 1);
  c.beginPath();
  for (let i = 0; i < across; i++) {
    for (let j = 0; j < down; j++) {
      const middle = [plot.left + ((i + 0.5) * (plot.right - plot.left)) / across, plot.top + ((j + 0.5) * (plot.bottom - plot.top)) / down];
      let [u, v] = middle;
      const back = [];
      for (let k = 0; k < 3; k++) {
        const at = way(u, v);
        if (!at) break;
        u -= step * at[0];
        v -= step * at[1];
        back.push([u, v]);
      }
      if (!back.length) continue;
      c.moveTo(...back.at(-1));
      for (let k = back.length - 2; k >= 0; k--) c.lineTo(...back[k]);
      c.lineTo(...middle);
      [u, v] = middle;
      let last = null;
      for (let k = 0; k < 3; k++) {
        const at = way(u, v);
        if (!at) break;
        u += step * at[0];
        v += step * at[1];
        c.lineTo(u, v);
        last = at;
      }
      if (!last) continue;
      const [a, b] = last;
      c.lineTo(u - 4 * a + 2.6 * b, v - 4 * b - 2.6 * a);
      c.moveTo(u, v);
      c.lineTo(u - 4 * a - 2.6 * b, v - 4 * b + 2.6 * a);
    }
  }
  c.stroke();
}

// Where a component of the rates vanishes: pieces of lines in the cells of a grid; poles are left out.
function drawNullclines(plot, system, grid) {
  const { cells, values } = grid;
  const side = cells + 1;
  const at = (i, j) => [system.low[0] + (i * system.scales[0]) / cells, system.low[1] + (j * system.scales[1]) / cells];
  const parts = LAW.part_of;
  const count = parts.length;
  const [x, f] = [new Float64Array(2), new Float64Array(count)];
  for (let k = 0; k < count; k++) {
    plot.style(parts[k] ? "nullcline-b" : "nullcline-a", 1.4, parts[k] ? [2, 3] : [7, 3]);
    // A place on an edge between two nodes; once more by the rates there. Edges are numbered, to hang pieces together.
    const places = new Map();
    const edge = (i, j, di, dj, a, b) => {
      const id = 2 * (j * side + i) + dj;
      if (places.has(id)) return id;
      let s = a / (a - b);
      const [from, to] = [at(i, j), at(i + di, j + dj)];
      x[0] = from[0] + s * (to[0] - from[0]);
      x[1] = from[1] + s * (to[1] - from[1]);
      LAW.parts(x, system.p, f);
      const pole = !(Math.abs(f[k]) <= Math.max(Math.abs(a), Math.abs(b)));
      s = f[k] === 0 ? s : f[k] > 0 === a > 0 ? s + ((1 - s) * f[k]) / (f[k] - b) : (s * a) / (a - f[k]);
      places.set(id, pole ? null : [from[0] + s * (to[0] - from[0]), from[1] + s * (to[1] - from[1])]);
      return id;
    };
    const links = new Map();
    const link = (a, b) => {
      if (!places.get(a) || !places.get(b)) return;
      for (const [from, to] of [[a, b], [b, a]]) {
        if (links.has(from)) links.get(from).push(to);
        else links.set(from, [to]);
      }
    };
    for (let j = 0; j < cells; j++) {
      for (let i = 0; i < cells; i++) {
        const node = count * (j * side + i) + k;
        const [a, b, c, d] = [values[node], values[node + count], values[node + count * (side + 1)], values[node + count * side]];
        const signs = (a > 0) + (b > 0) + (c > 0) + (d > 0);
        if (signs === 0 || signs === 4) continue;
        const ends = [];
        if (a > 0 !== b > 0) ends.push(edge(i, j, 1, 0, a, b));
        if (b > 0 !== c > 0) ends.push(edge(i + 1, j, 0, 1, b, c));
        if (d > 0 !== c > 0) ends.push(edge(i, j + 1, 1, 0, d, c));
        if (a > 0 !== d > 0) ends.push(edge(i, j, 0, 1, a, d));
        // Four ends: two lines that cross, from side to side.
        if (ends.length === 4) [ends[1], ends[2]] = [ends[2], ends[1]];
        for (let n = 0; n + 1 < ends.length; n += 2) link(ends[n], ends[n + 1]);
      }
    }
    for (const line of chains(links)) plot.curve(line.map((id) => places.get(id)));
  }
}

// Lines of linked places: from their ends, then the closed ones.
function chains(links) {
  const found = [];
  const walk = (start) => {
    const line = [start];
    for (let at = start; ;) {
      const next = links.get(at).pop();
      if (next === undefined) break;
      const back = links.get(next);
      back.splice(back.indexOf(at), 1);
      line.push(next);
      at = next;
    }
    if (line.length > 1) found.push(line);
  };
  for (const only of [true, false]) for (const [id, others] of links) if (others.length && (!only || others.length === 1)) walk(id);
  return found;
}

// A curve through rows whose states begin at `first`; only where an axis turns are its places made anew.
function trace(plot, rows, [i, k], system, first = 0) {
  if (!system.turns[i] && !system.turns[k]) plot.curve(rows, 0, [first + i, first + k]);
  else plot.curve(folded(first ? rows.map((row) => row.slice(first)) : rows, i, k, system));
}

function drawCycles(plot, system, cycles) {
  for (const one of cycles) {
    plot.style("ink", 2.6, one.multiplier > 1 ? [6, 4] : []);
    trace(plot, one.points, [0, 1], system);
  }
}

function drawPortrait(plot, scene) {
  const { system } = scene;
  if (LAW.n === 1) {
    (LAW.discrete ? drawCobweb : drawRate)(plot, scene);
    return;
  }
  const [i, k] = scene.plane;
  plot.begin([system.low[i], system.high[i]], [system.low[k], system.high[k]], scene.words);
  scene.basins?.draw(plot);
  if (PLANAR) {
    drawField(plot, system);
    drawNullclines(plot, system, scene.grid);
  }
  for (const { stable, points } of scene.manifolds) {
    plot.style(stable ? "center" : "separatrix", 1.6, stable ? [8, 3] : []);
    trace(plot, points, [i, k], system);
  }
  drawCycles(plot, system, scene.cycles);
  scene.motions.forEach((motion, n) => drawMotion(plot, system, motion, n, [i, k]));
  for (const one of scene.rests) mark(plot, one.x[i], one.x[k], one.kind);
  if (scene.cursor) plot.cross(...scene.cursor);
  plot.end();
}

function drawMotion(plot, system, motion, n, [i, k]) {
  const color = motionPaint(n);
  const { rows, strobes } = motion;
  if (LAW.discrete) drawDots(plot, rows.map((row) => [row[i + 1], row[k + 1]]), color, 1.6);
  else {
    plot.style(color, strobes.length || LAW.n > 2 ? 0.9 : 1.6);
    trace(plot, rows, [i, k], system, 1);
    if (strobes.length) drawDots(plot, folded(strobes, i, k, system), "ink", 3);
  }
  const [start] = folded([rows[0].slice(1)], i, k, system);
  plot.style(color);
  plot.c.beginPath();
  plot.c.arc(plot.px(start[0]), plot.py(start[1]), 3.5, 0, TWO_PI);
  plot.c.fill();
}

function drawDots(plot, points, color, size) {
  plot.c.fillStyle = paint(color);
  for (const [x, y] of points) plot.c.fillRect(plot.px(x) - size / 2, plot.py(y) - size / 2, size, size);
}

// Of one state: its rate against itself.
function drawRate(plot, scene) {
  const { system } = scene;
  const [low, high] = [system.low[0], system.high[0]];
  const [points, f] = [[], new Float64Array(1)];
  for (let i = 0; i <= 400; i++) {
    const x = low + ((high - low) * i) / 400;
    system.rates([x], 0, f);
    points.push([x, f[0]]);
  }
  const sizes = points.map((one) => Math.abs(one[1])).filter(Number.isFinite).sort((a, b) => a - b);
  const reach = 1.1 * (sizes[Math.floor(0.9 * sizes.length)] || 1);
  plot.begin([low, high], [-reach, reach], scene.words);
  plot.style("rule", 1.5);
  plot.line(plot.left, plot.py(0), plot.right, plot.py(0));
  plot.style("nullcline-a", 1.8);
  plot.curve(points);
  plot.style("level", 1.6);
  for (let i = 8; i < 400; i += 16) {
    const way = Math.sign(points[i][1]);
    if (!way) continue;
    const [px, py] = [plot.px(points[i][0]), plot.py(0)];
    plot.line(px - 4 * way, py - 4, px, py);
    plot.line(px - 4 * way, py + 4, px, py);
  }
  scene.motions.forEach((motion, n) => {
    plot.style(motionPaint(n));
    plot.c.beginPath();
    plot.c.arc(plot.px(motion.rows[0][1]), plot.py(0), 4, 0, TWO_PI);
    plot.c.fill();
  });
  for (const one of scene.rests) mark(plot, one.x[0], 0, one.kind);
  if (scene.cursor) plot.cross(scene.cursor[0], null);
  plot.end();
}

// A map of one state: its graph, the diagonal, and the way of each motion between them.
function drawCobweb(plot, scene) {
  const { system } = scene;
  const [low, high] = [system.low[0], system.high[0]];
  const [points, f] = [[], new Float64Array(1)];
  for (let i = 0; i <= 400; i++) {
    const x = low + ((high - low) * i) / 400;
    system.iterate([x], f);
    points.push([x, f[0]]);
  }
  plot.begin([low, high], [low, high], scene.words);
  plot.style("level", 1.2);
  plot.curve([[low, low], [high, high]]);
  scene.motions.forEach(({ rows }, n) => {
    plot.style(motionPaint(n), 0.9);
    const way = [[rows[0][1], low]];
    for (let i = 0; i + 1 < Math.min(rows.length, 400); i++) way.push([rows[i][1], rows[i + 1][1]], [rows[i + 1][1], rows[i + 1][1]]);
    plot.curve(way);
  });
  plot.style("nullcline-a", 2);
  plot.curve(points);
  for (const one of scene.rests) mark(plot, one.x[0], one.x[0], one.kind);
  if (scene.cursor) plot.cross(scene.cursor[0], null);
  plot.end();
}

function drawSeries(plot, scene) {
  const i = STATES.indexOf(state.series);
  let [low, high] = [Infinity, -Infinity];
  for (const { rows } of scene.motions) {
    for (const row of rows) {
      low = Math.min(low, row[i + 1]);
      high = Math.max(high, row[i + 1]);
    }
  }
  const { system } = scene;
  if (!(low <= high)) [low, high] = [system.low[i], system.high[i]];
  const [least, most] = [system.low[i] - 2 * system.scales[i], system.high[i] + 2 * system.scales[i]];
  if (!system.turns[i]) [low, high] = [Math.max(low, least), Math.min(high, most)];
  const margin = 0.06 * (high - low) || 0.05 * system.scales[i];
  plot.begin([0, state.duration], [low - margin, high + margin], { x: FACTS.time ?? (LAW.discrete ? "iteration" : "time"), y: stateWords(i), yScale: scaleOfState(i) });
  scene.motions.forEach(({ rows, strobes }, n) => {
    plot.style(motionPaint(n), 1.3);
    plot.curve(rows, 0, [0, i + 1]);
    if (LAW.discrete && rows.length < 400) drawDots(plot, rows.map((row) => [row[0], row[i + 1]]), motionPaint(n), 4);
    if (strobes.length) drawDots(plot, strobes.map((row, at) => [(at + 1) * system.period, row[i]]), "ink", 3);
  });
  if (scene.motions.length) plot.cross(clock.t, null);
  plot.end();
}

function drawDiagram(plot, scene) {
  const { diagram, system } = scene;
  const i = STATES.indexOf(state.series);
  const range = rangeOf(state.diagram);
  plot.begin(range, [system.low[i], system.high[i]], { x: parameterWords(state.diagram), y: stateWords(i), xScale: scaleOfParameter(state.diagram), yScale: scaleOfState(i) });
  const size = diagram.columns > 150 ? 1.2 : 2.2;
  for (const { value, samples, rests } of diagram.found) {
    drawDots(plot, samples.map((x) => [value, x]), "muted", LAW.discrete ? 1 : 1.6);
    for (const stable of [false, true]) {
      drawDots(plot, rests.filter((one) => (one.unstable === 0) === stable).map((one) => [value, one.x[i]]), stable ? "center" : "saddle", stable ? size + 0.8 : size);
    }
  }
  plot.cross(valueOf(state.diagram), null);
  plot.end();
}

const CURVES = {
  fold: ["fold", []], hopf: ["orbit", []], branch_point: ["second", [6, 3]], period_doubling: ["separatrix", []], torus: ["accent", [8, 3, 2, 3]],
};

function drawMap(plot, scene) {
  const map = MAPS[state.map];
  const labels = { x: parameterWords(map.x), y: parameterWords(map.y), xScale: scaleOfParameter(map.x), yScale: scaleOfParameter(map.y) };
  plot.begin(rangeOf(map.x), rangeOf(map.y), labels);
  for (const { kind, points } of map.curves) {
    const [color, dash] = CURVES[kind] ?? ["muted", []];
    plot.style(scene.stale.length ? "level" : color, 2, dash);
    plot.curve(points);
  }
  for (const one of map.points) {
    plot.style(scene.stale.length ? "level" : "ink");
    plot.c.beginPath();
    plot.c.arc(plot.px(one.x), plot.py(one.y), 3.5, 0, TWO_PI);
    plot.c.fill();
  }
  plot.cross(valueOf(map.x), valueOf(map.y));
  plot.end();
}
