// Numbers and lines of Python of a system in a potential.

// Numbers of everything that is shown; what is not finite is written as text.
function dataOf(scene) {
  const { pot } = scene;
  const values = Object.fromEntries(NAMES.map((name, i) => [name, state.values[i]]));
  return {
    model: FACTS.model,
    law: FACTS.law,
    parameters: values,
    damping: state.damping,
    torque: state.torque,
    coefficients: pot.coefficients ?? null,
    equilibria: pot.points.map(({ x, kind, label, energy, curvature }) => ({ [FACTS.coordinate]: x, kind, label: label ?? null, energy, curvature })),
    separatrices: pot.separatrices().map(({ saddle, left, right, exponent, shares }) => ({ saddle: saddle.x, exponent, left, right, shares })),
    orbits: scene.orbits.map((one, i) => {
      const points = scene.curves[i];
      const found = { ...pot.orbit(...one), columns: [FACTS.coordinate, `d${FACTS.coordinate}`] };
      if (!scene.loaded) return { ...found, states: points };
      found.columns.push("force_A2", "force_B2");
      return { ...found, states: forceCurves(LAW, scene.p, points) };
    }),
    map: scene.map ? { x: state.x, y: state.y, fold: scene.map.edges } : null,
  };
}

// Lines that make the same system and the same numbers with the library.
function pythonOf(scene) {
  const { imports, start, end, mapping } = FACTS.python;
  const given = NAMES.map((name, i) => [name, state.values[i]]).filter(([, value]) => value !== null);
  const text = given.map(([name, value]) => (mapping ? `'${name}': ${value}` : `${name}=${value}`)).join(", ");
  const lines = ["import numpy as np", "import phasekit as pk"];
  if (imports) lines.push(imports);
  lines.push("", `system = ${start}${text}${end}`);
  const tilted = state.torque !== 0 || state.damping !== 0;
  if (!tilted) lines.push("equilibria = pk.equilibria(system)", "separatrices = pk.separatrices(system)");
  const starts = `[${scene.orbits.map((one) => `(${one[0]}, ${one[1]})`).join(", ")}]`;
  if (tilted) {
    const more = ["damping", "torque"].filter((name) => state[name] !== 0).map((name) => `${name}=${state[name]}`);
    lines.push(`perturbed = pk.Perturbed(system, ${more.join(", ")})`, "equilibria = pk.equilibria(perturbed)");
    if (scene.orbits.length) {
      lines.push(`starts = ${starts}`, `t = np.linspace(0.0, ${scene.history.length}, 401)`, "motions = [pk.flow(perturbed, x, v, t) for x, v in starts]");
    }
    lines.push(`pk.plot.phase_portrait(perturbed${scene.orbits.length ? ", orbits=starts" : ""})`);
  } else {
    if (scene.orbits.length) {
      lines.push(`starts = ${starts}`, "x0, v0 = np.transpose(starts)", "orbits = pk.orbits(system, x0, v0)");
      if (scene.loaded) lines.push("motion = pk.flow(system, x0[-1], v0[-1], np.linspace(0.0, 10.0, 401))", "forces = pk.bearing_forces(system, motion)");
    }
    lines.push(`pk.plot.phase_portrait(system${scene.orbits.length ? ", orbits=starts" : ""})`);
  }
  return `${lines.join("\n")}\n`;
}
