"use strict";
// Draws the data of the page: time plots by uPlot, the map by hand.
(() => {
  const root = document.documentElement;
  const data = JSON.parse(document.getElementById("data").textContent);
  const runs = data.runs;
  const several = runs.length > 1;

  // ---- data ------------------------------------------------------------------------------
  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
  // Times count from the log's beginning where they are those of a calendar.
  const zero = data.span[0] > 1e6 || data.span[0] < 0 ? Math.floor(data.span[0]) : 0;
  const table = d => {
    const t = new Float64Array(bytes(d.t)).map(t => t - zero);
    return { t, c: d.c.map(c => new Float32Array(bytes(c))) };
  };
  for (const run of runs) {
    for (const q of run.quantities) for (const k of ["estimate", "truth", "error"]) q[k] = table(q[k]);
    for (const k of ["path", "true_path"]) run[k] = table(run[k]);
    run.wanted = table(run.wanted);
    for (const s of run.sensors) for (const k of ["updates", "used", "rejected", "apart", "intervals"]) s[k] = table(s[k]);
    for (const i of run.inputs) i.table = table(i.table);
  }
  const span = data.span.map(t => t - zero);
  if (!(span[1] > span[0])) span[1] = span[0] + 1;
  const outages = runs[0] ? runs[0].outages.map(w => w.map(t => t - zero)) : [];
  /** Colours of ill health, from bad to worse. */
  const ill = { coasting: "run3", degraded: "denied", lost: "bad" };
  const health = runs[0] ? runs[0].health.map(([a, b, state]) => [a - zero, b - zero, state]) : [];
  const empty = d => d.t.length === 0 || !d.c.some(c => c.some(v => v === v));
  const plus = (a, b, k) => a.map((v, i) => v + k * b[i]);
  /** Index of the sample nearest to time t. */
  const nearest = (ts, t) => {
    let a = 0, b = ts.length - 1;
    if (b < 0) return -1;
    while (b - a > 1) { const m = (a + b) >> 1; if (ts[m] < t) a = m; else b = m; }
    return t - ts[a] <= ts[b] - t ? a : b;
  };

  // ---- looks -----------------------------------------------------------------------------
  let style;
  const color = name => style.getPropertyValue(`--${name}`).trim();
  const faint = (hex, a) => `${hex}${Math.round(a * 255).toString(16).padStart(2, "0")}`;
  const phone = () => !root.dataset.print && innerWidth < 560;
  const fontSize = () => root.dataset.print ? 11 : phone() ? 16 : 14;
  const font = () => `${fontSize()}px system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif`;
  const minus = text => text.replace("-", "−");
  const show = v => {
    if (v == null || v !== v) return "–";
    const a = Math.abs(v);
    return minus(a !== 0 && (a < 1e-3 || a >= 1e6) ? v.toExponential(2) : a >= 1000 ? v.toFixed(0) : v.toFixed(a >= 100 ? 1 : a >= 10 ? 2 : 3));
  };
  const heading = v => { const w = ((v % 360) + 360) % 360; return w > 180 ? w - 360 : w; };
  const el = (tag, attributes = {}, ...children) => {
    const e = document.createElement(tag);
    for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v);
    e.append(...children);
    return e;
  };
  const swatch = (kind, name) => {
    const c = `var(--${name})`;
    const mark = {
      line: `<path d="M0 8H30" stroke="${c}" stroke-width="2.5"/>`,
      dash: `<path d="M0 8H30" stroke="${c}" stroke-width="2" stroke-dasharray="6 4"/>`,
      gate: `<path d="M0 8H30" stroke="${c}" stroke-width="2" stroke-dasharray="2 3"/>`,
      band: `<path d="M0 2H30V14H0Z" fill="${c}" fill-opacity=".2"/><path d="M0 2H30M0 14H30" stroke="${c}"/>`,
      block: `<path d="M0 4H30V12H0Z" fill="${c}"/>`,
      shade: `<path d="M0 0H30V16H0Z" fill="${c}"/>`,
      dot: `<circle cx="15" cy="8" r="3.5" fill="${c}"/>`,
      ring: `<circle cx="15" cy="8" r="5" fill="none" stroke="${c}" stroke-width="2"/>`,
      square: `<path d="M10 3H20V13H10Z" fill="${c}"/>`,
      cross: `<path d="M10 3L20 13M20 3L10 13" stroke="${c}" stroke-width="2"/>`,
    }[kind];
    const box = document.createElement("template");
    box.innerHTML = `<svg viewBox="0 0 30 16" aria-hidden="true" fill="none">${mark}</svg>`;
    return box.content;
  };
  const legend = entries => {
    const list = el("ul", { class: "legend" });
    for (const [kind, name, text] of entries) list.append(el("li", {}, swatch(kind, name), text));
    return list;
  };
  const runColor = i => `run${i % 6}`;
  // The first run lies on top; where runs coincide, the later ones look out from under it.
  const painted = runs.map((r, i) => [r, i]).reverse();
  const runWidth = (i, least) => least + Math.min(i, 4) * 0.4;

  // ---- time plots ------------------------------------------------------------------------
  const plots = []; // { spec, host, out, u }
  const maps = [], histograms = [];
  let range = [...span];
  const bar = {};

  const setRange = (a, b) => {
    const least = Math.max((span[1] - span[0]) * 1e-5, 1e-3);
    if (b - a < least) { const m = (a + b) / 2; a = m - least / 2; b = m + least / 2; }
    const width = Math.min(b - a, span[1] - span[0]);
    a = Math.min(Math.max(a, span[0]), span[1] - width);
    range = [a, a + width];
    for (const p of plots) if (p.u) p.u.setScale("x", { min: range[0], max: range[1] });
    for (const m of maps) m.draw();
    report();
  };
  const reset = () => { for (const m of maps) m.reset(); setRange(span[0], span[1]); };
  const zoom = k => { const m = (range[0] + range[1]) / 2, h = (range[1] - range[0]) / 2 * k; setRange(m - h, m + h); };
  const move = k => { const w = (range[1] - range[0]) * k; setRange(range[0] + w, range[1] + w); };
  const instant = t => minus(t.toFixed(range[1] - range[0] > 50 ? 0 : range[1] - range[0] > 2 ? 1 : 3));
  const report = () => { if (bar.out) bar.out.value = `${instant(range[0])} – ${instant(range[1])} s`; };

  /** Puts the cursor of every plot and of the map at time t; null takes it away. */
  let cursor = null;
  const point = (t, from) => {
    cursor = t;
    for (const p of plots) {
      if (!p.u) continue;
      if (p.u !== from) p.u.setCursor(t == null ? { left: -10, top: -10 } : { left: p.u.valToPos(t, "x"), top: 10 }, false);
      p.out.value = t == null ? "" : `${show(t)} s   ${read(p.spec, t)}`;
    }
    for (const m of maps) m.mark(t);
  };
  const read = (spec, t) => spec.series.filter(s => s.label).sort((a, b) => (a.run ?? 0) - (b.run ?? 0)).map(s => {
    const i = nearest(s.t, t);
    if (i < 0 || Math.abs(s.t[i] - t) > Math.max((range[1] - range[0]) / 50, 1.5)) return null;
    if (s.y[i] !== s.y[i]) return null;
    const v = spec.angle ? heading(s.y[i]) : s.y[i];
    return `${s.label} ${show(v)}${s.half ? ` ± ${show(s.half[i])}` : ""}`;
  }).filter(Boolean).join("   ");

  /** The joined table of all series: their time bases differ. */
  const join = series => {
    const bases = new Map();
    series.forEach((s, i) => {
      if (!bases.has(s.t)) bases.set(s.t, []);
      bases.get(s.t).push(i);
    });
    const nulls = a => Array.from(a, v => v === v ? v : null);
    const tables = [...bases].map(([t, own]) => [Array.from(t), ...own.map(i => nulls(series[i].y))]);
    // A line that only shares its neighbours' times must not be broken by them.
    const joined = tables.length === 1 ? tables[0] : uPlot.join(tables);
    const order = [...bases.values()].flat();
    const out = [joined[0]];
    order.forEach((i, at) => { out[i + 1] = joined[at + 1]; });
    return out;
  };

  /** Lowest and highest value in sight, largest half width of a band and its 95th percentile. */
  const extent = spec => {
    let low = Infinity, high = -Infinity, widest = 0;
    const halves = [];
    for (const s of spec.series) {
      if (s.kind === "edge" || s.clamped) continue;
      let i = nearest(s.t, range[0]), end = nearest(s.t, range[1]);
      if (i < 0) continue;
      i = Math.max(0, i - 1); end = Math.min(s.t.length - 1, end + 1);
      const every = Math.max(1, (end - i) >> 9);
      for (let k = 0; i <= end; i++, k++) {
        const v = s.y[i];
        if (v < low) low = v;
        if (v > high) high = v;
        if (s.half && s.half[i] > widest) widest = s.half[i];
        if (s.half && k % every === 0 && s.half[i] === s.half[i]) halves.push(s.half[i]);
      }
    }
    halves.sort((a, b) => a - b);
    const usual = halves.length ? halves[Math.floor(halves.length * 0.95)] : 0;
    return low <= high ? { low, high, widest, usual } : { low: 0, high: 1, widest: 0, usual: 0 };
  };
  // The curves set the scale. A band that opens wide at the start, or that of an unaided run
  // beside aided ones, may leave the plot rather than flatten everything.
  const rangeY = spec => () => {
    const { low, high, widest, usual } = extent(spec);
    if (spec.scale === "nis") return [0, Math.max(high, 4) * 1.4];
    if (spec.scale === "length") return [0, Math.max(high, 1e-9) * 1.08];
    if (spec.scale === "error") {
      const peak = Math.max(-low, high);
      const m = Math.max(peak, Math.min(widest, several && peak > 0 ? 2 * peak : Math.max(1.5 * peak, 1.5 * usual)), 1e-9) * 1.08;
      return [-m, m];
    }
    const spread = high - low;
    const pad = Math.min(widest, several && spread > 0 ? 0.5 * spread : Math.max(0.15 * spread, 1.5 * usual));
    const more = Math.max(0.06 * spread, Math.abs(high) * 1e-6, 1e-9);
    return [low - pad - more, high + pad + more];
  };

  const clip = (u, draw) => {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    draw(ctx, uPlot.pxRatio);
    ctx.restore();
  };
  const marks = (u, s) => clip(u, (ctx, px) => {
    s.count ??= s.y.reduce((n, v) => n + (v === v), 0);
    const many = s.kind === "cross" && s.count > 400;
    const r = (s.size || 2) * (many ? 0.6 : 1) * px;
    const top = u.bbox.top + r, bottom = u.bbox.top + u.bbox.height - r;
    ctx.globalAlpha = many ? 0.5 : 1;
    ctx.fillStyle = ctx.strokeStyle = s.stroke;
    ctx.lineWidth = 1.5 * px;
    ctx.setLineDash([]);
    ctx.beginPath();
    const [a, b] = range;
    for (let i = 0; i < s.t.length; i++) {
      if (s.t[i] < a || s.t[i] > b || s.y[i] !== s.y[i]) continue;
      const x = u.valToPos(s.t[i], "x", true);
      let y = u.valToPos(s.y[i], "y", true);
      if (s.clamped) y = Math.min(Math.max(y, top), bottom);
      if (s.kind === "cross") { ctx.moveTo(x - r, y - r); ctx.lineTo(x + r, y + r); ctx.moveTo(x + r, y - r); ctx.lineTo(x - r, y + r); }
      else { ctx.moveTo(x + r, y); ctx.arc(x, y, r, 0, 7); }
    }
    if (s.kind === "cross") ctx.stroke(); else ctx.fill();
  });
  /** Outages in grey behind the curves, ill health as a band at their foot; the gate's mode above them. */
  const shades = u => clip(u, ctx => {
    ctx.fillStyle = color("shade");
    for (const [a, b] of outages) {
      const x = u.valToPos(a, "x", true);
      ctx.fillRect(x, u.bbox.top, u.valToPos(b, "x", true) - x, u.bbox.height);
    }
    const px = uPlot.pxRatio, worst = Object.keys(ill);
    for (const [a, b, state] of health) {
      // The worse stands out by height too, not by colour alone.
      const x = u.valToPos(a, "x", true), height = (3 + 3 * worst.indexOf(state)) * px;
      ctx.fillStyle = color(ill[state]);
      ctx.fillRect(x, u.bbox.top + u.bbox.height - height, Math.max(u.valToPos(b, "x", true) - x, px), height);
    }
  });
  const strips = (u, spec) => {
    const { ctx, bbox } = u, px = uPlot.pxRatio;
    spec.strips.forEach((s, row) => {
      const y = bbox.top - (spec.strips.length - row) * 13 * px + px, height = 9 * px;
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, y, bbox.width, height);
      ctx.clip();
      for (let i = 0; i < s.t.length; i++) {
        const denied = s.y[i] > 0.5;
        let j = i;
        // Where the sensor is silent, its gate stays in its mode.
        while (j + 1 < s.t.length && (s.y[j + 1] !== s.y[j + 1] || (s.y[j + 1] > 0.5) === denied)) j++;
        const from = u.valToPos(s.t[i], "x", true);
        const to = u.valToPos(j + 1 < s.t.length ? s.t[j + 1] : s.t[j], "x", true);
        const wide = Math.max(to - from, 2 * px);
        // Denied stands out by height too, not by colour alone.
        ctx.fillStyle = color(denied ? "denied" : "track");
        ctx.fillRect(from, denied ? y : y + height * 0.3, wide, denied ? height : height * 0.4);
        i = j;
      }
      ctx.restore();
    });
  };

  // Steps of 1, 3, 10 …: the axis is linear near 0 and logarithmic above.
  const nisSplits = u => {
    const { max } = u.scales.y, out = max < 200 ? [0, 1, 3] : [0, 1];
    // Above four decades every other one.
    for (let v = 10; v <= max; v *= max > 2e4 ? 100 : 10) { out.push(v); if (max < 200) out.push(3 * v); }
    return out.filter(v => v <= max);
  };
  const angleIncrements = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 45, 90, 180, 360, 720, 1440, 3600, 7200, 36000];
  const build = (p, width) => {
    const { spec } = p;
    const ink = color("text"), grid = { stroke: color("grid"), width: 1 };
    for (const s of spec.series) s.stroke = color(s.color);
    const options = {
      width,
      height: spec.height ?? (root.dataset.print ? 140 : phone() ? 200 : 170),
      padding: [spec.strips ? spec.strips.length * 13 + 6 : 8, 14, 0, 0],
      legend: { show: false },
      cursor: {
        y: false,
        points: { show: false },
        drag: { x: true, y: false, setScale: false },
        bind: { dblclick: () => () => { reset(); return null; } },
      },
      scales: {
        x: { time: false, range: () => [...range] },
        y: { range: rangeY(spec), ...(spec.scale === "nis" ? { distr: 4, asinh: 1 } : {}) },
      },
      axes: [
        { font: font(), stroke: ink, grid, ticks: grid, size: fontSize() + 16, gap: 3, space: fontSize() * 6,
          values: (u, vs) => vs.map((v, i) => v == null ? "" : `${minus(String(+v.toFixed(6)))}${i === vs.length - 1 ? " s" : ""}`) },
        { font: font(), stroke: ink, grid, ticks: grid, size: fontSize() * 4.4, gap: 3, space: fontSize() * (spec.angle ? 1.5 : 2.2),
          ...(spec.scale === "nis" ? { splits: nisSplits, values: (u, vs) => vs.map(v => String(v)), filter: (u, vs) => vs } : spec.angle ? { incrs: angleIncrements, values: (u, vs) => vs.map(v => minus(String(+(vs[1] - vs[0] < 360 ? heading(v) : v).toFixed(3)))) }
            : { values: (u, vs) => vs.map(v => v == null ? "" : minus(Math.abs(v) >= 1e6 || (v !== 0 && Math.abs(v) < 1e-4) ? v.toExponential(0) : String(+v.toFixed(5)))) }) },
      ],
      series: [{}, ...spec.series.map(s => {
        const shared = { spanGaps: false, points: { show: false } };
        if (s.kind === "dot" || s.kind === "cross") return { ...shared, paths: () => null };
        if (s.kind === "edge") return { ...shared, stroke: faint(s.stroke, several ? 0.75 : 0.5), width: 1 };
        if (s.kind === "step") shared.paths = uPlot.paths.stepped({ align: 1 });
        return { ...shared, stroke: s.stroke, width: s.width ?? 1.75, dash: s.dash };
      })],
      bands: spec.series.flatMap((s, i) => s.kind === "edge" && s.upper ? [{ series: [i + 1, i + 2], fill: faint(s.stroke, several ? 0.04 : 0.16) }] : []),
      hooks: {
        drawClear: [shades],
        drawAxes: [u => { for (const s of spec.series) if (s.kind === "dot") marks(u, s); }],
        draw: [u => {
          for (const s of spec.series) if (s.kind === "cross") marks(u, s);
          if (spec.strips) strips(u, spec);
        }],
        setSelect: [u => {
          if (u.select.width > 4) setRange(u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x"));
          u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
        }],
        setCursor: [u => {
          if (p.quiet) return;
          const { left } = u.cursor;
          if (left >= 0) point(u.posToVal(left, "x"), u); else if (cursor != null) point(null, u);
        }],
      },
    };
    p.u?.destroy();
    p.quiet = true;
    p.joined ??= join(spec.series);
    p.u = new uPlot(options, p.joined, p.host);
    p.quiet = false;
    touch(p.u);
  };

  /** Two fingers zoom, one finger moved sideways points. */
  const touch = u => {
    let start = null;
    const x = (t) => t.clientX - u.over.getBoundingClientRect().left;
    u.over.addEventListener("touchstart", e => {
      start = e.touches.length === 2
        ? { a: u.posToVal(x(e.touches[0]), "x"), b: u.posToVal(x(e.touches[1]), "x") }
        : null;
    }, { passive: true });
    u.over.addEventListener("touchmove", e => {
      const width = u.over.clientWidth;
      if (start && e.touches.length === 2) {
        // The two times stay under the two fingers.
        const [p, q] = [x(e.touches[0]), x(e.touches[1])];
        if (Math.abs(q - p) > 20) {
          const k = (start.b - start.a) / (q - p);
          if (k > 0) setRange(start.a - p * k, start.a + (width - p) * k);
        }
        e.preventDefault();
      } else if (e.touches.length === 1) {
        point(u.posToVal(Math.min(Math.max(x(e.touches[0]), 0), width), "x"), null);
      }
    }, { passive: false });
  };

  // ---- sections --------------------------------------------------------------------------
  const page = document.getElementById("plots");
  page.textContent = "";
  const section = (id, title, entries, single) => {
    const grid = el("div", { class: single ? "grid single" : "grid" });
    const s = el("section", { id }, el("h2", {}, title), legend(entries), grid);
    page.append(s);
    return grid;
  };
  const panel = (grid, title, spec) => {
    if (!spec.series.some(s => s.t.length)) return;
    const out = el("output");
    const host = el("div", { class: "host" });
    grid.append(el("div", { class: spec.first ? "plot first" : "plot" }, el("div", { class: "head" }, el("b", { title }, title), out), host));
    plots.push({ spec, host, out, u: null });
  };

  const truth = q => runs.map(r => r.quantities[q].truth).find(t => !empty(t));
  const states = Object.keys(ill).filter(state => health.some(h => h[2] === state));
  const shaded = (outages.length ? [["shade", "shade", "outage"]] : []).concat(states.map(s => ["block", ill[s], s]));
  const names = runs.map(r => r.name);
  /** The heading that a controller wanted, its turns counted like those of the estimate. */
  const wanted = run => {
    const { t, c: [y] } = run.wanted, q = run.quantities[2].estimate;
    const near = Array.from(y, (v, i) => {
      const k = nearest(q.t, t[i]), own = k < 0 ? v : q.c[2][k];
      return own === own ? v + 360 * Math.round((own - v) / 360) : v;
    });
    // The last one holds to the end.
    return { kind: "step", t: Float64Array.from([...t, span[1]]), y: [...near, near.at(-1)], color: "bad", width: 1.5, label: "wanted" };
  };
  const label = (i, text) => several ? names[i] : text;
  /** Both edges of a band of that half width, about a curve or about 0. */
  const band = (into, run, t, half, center) => {
    if (!half || !half.some(v => v > 0)) return;
    const color = runColor(run);
    into.push({ kind: "edge", upper: true, t, y: center ? plus(center, half, 1) : half, color });
    into.push({ kind: "edge", t, y: center ? plus(center, half, -1) : half.map(v => -v), color });
  };

  // The map, and the parts of it that are enlarged.
  {
    const true_path = runs.map(r => r.true_path).find(t => t.t.length);
    const lines = runs.map((r, i) => ({ ...r.path, name: label(i, "estimate"), color: runColor(i), width: runWidth(i, 2.25) })).filter(l => l.t.length);
    const fixes = new Map();
    for (const s of runs[0]?.sensors ?? []) if (s.used.t.length || s.rejected.t.length) fixes.set(s.name, s);
    if (lines.length || true_path) {
      const entries = [];
      if (true_path) entries.push(["dash", "truth", "truth"]);
      for (const l of lines) entries.push(["line", l.color, l.name]);
      for (const [name, s] of fixes) {
        const of = several ? `${name} (${names[0]})` : name;
        if (s.used.t.length) entries.push(["dot", "fix", `fix of ${of}`]);
        if (s.rejected.t.length) entries.push(["cross", "bad", `rejected fix of ${of}`]);
      }
      entries.push(["ring", "text", "start"], ["square", "text", "end"]);
      const grid = section("trajectory", "Trajectory", entries, true);
      const add = (grid, title, part) => {
        const out = el("output");
        const canvas = el("canvas", { role: "img", "aria-label": `${title}: horizontal trajectory, north over east` });
        const host = el("div", { class: "map" }, canvas);
        grid.append(el("div", { class: "plot" }, el("div", { class: "head" }, el("b", {}, `${title}, north over east [m]`), out), host));
        maps.push(makeMap({ canvas, host, out, part }, true_path, lines, [...fixes.values()]));
      };
      add(grid, "All of it", null);
      const details = el("div", { class: "grid" });
      if (runs[0].details.length) grid.after(details);
      for (const [title, [n, e], size] of runs[0].details) add(details, title, { n, e, h: size, w: size });
    }
  }

  // Time range, buttons.
  if (runs.length) {
    bar.out = el("output", { "aria-label": "time shown" });
    const button = (text, name, act) => { const b = el("button", { type: "button", "aria-label": name, title: name }, text); b.onclick = act; return b; };
    const box = el("div", { id: "bar" }, bar.out,
      button("‹", "earlier", () => move(-0.5)), button("−", "zoom out", () => zoom(2)),
      button("+", "zoom in", () => zoom(0.5)), button("›", "later", () => move(0.5)), button("Reset", "show all", reset));
    page.before(box);
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
    if (reference) entries.push(["dash", "truth", "truth"]);
    runs.forEach((r, i) => { if (!empty(r.quantities[q].estimate)) entries.push(["line", runColor(i), label(i, errors ? "estimate, error" : "estimate")]); });
    entries.push(["band", several ? "soft" : "run0", "±3σ"]);
    // The heading that a controller wanted, beside the one that it had.
    const isSteered = q === 2 && runs[0]?.wanted.t.length > 0;
    if (isSteered) entries.push(["line", "bad", "heading wanted by the controller"]);
    if (fixes.some(s => s.used.t.length)) entries.push(["dot", "fix", "fix"]);
    if (fixes.some(s => s.rejected.t.length)) entries.push(["cross", "bad", "rejected fix"]);
    const grid = section(name.toLowerCase(), errors ? `${name} and its error` : name, entries.concat(shaded), !errors);
    axes.forEach((axis, a) => {
      const series = [], wrong = [];
      painted.forEach(([r, i]) => { const d = r.quantities[q].estimate; if (!empty(d)) band(series, i, d.t, d.c[a + 3], d.c[a]); });
      if (isSteered && a === 2) series.push(wanted(runs[0]));
      for (const s of fixes) series.push({ kind: "dot", t: s.used.t, y: s.used.c[a], color: "fix", size: 1.8, label: fixes.length > 1 ? s.name : "fix" });
      painted.forEach(([r, i]) => {
        const d = r.quantities[q].estimate;
        if (!empty(d)) series.push({ kind: "line", run: i, t: d.t, y: d.c[a], half: d.c[a + 3], color: runColor(i), width: runWidth(i, 1.75), label: label(i, "estimate") });
      });
      if (reference) series.push({ kind: "line", t: reference.t, y: reference.c[a], color: "truth", dash: [6, 4], width: 1.5, label: "truth" });
      for (const s of fixes) series.push({ kind: "cross", t: s.rejected.t, y: s.rejected.c[a], color: "bad", size: 3.5, label: "rejected" });
      panel(grid, `${axis} [${unit}]`, { series, angle: angles[a] });
      if (errors) {
        painted.forEach(([r, i]) => { const d = r.quantities[q].error; if (!empty(d)) band(wrong, i, d.t, d.c[a + 3], null); });
        painted.forEach(([r, i]) => {
          const d = r.quantities[q].error;
          if (!empty(d)) wrong.push({ kind: "line", run: i, t: d.t, y: d.c[a], half: d.c[a + 3], color: runColor(i), width: runWidth(i, 1.25), label: label(i, "error") });
        });
        panel(grid, `${axis} error [${unit}]`, { series: wrong, scale: "error" });
      }
    });
  });

  // How far fixes lie from the estimate, and how regularly measurements come.
  {
    const shown = runs.flatMap((r, i) => r.sensors.map(s => ({ s, i })));
    const names = [...new Set(shown.filter(({ s }) => !empty(s.apart) || s.bars.length).map(({ s }) => s.name))];
    if (names.length) {
      const entries = runs.map((r, i) => ["dot", runColor(i), label(i, "measurement")]);
      if (shown.some(({ s }) => s.rejected.t.length)) entries.push(["cross", several ? "soft" : "bad", "rejected fix"]);
      const grid = section("fixes", "Fixes and intervals", entries.concat(shaded));
      for (const name of names) {
        const own = shown.filter(({ s }) => s.name === name).reverse();
        const dots = (d, k, i, text) => ({ kind: "dot", t: d.t, y: d.c[k], run: i, color: runColor(i), size: 1.5, label: label(i, text) });
        const far = own.filter(({ s }) => !empty(s.apart));
        if (far.length) {
          const series = far.map(({ s, i }) => dots(s.apart, 0, i, "from the estimate"));
          for (const { s, i } of far) series.push({ kind: "cross", t: s.apart.t, y: s.apart.c[1], color: several ? runColor(i) : "bad", size: 3.5, label: several ? "" : "rejected" });
          panel(grid, `${name}: horizontal distance from fix to estimate [m]`, { series, scale: "length", first: true });
        }
        // Runs on the same data share them.
        const { s } = own[own.length - 1];
        if (s.bars.length) {
          panel(grid, `${name}: interval between measurements [s]`, { series: [dots(s.intervals, 0, 0, "interval")], scale: "length", first: true });
          histogram(grid, `${name}: how many intervals are how long`, s.bars);
        }
      }
    }
  }

  // Per sensor: NIS with the gate's line and mode, the innovation of each residual row.
  {
    const sensors = [...new Set(runs.flatMap(r => r.sensors.map(s => s.name)))];
    if (sensors.length) {
      const all = runs.flatMap(r => r.sensors);
      const entries = runs.map((r, i) => ["dot", runColor(i), label(i, "NIS, innovation")]);
      if (!several && all.some(s => s.rows.length)) entries.push(["band", "run0", "±3σ of the innovation"]);
      if (all.some(s => !s.updates.c[1]?.every(v => v !== v))) entries.push(["cross", several ? "soft" : "bad", "rejected"]);
      entries.push(["dash", "soft", "expected mean"]);
      if (all.some(s => s.gated)) entries.push(["gate", "bad", "gate"], ["block", "track", "gate in track"], ["block", "denied", "gate in denial"]);
      const grid = section("innovations", "Innovations and gates", entries.concat(shaded));
      for (const name of sensors) {
        const own = painted.map(([r, i]) => ({ i, s: r.sensors.find(s => s.name === name) })).filter(o => o.s);
        const size = i => 1.6 + 0.4 * Math.min(i, 4);
        const statistic = own.some(o => o.s.own_statistic);
        const strip = [...own].reverse().filter(o => o.s.gated).map(o => ({ t: o.s.updates.t, y: o.s.updates.c[4] }));
        const rejects = (s, i, column) => ({ kind: "cross", t: s.updates.t, y: s.updates.c[column], color: several ? runColor(i) : "bad", size: 3.5, label: several ? "" : "rejected" });
        // Dots that would touch are drawn as the line through them.
        const cloud = (d, k, i, half) => {
          const y = d.c[k], shared = { t: d.t, y, half, run: i, color: runColor(i), label: label(i, "innovation") };
          return y.reduce((n, v) => n + (v === v), 0) > 1500 ? { ...shared, kind: "line", width: runWidth(i, 1) } : { ...shared, kind: "dot", size: size(i) };
        };
        const gate = s => ({ kind: "line", t: s.updates.t, y: s.updates.c[3], color: "bad", dash: [2, 3], width: 1.75, label: "gate" });
        const series = own.map(({ s, i }) => ({ kind: "dot", t: s.updates.t, y: s.updates.c[0], run: i, color: runColor(i), size: size(i), label: label(i, "NIS") }));
        own.forEach(({ s, i }) => series.push(rejects(s, i, 1)));
        const dof = own.map(o => o.s.dof).find(d => d);
        if (dof) series.push({ kind: "line", t: span, y: [dof, dof], color: "soft", dash: [6, 4], width: 1.25 });
        const gated = own.findLast(o => o.s.gated);
        if (gated && !statistic) series.push(gate(gated.s));
        panel(grid, `${name}: NIS`, { series, scale: "nis", strips: strip.length ? strip : null, first: true });
        if (statistic) {
          const series = own.map(({ s, i }) => ({ kind: "dot", t: s.updates.t, y: s.updates.c[2], run: i, color: runColor(i), size: size(i), label: label(i, "statistic") }));
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

  // ---- histograms ------------------------------------------------------------------------
  /** Bars over intervals, both axes logarithmic. */
  function histogram(grid, title, bars) {
    const canvas = el("canvas", { role: "img", "aria-label": title });
    const host = el("div", { class: "map" }, canvas);
    const all = bars.reduce((n, b) => n + b.count, 0);
    const out = el("output");
    grid.append(el("div", { class: "plot" }, el("div", { class: "head" }, el("b", { title }, title), out), host));
    const draw = () => {
      const width = host.clientWidth, f = fontSize();
      if (!(width > 0)) return;
      const height = root.dataset.print ? 140 : phone() ? 200 : 170, px = devicePixelRatio;
      const [left, right, top, bottom] = [f * 4.4, 14, 8, f + 16];
      canvas.width = Math.round(width * px);
      canvas.height = Math.round(height * px);
      canvas.style.height = `${height}px`;
      const ctx = canvas.getContext("2d");
      ctx.scale(px, px);
      ctx.font = font();
      // A bar's width of room on both sides.
      const low = Math.log10(bars[0].from) - 0.05, high = Math.log10(bars.at(-1).to) + 0.05;
      const most = Math.max(...bars.map(b => b.count)), tall = Math.log10(Math.max(most, 1) * 2 / 0.5);
      const X = s => left + (Math.log10(s) - low) / (high - low) * (width - left - right);
      // One of them stands as high as half a decade.
      const Y = n => top + (1 - Math.log10(n / 0.5) / tall) * (height - top - bottom);
      ctx.strokeStyle = color("grid");
      ctx.fillStyle = color("text");
      ctx.lineWidth = 1;
      ctx.beginPath();
      ctx.textAlign = "right";
      ctx.textBaseline = "middle";
      for (let n = 1; n <= most * 2; n *= 10) { ctx.moveTo(left, Y(n)); ctx.lineTo(width - right, Y(n)); ctx.fillText(String(n), left - 6, Y(n)); }
      ctx.textAlign = "center";
      ctx.textBaseline = "top";
      const steps = high - low > 3 ? [1] : high - low > 1.2 ? [1, 2, 5] : [1, 2, 3, 4, 5, 6, 8];
      let free = -Infinity;
      for (let p = Math.floor(low); p <= high; p++) for (const m of steps) {
        const s = m * 10 ** p, text = `${+s.toPrecision(1)}`;
        if (Math.log10(s) < low || Math.log10(s) > high) continue;
        ctx.moveTo(X(s), top);
        ctx.lineTo(X(s), height - bottom);
        const half = ctx.measureText(text).width / 2 + 4;
        if (X(s) - half > free && X(s) + half < width - right - 12) { ctx.fillText(text, X(s), height - bottom + 5); free = X(s) + half; }
      }
      ctx.stroke();
      ctx.textAlign = "right";
      ctx.fillText("s", width - right, height - bottom + 5);
      ctx.fillStyle = color("run0");
      for (const b of bars) if (b.count) ctx.fillRect(X(b.from) + 0.5, Y(b.count), Math.max(X(b.to) - X(b.from) - 1, 1), height - bottom - Y(b.count));
    };
    canvas.addEventListener("mousemove", e => {
      const r = canvas.getBoundingClientRect(), f = fontSize(), left = f * 4.4;
      const low = Math.log10(bars[0].from) - 0.05, high = Math.log10(bars.at(-1).to) + 0.05;
      const s = 10 ** (low + (e.clientX - r.left - left) / (r.width - left - 14) * (high - low));
      const b = bars.find(b => s >= b.from && s < b.to);
      out.value = b ? `${show(b.from)} to ${show(b.to)} s: ${b.count} of ${all}` : "";
    });
    canvas.addEventListener("mouseleave", () => { out.value = ""; });
    histograms.push({ draw });
  }

  // ---- the map ---------------------------------------------------------------------------
  function makeMap({ canvas, host, out, part }, true_path, lines, fixes) {
    const all = lines.concat(true_path ?? []).concat(fixes.flatMap(s => [s.used, s.rejected]));
    let low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    for (const d of all) for (let i = 0; i < d.t.length; i++) for (const k of [0, 1]) {
      const v = d.c[k][i];
      if (v < low[k]) low[k] = v;
      if (v > high[k]) high[k] = v;
    }
    const whole = () => part ? { ...part } : ({ n: (low[0] + high[0]) / 2, e: (low[1] + high[1]) / 2, h: Math.max(high[0] - low[0], 1) * 1.08, w: Math.max(high[1] - low[1], 1) * 1.06 });
    let view = whole(), drag = null, marked = null, box = null;
    const px = devicePixelRatio;
    const layout = () => {
      const width = host.clientWidth, f = fontSize();
      const left = f * 4.4, right = 14, top = 8, bottom = f * 2.9;
      const inner = width - left - right;
      const most = root.dataset.print ? 480 : phone() ? 420 : 560;
      const height = Math.round(Math.min(Math.max(inner * whole().h / whole().w, 220), most) + top + bottom);
      return { width, height, left, right, top, bottom };
    };
    const draw = () => {
      const l = layout();
      if (!(l.width > 0)) return;
      canvas.width = Math.round(l.width * px);
      canvas.height = Math.round(l.height * px);
      canvas.style.height = `${l.height}px`;
      const ctx = canvas.getContext("2d");
      ctx.scale(px, px);
      const iw = l.width - l.left - l.right, ih = l.height - l.top - l.bottom;
      const k = Math.min(iw / view.w, ih / view.h); // pixels per metre, the same for both axes
      const X = e => l.left + iw / 2 + (e - view.e) * k, Y = n => l.top + ih / 2 - (n - view.n) * k;
      box = { X, Y, k, ...l, iw, ih, E: x => view.e + (x - l.left - iw / 2) / k, N: y => view.n - (y - l.top - ih / 2) / k };
      ctx.font = font();
      ctx.fillStyle = color("text");
      ctx.strokeStyle = color("grid");
      ctx.lineWidth = 1;
      const step = pixels => { const raw = pixels / k, p = 10 ** Math.floor(Math.log10(raw)); return [1, 2, 5, 10].map(m => m * p).find(s => s >= raw); };
      const s = step(fontSize() * 4.2), text = v => minus(String(+v.toFixed(6)));
      ctx.beginPath();
      ctx.textAlign = "center";
      ctx.textBaseline = "top";
      const e0 = box.E(l.left), e1 = box.E(l.left + iw), n1 = box.N(l.top), n0 = box.N(l.top + ih);
      for (let i = Math.ceil(e0 / s); i * s <= e1; i++) { const x = X(i * s); ctx.moveTo(x, l.top); ctx.lineTo(x, l.top + ih); ctx.fillText(text(i * s), x, l.top + ih + 5); }
      ctx.textAlign = "right";
      ctx.textBaseline = "middle";
      for (let i = Math.ceil(n0 / s); i * s <= n1; i++) { const y = Y(i * s); ctx.moveTo(l.left, y); ctx.lineTo(l.left + iw, y); ctx.fillText(text(i * s), l.left - 6, y); }
      ctx.stroke();
      ctx.textAlign = "center";
      ctx.textBaseline = "bottom";
      ctx.fillText("East [m]", l.left + iw / 2, l.height - 1);
      ctx.save();
      ctx.translate(fontSize() * 0.75, l.top + ih / 2);
      ctx.rotate(-Math.PI / 2);
      ctx.textBaseline = "middle";
      ctx.fillText("North [m]", 0, 0);
      ctx.restore();
      ctx.strokeStyle = color("rule");
      ctx.strokeRect(l.left, l.top, iw, ih);
      ctx.save();
      ctx.beginPath();
      ctx.rect(l.left, l.top, iw, ih);
      ctx.clip();
      ctx.lineJoin = "round";
      const zoomed = range[0] > span[0] || range[1] < span[1];
      const inRange = t => t >= range[0] && t <= range[1];
      for (const f of fixes) {
        ctx.fillStyle = color("fix");
        for (const now of [false, true]) {
          ctx.globalAlpha = zoomed && !now ? 0.2 : 0.75;
          ctx.beginPath();
          for (let i = 0; i < f.used.t.length; i++) if (inRange(f.used.t[i]) === now) { const x = X(f.used.c[1][i]), y = Y(f.used.c[0][i]); ctx.moveTo(x + 2, y); ctx.arc(x, y, 2, 0, 7); }
          ctx.fill();
        }
      }
      const line = (d, c, width, dash) => {
        ctx.strokeStyle = color(c);
        ctx.setLineDash(dash);
        for (const now of zoomed ? [false, true] : [true]) {
          ctx.globalAlpha = zoomed && !now ? 0.25 : 1;
          ctx.lineWidth = now ? width : 1;
          ctx.beginPath();
          let pen = false;
          for (let i = 0; i < d.t.length; i++) {
            if (zoomed && now && !inRange(d.t[i])) { pen = false; continue; }
            const x = X(d.c[1][i]), y = Y(d.c[0][i]);
            if (pen) ctx.lineTo(x, y); else ctx.moveTo(x, y);
            pen = true;
          }
          ctx.stroke();
        }
        ctx.setLineDash([]);
        ctx.globalAlpha = 1;
      };
      const under = [...lines].reverse();
      for (const d of under) line(d, d.color, d.width, []);
      if (true_path) line(true_path, "truth", 1.5, [6, 4]);
      ctx.strokeStyle = color("bad");
      ctx.lineWidth = 1.75;
      for (const f of fixes) {
        const many = f.rejected.t.length > 400, r = many ? 2.5 : 4;
        ctx.globalAlpha = many ? 0.5 : 1;
        ctx.beginPath();
        for (let i = 0; i < f.rejected.t.length; i++) {
          const x = X(f.rejected.c[1][i]), y = Y(f.rejected.c[0][i]);
          ctx.moveTo(x - r, y - r); ctx.lineTo(x + r, y + r); ctx.moveTo(x + r, y - r); ctx.lineTo(x - r, y + r);
        }
        ctx.stroke();
        ctx.globalAlpha = 1;
      }
      const way = true_path ?? lines[0];
      ctx.strokeStyle = ctx.fillStyle = color("text");
      ctx.lineWidth = 2;
      ctx.beginPath();
      ctx.arc(X(way.c[1][0]), Y(way.c[0][0]), 6, 0, 7);
      ctx.stroke();
      const end = way.t.length - 1;
      ctx.fillRect(X(way.c[1][end]) - 5, Y(way.c[0][end]) - 5, 10, 10);
      if (marked != null) {
        for (const d of (true_path ? [{ ...true_path, color: "truth" }] : []).concat(under)) {
          const i = nearest(d.t, marked);
          if (i < 0) continue;
          ctx.beginPath();
          ctx.arc(X(d.c[1][i]), Y(d.c[0][i]), 5.5, 0, 7);
          ctx.fillStyle = color(d.color);
          ctx.fill();
          ctx.lineWidth = 2;
          ctx.strokeStyle = color("page");
          ctx.stroke();
        }
      }
      if (drag?.to) {
        ctx.fillStyle = color("shade");
        ctx.fillRect(drag.from[0], drag.from[1], drag.to[0] - drag.from[0], drag.to[1] - drag.from[1]);
      }
      ctx.restore();
    };
    let waits = false;
    const redraw = () => { if (!waits) { waits = true; requestAnimationFrame(() => { waits = false; draw(); }); } };
    const at = e => { const r = canvas.getBoundingClientRect(); return [e.clientX - r.left, e.clientY - r.top]; };
    canvas.addEventListener("mousedown", e => { drag = { from: at(e) }; e.preventDefault(); });
    canvas.addEventListener("mousemove", e => {
      const [x, y] = at(e);
      if (drag) { drag.to = [x, y]; redraw(); return; }
      if (!box) return;
      const n = box.N(y), east = box.E(x);
      // The nearest moment of the first path, if the pointer is on it.
      const d = lines[0] ?? true_path;
      let best = -1, distance = (25 / box.k) ** 2;
      for (let i = 0; i < d.t.length; i++) {
        const q = (d.c[0][i] - n) ** 2 + (d.c[1][i] - east) ** 2;
        if (q < distance && d.t[i] >= range[0] && d.t[i] <= range[1]) { distance = q; best = i; }
      }
      point(best < 0 ? null : d.t[best], null);
      out.value = `north ${show(n)}   east ${show(east)}${best < 0 ? "" : `   ${show(d.t[best])} s`}`;
    });
    canvas.addEventListener("mouseleave", () => { out.value = ""; if (!drag) point(null, null); });
    addEventListener("mouseup", () => {
      const d = drag;
      drag = null;
      if (!d?.to || !box) return;
      const w = Math.abs(d.to[0] - d.from[0]), h = Math.abs(d.to[1] - d.from[1]);
      if (w > 8 && h > 8) view = { e: box.E((d.to[0] + d.from[0]) / 2), n: box.N((d.to[1] + d.from[1]) / 2), w: w / box.k, h: h / box.k };
      redraw();
    });
    canvas.addEventListener("dblclick", reset);
    return { draw, reset: () => { view = whole(); redraw(); }, mark: t => { if (t !== marked) { marked = t; redraw(); } } };
  }

  // ---- drawing, resizing, printing -------------------------------------------------------
  const drawAll = () => {
    style = getComputedStyle(root);
    for (const p of plots) build(p, p.host.clientWidth);
    for (const drawn of [...maps, ...histograms]) drawn.draw();
    report();
    root.dataset.drawn = String(plots.length + maps.length + histograms.length);
  };
  style = getComputedStyle(root);
  drawAll();
  let width = innerWidth;
  addEventListener("resize", () => {
    if (innerWidth === width || root.dataset.print) return;
    width = innerWidth;
    drawAll();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (!root.dataset.print) drawAll(); });
  addEventListener("beforeprint", () => { root.dataset.print = "1"; point(null, null); drawAll(); });
  addEventListener("afterprint", () => { delete root.dataset.print; drawAll(); });

  // `#check` counts what was left blank, zooms, points and resets, for a test.
  if (location.hash === "#check") setTimeout(() => {
    const blank = [...document.querySelectorAll("canvas")].filter(c => {
      const pixels = new Uint32Array(c.getContext("2d").getImageData(0, 0, c.width, c.height).data.buffer);
      return new Set(pixels).size < 4;
    });
    root.dataset.blank = String(blank.length);
    root.dataset.canvases = String(document.querySelectorAll("canvas").length);
    root.dataset.scales = plots.filter(p => p.spec.series.some(s => s.clamped)).map(p => +p.u.scales.y.max.toFixed(6)).join(" ");
    const middle = (span[0] + span[1]) / 2;
    setRange(middle, middle + (span[1] - span[0]) / 10);
    point(middle + (span[1] - span[0]) / 20, null);
    setTimeout(() => {
      root.dataset.linked = String(plots.filter(p => Math.abs(p.u.scales.x.min - range[0]) < 1e-6 && p.out.value).length);
      plots[0]?.u.over.dispatchEvent(new MouseEvent("dblclick", { bubbles: true }));
      setTimeout(() => {
        root.dataset.reset = String(plots.filter(p => p.u.scales.x.max === span[1]).length);
        root.dataset.overflow = String(Math.max(0, document.documentElement.scrollWidth - innerWidth));
        root.dataset.checked = "1";
      }, 50);
    }, 50);
  }, 50);
})();
