"use strict";
// What is drawn of sensors: their innovations and gates, whether these are as the filter expects, and their data.

/** What the gates did, beside what they would do if all measurements were as the filter expects. */
function judged(sensors) {
  const head = ["sensor", ...(several ? ["run"] : []), "NIS inside the 95 % band", "judged", "rejected", "rejected if consistent"];
  const rows = sensors.flatMap(name => runs.flatMap((r, i) => {
    const s = r.sensors.find(s => s.name === name);
    if (!s?.nis) return [];
    const g = s.rejections;
    return [[name, ...(several ? [names[i]] : []), percent(s.nis), ...(g ? [g.judged, g.rejected, show(g.expected)] : ["–", "–", "–"])]];
  }));
  if (!rows.length) return "";
  const cells = (tag, row) => el("tr", {}, ...row.map((v, k) => el(k === 0 ? "th" : tag, k === 0 ? { scope: "row" } : {}, String(v))));
  return el("div", { class: "table" }, el("table", {}, el("thead", {}, cells("th", head)), el("tbody", {}, ...rows.map(r => cells("td", r)))));
}

/** Normalised innovations: how they are spread, beside the normal density, and how far they are white. */
function whiteness(grid, name, own, rows) {
  rows.forEach((row, k) => {
    const axis = row.replace(/ \[.*/, "");
    const of = own.map(({ i, s }) => ({ i, n: s.normalised[k] })).filter(o => o.n?.count > 1);
    if (!of.length) return;
    const edges = Float64Array.from({ length: of[0].n.density.length + 1 }, (_, j) => j / 4 - 5);
    const spread = of.map(({ i, n }) => ({ kind: "step", t: edges, y: [...n.density, n.density.at(-1)], run: i, color: runColor(i), groups: ofRun(i), width: runWidth(i, 1.5), label: label(i, "density") }));
    const x = Float64Array.from({ length: 101 }, (_, j) => j / 10 - 5);
    spread.push({ kind: "line", t: x, y: x.map(u => Math.exp(-u * u / 2) / Math.sqrt(2 * Math.PI)), color: "truth", groups: ["expected"], dash: [6, 4], width: 1.25, label: "normal" });
    ownAxis(grid, `${name}: innovation ${axis} over its σ`, { min: -5, max: 5, unit: "σ" }, spread, { scale: "length", first: true });
    const lags = of[0].n.autocorrelation.length;
    if (!lags) return;
    // Each lag is a step from half a lag before it to half a lag after.
    const lag = Float64Array.from({ length: lags + 1 }, (_, j) => j + 0.5);
    const least = Math.min(...of.map(o => o.n.count)), bound = 1.96 / Math.sqrt(least), ends = Float64Array.from([0.5, lags + 0.5]);
    const white = of.map(({ i, n }) => ({ kind: "step", t: lag, y: [...n.autocorrelation, n.autocorrelation.at(-1)], run: i, color: runColor(i), groups: ofRun(i), width: runWidth(i, 1.5), label: label(i, "ρ") }));
    for (const v of [-bound, bound]) white.push({ kind: "line", t: ends, y: [v, v], color: "soft", groups: ["expected"], dash: [6, 4], width: 1.25 });
    ownAxis(grid, `${name}: autocorrelation of innovation ${axis}, measurements apart`, { min: 0.5, max: lags + 0.5, unit: "", shown: Math.round }, white, { scale: "error" });
  });
}

// Per sensor: NIS with the gate's line and mode, the innovation of each residual row.
{
  const sensors = [...new Set(runs.flatMap(r => r.sensors.map(s => s.name)))];
  if (sensors.length) {
    const all = runs.flatMap(r => r.sensors);
    const entries = runs.map((r, i) => ["dot", runColor(i), label(i, "NIS, innovation"), `run${i}`]);
    if (!several && all.some(s => s.rows.length)) entries.push(["band", "run0", "±3σ of the innovation", "band"]);
    if (all.some(s => !s.updates.c[1]?.every(v => v !== v))) entries.push(["cross", several ? "soft" : "bad", "rejected", "rejected"]);
    entries.push(["dash", "soft", "expected mean, 95 % band, normal density", "expected"]);
    if (all.some(s => s.gated)) entries.push(["gate", "bad", "gate", "gate"], ["block", "track", "gate in track"], ["block", "denied", "gate in denial"]);
    const grid = section("innovations", "Innovations and gates", entries.concat(shaded));
    grid.before(judged(sensors));
    for (const name of sensors) {
      const own = painted.map(([r, i]) => ({ i, s: r.sensors.find(s => s.name === name) })).filter(o => o.s);
      const size = i => 1.6 + 0.4 * Math.min(i, 4);
      const statistic = own.some(o => o.s.own_statistic);
      const strip = [...own].reverse().filter(o => o.s.gated).map(o => ({ t: o.s.updates.t, y: o.s.updates.c[4] }));
      const rejects = (s, i, column) => ({ kind: "cross", t: s.updates.t, y: s.updates.c[column], color: several ? runColor(i) : "bad", groups: ofRun(i, "rejected"), size: 3.5, label: several ? "" : "rejected" });
      // Dots that would touch are drawn as the line through them.
      const cloud = (d, k, i, half) => {
        const y = d.c[k], shared = { t: d.t, y, half, run: i, color: runColor(i), groups: ofRun(i), label: label(i, "innovation") };
        return y.reduce((n, v) => n + (v === v), 0) > 1500 ? { ...shared, kind: "line", width: runWidth(i, 1) } : { ...shared, kind: "dot", size: size(i) };
      };
      const gate = s => ({ kind: "line", t: s.updates.t, y: s.updates.c[3], color: "bad", groups: ["gate"], dash: [2, 3], width: 1.75, label: "gate" });
      const series = own.map(({ s, i }) => ({ kind: "dot", t: s.updates.t, y: s.updates.c[0], run: i, color: runColor(i), groups: ofRun(i), size: size(i), label: label(i, "NIS") }));
      own.forEach(({ s, i }) => series.push(rejects(s, i, 1)));
      const dof = own.map(o => o.s.dof).find(d => d);
      const expected = own.map(o => o.s.nis).find(b => b);
      if (dof) series.push(level(dof));
      if (expected) series.push(level(expected.low, 0.75), level(expected.high, 0.75));
      const gated = own.findLast(o => o.s.gated);
      if (gated && !statistic) series.push(gate(gated.s));
      panel(grid, `${name}: NIS`, { series, scale: "nis", strips: strip.length ? strip : null, first: true });
      if (statistic) {
        const series = own.map(({ s, i }) => ({ kind: "dot", t: s.updates.t, y: s.updates.c[2], run: i, color: runColor(i), groups: ofRun(i), size: size(i), label: label(i, "statistic") }));
        if (gated) series.push(gate(gated.s));
        panel(grid, `${name}: gate statistic`, { series, scale: "nis" });
      }
      const rows = own.map(o => o.s.rows).reduce((a, b) => b.length >= a.length ? b : a, []);
      rows.forEach((row, k) => {
        const series = [], of = own.filter(o => k < o.s.rows.length);
        // After the five of the judgement: innovations accepted, not accepted, and their 3σ.
        const column = (s, kind) => 5 + kind * s.rows.length + k;
        for (const { s, i } of of) band(series, i, s.updates.t, s.updates.c[column(s, 2)], null);
        for (const { s, i } of of) series.push(cloud(s.updates, column(s, 0), i, s.updates.c[column(s, 2)]));
        for (const { s, i } of of) series.push({ ...rejects(s, i, column(s, 1)), clamped: true, label: several ? "" : "not accepted" });
        panel(grid, `${name}: innovation ${row}`, { series, scale: "error" });
      });
      // The power of the gate, where a run is alone: the smallest error of each row that it refuses.
      if (!several && gated && rows.length) {
        const { s } = gated;
        const power = rows.map((row, k) => ({ kind: "line", t: s.updates.t, y: s.updates.c[5 + 3 * rows.length + k], color: runColor(k), width: 1.25, label: row }));
        const known = power.filter(p => p.y.some(v => v === v));
        if (known.length) panel(grid, `${name}: smallest error refused`, { series: known });
      }
      whiteness(grid, name, own, rows);
    }
  }
}

// Sensor data: that of the first run; the runs share it.
{
  const inputs = runs[0]?.inputs ?? [];
  if (inputs.length) {
    const triple = inputs.some(i => i.table.c.length === 3);
    const entries = triple ? [["line", "run0", "x or north"], ["line", "run1", "y or east"], ["line", "run2", "z or down"]] : [];
    const grid = section("data", "Sensor data", entries.concat(shaded));
    for (const i of inputs) {
      const three = i.table.c.length === 3;
      const series = i.table.c.map((y, k) => ({ kind: "line", t: i.table.t, y, color: runColor(k), width: 1.25, label: three ? "xyz"[k] : "" }));
      if (!three) series[0].label = i.unit || "value";
      const title = i.name.includes("·") ? i.name : i.name.charAt(0).toUpperCase() + i.name.slice(1);
      const unit = i.unit ? ` [${i.unit}]` : "";
      if (three && i.unit === "m/s²") {
        // Gravity would flatten the other two.
        panel(grid, `${title} x, y${unit}`, { series: series.slice(0, 2) });
        panel(grid, `${title} z${unit}`, { series: series.slice(2) });
      } else panel(grid, `${title}${unit}`, { series, angle: i.angle });
    }
  }
}
