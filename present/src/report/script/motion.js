"use strict";
// What is drawn of runs: the map, motion and errors, parameters, fixes.

for (const run of runs) {
  for (const q of run.quantities) for (const k of ["estimate", "truth", "error"]) q[k] = table(q[k]);
  for (const k of ["path", "true_path", "wanted", "differences"]) run[k] = table(run[k]);
  for (const p of run.parameters) for (const k of ["estimate", "truth"]) p[k] = table(p[k]);
  for (const n of run.nees) n.table = table(n.table);
  for (const s of run.sensors) for (const k of ["updates", "used", "rejected", "apart", "intervals"]) s[k] = table(s[k]);
  if (run.smoothed) {
    for (const q of run.smoothed.quantities) for (const k of ["estimate", "error"]) q[k] = table(q[k]);
    run.smoothed.path = table(run.smoothed.path);
  }
  for (const i of run.inputs) i.table = table(i.table);
}
/** What later data say, of a run that is alone. */
const later = several ? null : runs[0]?.smoothed;
const laterColor = "run3", laterKey = ["line", laterColor, "smoothed", "smoothed"];
const addLater = (into, d, a, center, width) => {
  if (empty(d)) return;
  const half = d.c[a + 3], groups = ["smoothed", "band"];
  if (half.some(v => v > 0)) {
    into.push({ kind: "edge", upper: true, t: d.t, y: center ? plus(d.c[a], half, 1) : half, color: laterColor, groups });
    into.push({ kind: "edge", t: d.t, y: center ? plus(d.c[a], half, -1) : half.map(v => -v), color: laterColor, groups });
  }
  into.push({ kind: "line", t: d.t, y: d.c[a], half, color: laterColor, groups: ["smoothed"], width, label: "smoothed" });
};
// Fixes that were withheld are points, and no way.
const withheld = runs.find(r => r.withheld)?.withheld;
const trueName = withheld ? `rows withheld of ${withheld}` : "truth", trueMark = withheld ? "dot" : "dash";
const truth = q => runs.map(r => r.quantities[q].truth).find(t => !empty(t));
// The strip below each plot needs a key where it has more than one colour.
const seen = Object.keys(states).filter(state => health.some(h => h[2] === state));
const whose = runs.length > 1 ? ` of ${runs[0].name}` : "";
const shaded = (outages.length ? [["shade", "shade", "outage"]] : []).concat(faults.length ? [["block", "fault", "declared fault"]] : [], seen.length > 1 || whose && seen.length ? seen.map(s => ["block", states[s], `health${whose}: ${s}`]) : []);
const names = runs.map(r => r.name);
/** The heading that a controller wanted, its turns counted like those of the estimate. */
const wanted = run => {
  const { t, c: [y] } = run.wanted, q = run.quantities[2].estimate;
  const near = Array.from(y, (v, i) => {
    const k = nearest(q.t, t[i]), own = k < 0 ? v : q.c[2][k];
    return own === own ? v + 360 * Math.round((own - v) / 360) : v;
  });
  // The last one holds to the end.
  return { kind: "step", t: Float64Array.from([...t, span[1]]), y: [...near, near.at(-1)], color: "bad", width: 1.5, label: "wanted", groups: ["wanted"] };
};
const label = (i, text) => several ? names[i] : text;
/** Both edges of a band of that half width, about a curve or about 0. */
const band = (into, run, t, half, center) => {
  if (!half || !half.some(v => v > 0)) return;
  const color = runColor(run);
  const groups = ofRun(run, "band");
  into.push({ kind: "edge", upper: true, t, y: center ? plus(center, half, 1) : half, color, groups });
  into.push({ kind: "edge", t, y: center ? plus(center, half, -1) : half.map(v => -v), color, groups });
};

// The map, and the parts of it that are enlarged.
{
  const true_path = runs.map(r => r.true_path).find(t => t.t.length);
  const lines = runs.map((r, i) => ({ ...r.path, name: label(i, "estimate"), color: runColor(i), group: `run${i}`, width: runWidth(i, 2.25) })).filter(l => l.t.length);
  const fixes = new Map();
  for (const s of runs[0]?.sensors ?? []) if (s.used.t.length || s.rejected.t.length) fixes.set(s.name, s);
  if (lines.length || true_path) {
    const entries = [];
    if (later?.path.t.length) lines.push({ ...later.path, name: "smoothed", color: laterColor, group: "smoothed", width: 1.5 });
    if (true_path) entries.push([trueMark, "truth", trueName, "truth"]);
    const asked = runs.find(r => r.asked.length)?.asked ?? [];
    if (asked.length) entries.push(["gate", "bad", "path asked for", "asked"]);
    for (const l of lines) entries.push(["line", l.color, l.name, l.group]);
    for (const [name, s] of fixes) {
      const of = several ? `${name} (${names[0]})` : name;
      if (s.used.t.length) entries.push(["dot", "fix", `fix of ${of}`, `fix ${name}`]);
      if (s.rejected.t.length) entries.push(["cross", "bad", `rejected fix of ${of}`, `rejected ${name}`]);
    }
    entries.push(["ring", "text", "start"], ["square", "text", "end"]);
    const grid = section("trajectory", "Trajectory", entries, true);
    const add = (box, title, part) => {
      const out = el("output");
      const canvas = el("canvas", { role: "img", tabindex: "0", "aria-label": `${title}: horizontal trajectory, north over east` });
      const host = el("div", { class: "map" }, canvas);
      const follow = el("button", { type: "button", class: "follow", "aria-pressed": "false", title: "keep the place of the cursor in the middle" }, "Follow");
      box.append(el("div", { class: "plot" }, el("div", { class: "head" }, el("b", {}, `${title}, north over east [m]`), out, follow), host));
      maps.push(makeMap({ canvas, host, out, part, follow, title, hidden: grid.hiddenGroups }, true_path, lines, [...fixes.values()], asked));
    };
    add(grid, "All of it", null);
    const details = el("div", { class: "grid" });
    if (runs[0].details.length) grid.after(details);
    for (const [title, [n, e], size] of runs[0].details) add(details, title, { n, e, h: size, w: size });
  }
}

// Position, velocity, attitude: value on the left, error on the right.
[0, 1, 2].forEach(q => {
  const present = runs.filter(r => !empty(r.quantities[q].estimate));
  const reference = truth(q);
  if (!present.length && !reference) return;
  const { name, unit, axes, angles } = runs[0].quantities[q];
  const errors = runs.some(r => !empty(r.quantities[q].error));
  const fixes = q === 0 ? (runs[0]?.sensors ?? []).filter(s => s.used.t.length || s.rejected.t.length) : [];
  const entries = [];
  if (reference) entries.push([trueMark, "truth", trueName, "truth"]);
  runs.forEach((r, i) => { if (!empty(r.quantities[q].estimate)) entries.push(["line", runColor(i), label(i, errors ? "estimate, error" : "estimate"), `run${i}`]); });
  const after = later?.quantities[q];
  if (after && !empty(after.estimate)) entries.push(laterKey);
  entries.push(["band", several ? "soft" : "run0", "±3σ", "band"]);
  // The heading that a controller wanted, beside the one that it had.
  const isSteered = q === 2 && runs[0]?.wanted.t.length > 0;
  if (isSteered) entries.push(["line", "bad", "heading wanted by the controller", "wanted"]);
  if (fixes.some(s => s.used.t.length)) entries.push(["dot", "fix", "fix", "fix"]);
  if (fixes.some(s => s.rejected.t.length)) entries.push(["cross", "bad", "rejected fix", "rejected"]);
  const grid = section(name.toLowerCase(), errors ? `${name} and its error` : name, entries.concat(shaded), !errors);
  axes.forEach((axis, a) => {
    const series = [], wrong = [];
    painted.forEach(([r, i]) => { const d = r.quantities[q].estimate; if (!empty(d)) band(series, i, d.t, d.c[a + 3], d.c[a]); });
    if (isSteered && a === 2) series.push(wanted(runs[0]));
    for (const s of fixes) series.push({ kind: "dot", t: s.used.t, y: s.used.c[a], color: "fix", groups: ["fix"], size: 1.8, label: fixes.length > 1 ? s.name : "fix" });
    painted.forEach(([r, i]) => {
      const d = r.quantities[q].estimate;
      if (!empty(d)) series.push({ kind: "line", run: i, t: d.t, y: d.c[a], half: d.c[a + 3], color: runColor(i), groups: ofRun(i), width: runWidth(i, 1.75), label: label(i, "estimate") });
    });
    if (after) addLater(series, after.estimate, a, true, 1.25);
    if (reference) series.push({ kind: withheld ? "dot" : "line", t: reference.t, y: reference.c[a], color: "truth", groups: ["truth"], dash: [6, 4], width: 1.5, size: 2, label: trueName });
    for (const s of fixes) series.push({ kind: "cross", t: s.rejected.t, y: s.rejected.c[a], color: "bad", groups: ["rejected"], size: 3.5, label: "rejected" });
    panel(grid, `${axis} [${unit}]`, { series, angle: angles[a] && (axis === "Yaw" ? "heading" : "turn") });
    if (errors) {
      painted.forEach(([r, i]) => { const d = r.quantities[q].error; if (!empty(d)) band(wrong, i, d.t, d.c[a + 3], null); });
      painted.forEach(([r, i]) => {
        const d = r.quantities[q].error;
        if (!empty(d)) wrong.push({ kind: "line", run: i, t: d.t, y: d.c[a], half: d.c[a + 3], color: runColor(i), groups: ofRun(i), width: runWidth(i, 1.25), label: label(i, "error") });
      });
      if (after) addLater(wrong, after.error, a, false, 1.25);
      panel(grid, `${axis} error [${unit}]`, { series: wrong, scale: "error" });
    }
  });
});

/** How many intervals are how long: the axis is the logarithm of the length. */
function intervals(grid, title, bars) {
  const log = s => Math.log10(s), most = Math.max(...bars.map(b => b.count));
  const t = Float64Array.from([...bars.map(b => log(b.from)), log(bars.at(-1).to)]);
  const y = [...bars.map(b => b.count), bars.at(-1).count];
  const own = { min: t[0] - 0.05, max: t.at(-1) + 0.05, unit: "s", shown: v => 10 ** v };
  ownAxis(grid, title, own, [{ kind: "step", t, y, color: "run0", label: "measurements" }], { scale: most > 0 ? "nis" : "length" });
}

// How far fixes lie from the estimate, and how regularly measurements come.
{
  const shown = runs.flatMap((r, i) => r.sensors.map(s => ({ s, i })));
  const names = [...new Set(shown.filter(({ s }) => !empty(s.apart) || s.bars.length).map(({ s }) => s.name))];
  if (names.length) {
    const entries = runs.map((r, i) => ["dot", runColor(i), label(i, "measurement"), `run${i}`]);
    if (shown.some(({ s }) => s.rejected.t.length)) entries.push(["cross", several ? "soft" : "bad", "rejected fix", "rejected"]);
    const grid = section("fixes", "Fixes and intervals", entries.concat(shaded));
    for (const name of names) {
      const own = shown.filter(({ s }) => s.name === name).reverse();
      const dots = (d, k, i, text) => ({ kind: "dot", t: d.t, y: d.c[k], run: i, color: runColor(i), groups: ofRun(i), size: 1.5, label: label(i, text) });
      const far = own.filter(({ s }) => !empty(s.apart));
      if (far.length) {
        const series = far.map(({ s, i }) => dots(s.apart, 0, i, "from the estimate"));
        for (const { s, i } of far) series.push({ kind: "cross", t: s.apart.t, y: s.apart.c[1], color: several ? runColor(i) : "bad", groups: ofRun(i, "rejected"), size: 3.5, label: several ? "" : "rejected" });
        panel(grid, `${name}: horizontal distance from fix to estimate [m]`, { series, scale: "length", first: true });
      }
      // Runs on the same data share them.
      const { s } = own[own.length - 1];
      if (s.bars.length) {
        panel(grid, `${name}: interval between measurements [s]`, { series: [dots(s.intervals, 0, 0, "interval")], scale: "length", first: true });
        intervals(grid, `${name}: how many intervals are how long`, s.bars);
      }
    }
  }
}

// Runs beside the first: what they differ by, at the same times.
runs.forEach((run, i) => {
  const d = run.differences;
  if (i === 0 || empty(d)) return;
  const grid = section(`difference-${i}`, `${names[i]} less ${names[0]}`, shaded);
  runs[0].quantities.forEach((q, k) => q.axes.forEach((axis, a) => {
    const y = d.c[3 * k + a];
    if (!y.some(v => v === v)) return;
    panel(grid, `${axis}${k === 1 ? " velocity" : ""} difference [${q.unit}]`, { series: [{ kind: "line", t: d.t, y, color: runColor(i), width: 1.25, label: "difference" }] });
  }));
});

/** A level that holds all the time. */
const level = (v, width = 1.25) => ({ kind: "line", t: span, y: [v, v], color: "soft", groups: ["expected"], dash: [6, 4], width });
const percent = b => `${(100 * b.inside / b.count).toFixed(1)} %`;

// NEES: the error in units of what the filter says of it.
{
  const kinds = [...new Set(runs.flatMap(r => r.nees.map(n => n.name)))];
  if (kinds.length) {
    const entries = runs.map((r, i) => ["line", runColor(i), label(i, "NEES"), `run${i}`]);
    const grid = section("nees", "Consistency of the error", [...entries, ["dash", "soft", "expected mean and 95 % band", "expected"], ...shaded]);
    for (const kind of kinds) {
      const own = painted.map(([r, i]) => ({ i, n: r.nees.find(n => n.name === kind) })).filter(o => o.n);
      const { band } = own.at(-1).n;
      const series = own.map(({ i, n }) => ({ kind: "line", t: n.table.t, y: n.table.c[0], run: i, color: runColor(i), groups: ofRun(i), width: runWidth(i, 1.25), label: label(i, "NEES") }));
      series.push(level(band.dof), level(band.low, 0.75), level(band.high, 0.75));
      panel(grid, `${kind} NEES of ${band.dof}${several ? "" : `: ${percent(band)} inside the band`}`, { series, scale: "nis" });
    }
  }
}

// Parameters that the filter estimates.
{
  const known = [...new Set(runs.flatMap(r => r.parameters.map(p => p.name)))];
  if (known.length) {
    const drawn = runs.some(r => r.parameters.some(p => !empty(p.truth)));
    const entries = runs.map((r, i) => ["line", runColor(i), label(i, "estimate"), `run${i}`]);
    const grid = section("parameters", "Estimated parameters", [...(drawn ? [["dash", "truth", "truth of the simulation", "truth"]] : []), ...entries, ["band", several ? "soft" : "run0", "±3σ", "band"], ...shaded]);
    for (const name of known) {
      const own = painted.map(([r, i]) => ({ i, p: r.parameters.find(p => p.name === name) })).filter(o => o.p);
      const series = [];
      for (const { i, p } of own) band(series, i, p.estimate.t, p.estimate.c[1], p.estimate.c[0]);
      for (const { i, p } of own) series.push({ kind: "line", run: i, t: p.estimate.t, y: p.estimate.c[0], half: p.estimate.c[1], color: runColor(i), groups: ofRun(i), width: runWidth(i, 1.5), label: label(i, "estimate") });
      const { p } = own.at(-1);
      if (!empty(p.truth)) series.push({ kind: "line", t: p.truth.t, y: p.truth.c[0], color: "truth", groups: ["truth"], dash: [6, 4], width: 1.5, label: "truth" });
      panel(grid, p.unit ? `${name} [${p.unit}]` : name, { series });
    }
  }
}
