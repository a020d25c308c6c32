"use strict";
// Time plots by uPlot: one range of time for all of them, one cursor, each its own height.

// ---- range and cursor ------------------------------------------------------------------
// Each is { spec, host, out, u, low, high }: u while it is drawn, low and high where its height is zoomed. A spec with
// `own` has an axis of its own in place of time: { min, max, unit }.
const plots = [];
const maps = [];
let range = [...span];
const bar = {};

/** The plots over time that are drawn. */
const timed = () => plots.filter(p => p.u && !p.spec.own);
const setRange = (a, b) => {
  const least = Math.max((span[1] - span[0]) * 1e-5, 1e-3);
  if (b - a < least) { const m = (a + b) / 2; a = m - least / 2; b = m + least / 2; }
  const width = Math.min(b - a, span[1] - span[0]);
  a = Math.min(Math.max(a, span[0]), span[1] - width);
  range = [a, a + width];
  for (const p of timed()) p.u.setScale("x", { min: range[0], max: range[1] });
  for (const m of maps) m.draw();
  report();
};
const reset = () => {
  for (const m of maps) m.reset();
  for (const p of plots) {
    p.low = p.high = undefined;
    if (p.u && p.spec.own) p.u.redraw(true, true);
  }
  setRange(span[0], span[1]);
};
const zoom = k => { const m = (range[0] + range[1]) / 2, h = (range[1] - range[0]) / 2 * k; setRange(m - h, m + h); };
const move = k => { const w = (range[1] - range[0]) * k; setRange(range[0] + w, range[1] + w); };
const instant = t => minus(t.toFixed(range[1] - range[0] > 50 ? 0 : range[1] - range[0] > 2 ? 1 : 3));
const report = () => { if (bar.out) bar.out.value = `${instant(range[0])} – ${instant(range[1])} s`; };

/** Puts the cursor of every plot and of the map at time t; null takes it away. */
let cursor = null;
const point = (t, from) => {
  cursor = t;
  for (const p of timed()) {
    if (p.u !== from) p.u.setCursor(t == null ? { left: -10, top: -10 } : { left: p.u.valToPos(t, "x"), top: 10 }, false);
    p.out.value = t == null ? "" : `${show(t)} s   ${read(p.spec, t).join("   ")}`;
  }
  for (const m of maps) m.mark(t);
};
/** What a plot shows at t, a text per curve. */
const read = (spec, t) => spec.series.filter(s => s.label && !isHidden(spec, s)).sort((a, b) => (a.run ?? 0) - (b.run ?? 0)).map(s => {
  let i = nearest(s.t, t);
  // A step lasts until the next.
  if (s.kind === "step" && i > 0 && s.t[i] > t) i--;
  if (i < 0 || Math.abs(s.t[i] - t) > (spec.own ? Infinity : Math.max((range[1] - range[0]) / 50, 1.5))) return null;
  if (s.y[i] !== s.y[i]) return null;
  const v = spec.angle ? within(s.y[i], spec.angle) : s.y[i];
  return `${s.label} ${show(v)}${s.half ? ` ± ${show(s.half[i])}` : ""}`;
}).filter(Boolean);

/** All of it beside the pointer: the line above a plot may be too short. */
const tip = el("div", { id: "tip", role: "tooltip" });
tip.hidden = true;
const tell = (lines, x, y) => {
  tip.hidden = !lines;
  if (!lines) return;
  tip.replaceChildren(...lines.map(line => el("div", {}, line)));
  const { offsetWidth: w, offsetHeight: h } = tip;
  tip.style.left = `${x + 18 + w > innerWidth ? Math.max(x - 18 - w, 4) : x + 18}px`;
  tip.style.top = `${y + 18 + h > innerHeight ? Math.max(y - 18 - h, 4) : y + 18}px`;
};
const hover = (p, u) => {
  const { left, top } = u.cursor;
  if (!(left >= 0)) { tell(null); return; }
  const x = u.posToVal(left, "x"), box = u.over.getBoundingClientRect();
  const of = p.spec.own ? `${show(p.spec.own.shown ? p.spec.own.shown(x) : x)} ${p.spec.own.unit}` : [`${show(x)} s`, healthAt(x), ...faultsAt(x)].filter(Boolean).join("   ");
  if (p.spec.own) p.out.value = [of, ...read(p.spec, x)].join("   ");
  tell([p.spec.title, of, ...read(p.spec, x)], box.left + left, box.top + top);
};

/** Whether the key of the section hides a curve. */
const isHidden = (spec, s) => spec.hidden != null && s.groups != null && s.groups.some(group => spec.hidden.has(group));

// ---- drawing ---------------------------------------------------------------------------
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
    if (s.kind === "edge" || s.clamped || isHidden(spec, s)) continue;
    const [from, to] = spec.own ? [spec.own.min, spec.own.max] : range;
    let i = nearest(s.t, from), end = nearest(s.t, to);
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
const rangeY = p => () => {
  if (p.low != null) return [p.low, p.high];
  const { spec } = p;
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
  const [a, b] = [u.scales.x.min, u.scales.x.max];
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
/** Outages in grey behind the curves. */
const shades = u => clip(u, ctx => {
  ctx.fillStyle = color("shade");
  for (const [a, b] of outages) {
    const x = u.valToPos(a, "x", true);
    ctx.fillRect(x, u.bbox.top, u.valToPos(b, "x", true) - x, u.bbox.height);
  }
});
/** When declared faults were at work, as bars along the top. */
const faultBars = u => {
  const { ctx, bbox } = u, px = uPlot.pxRatio;
  ctx.fillStyle = color("fault");
  for (const [a, b] of faults) {
    const from = Math.max(u.valToPos(a, "x", true), bbox.left), to = Math.min(u.valToPos(b, "x", true), bbox.left + bbox.width);
    if (to >= bbox.left && from <= bbox.left + bbox.width) ctx.fillRect(from, bbox.top, Math.max(to - from, 2 * px), 5 * px);
  }
};
/** The health of the filter as a strip along the axis of time. */
const healthStrip = u => {
  const { ctx, bbox } = u, px = uPlot.pxRatio, worst = Object.keys(states);
  for (const [a, b, state] of health) {
    const from = Math.max(u.valToPos(a, "x", true), bbox.left), to = Math.min(u.valToPos(b, "x", true), bbox.left + bbox.width);
    if (to < bbox.left || from > bbox.left + bbox.width) continue;
    ctx.fillStyle = color(states[state]);
    // The worse stands out by height too, not by colour alone.
    ctx.fillRect(from, bbox.top + bbox.height, Math.max(to - from, px), (2 + 1.5 * worst.indexOf(state)) * px);
  }
};
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
const plotHeight = spec => spec.height ?? (root.dataset.print ? 140 : phone() ? 200 : 170);
const build = (p, width) => {
  const { spec } = p;
  const ink = color("text"), grid = { stroke: color("grid"), width: 1 };
  for (const s of spec.series) s.stroke = color(s.color);
  const options = {
    width,
    height: plotHeight(spec),
    padding: [spec.strips ? spec.strips.length * 13 + 6 : 8, 14, 0, 0],
    legend: { show: false },
    cursor: {
      y: false,
      points: { show: false },
      drag: { x: true, y: false, setScale: false },
      bind: { dblclick: () => () => { reset(); return null; } },
    },
    scales: {
      x: { time: false, range: () => spec.own ? [spec.own.min, spec.own.max] : [...range] },
      y: { range: rangeY(p), ...(spec.scale === "nis" ? { distr: 4, asinh: 1 } : {}) },
    },
    axes: [
      { font: font(), stroke: ink, grid, ticks: grid, size: fontSize() + 16, gap: 3, space: fontSize() * 6,
        values: (u, vs) => vs.map((v, i) => v == null ? "" : `${minus(String(spec.own?.shown ? +spec.own.shown(v).toPrecision(2) : +v.toFixed(6)))}${i === vs.length - 1 ? ` ${spec.own ? spec.own.unit : "s"}` : ""}`) },
      { font: font(), stroke: ink, grid, ticks: grid, size: fontSize() * 4.4, gap: 3, space: fontSize() * (spec.angle ? 1.5 : 2.2),
        ...(spec.scale === "nis" ? { splits: nisSplits, values: (u, vs) => vs.map(v => String(v)), filter: (u, vs) => vs } : spec.angle ? { incrs: angleIncrements, values: (u, vs) => vs.map(v => minus(String(+(vs[1] - vs[0] < 360 ? within(v, spec.angle) : v).toFixed(3)))) }
          : { values: (u, vs) => vs.map(v => v == null ? "" : minus(Math.abs(v) >= 1e6 || (v !== 0 && Math.abs(v) < 1e-4) ? v.toExponential(0) : String(+v.toFixed(5)))) }) },
    ],
    series: [{}, ...spec.series.map(s => {
      const shared = { show: !isHidden(spec, s), spanGaps: false, points: { show: false } };
      if (s.kind === "dot" || s.kind === "cross") return { ...shared, paths: () => null };
      if (s.kind === "edge") return { ...shared, stroke: faint(s.stroke, several ? 0.75 : 0.5), width: 1 };
      if (s.kind === "step") shared.paths = uPlot.paths.stepped({ align: 1 });
      return { ...shared, stroke: s.stroke, width: s.width ?? 1.75, dash: s.dash };
    })],
    bands: spec.series.flatMap((s, i) => s.kind === "edge" && s.upper ? [{ series: [i + 1, i + 2], fill: faint(s.stroke, several ? 0.04 : 0.16) }] : []),
    hooks: {
      drawClear: spec.own ? [] : [shades],
      drawAxes: [u => { for (const s of spec.series) if (s.kind === "dot" && !isHidden(spec, s)) marks(u, s); }],
      draw: [u => {
        for (const s of spec.series) if (s.kind === "cross" && !isHidden(spec, s)) marks(u, s);
        if (!spec.own) { faultBars(u); healthStrip(u); }
        if (spec.strips) strips(u, spec);
      }],
      setSelect: [u => {
        const { left, top, width, height } = u.select;
        if (p.area && height > 4) [p.low, p.high] = [u.posToVal(top + height, "y"), u.posToVal(top, "y")];
        if (width > 4 && !spec.own) setRange(u.posToVal(left, "x"), u.posToVal(left + width, "x"));
        else if (p.area) u.redraw(true, true);
        u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
      }],
      setCursor: [u => {
        if (p.quiet) return;
        const { left } = u.cursor;
        if (left >= 0 && !spec.own) point(u.posToVal(left, "x"), u); else if (cursor != null) point(null, u);
        hover(p, u);
      }],
    },
  };
  p.u?.destroy();
  p.quiet = true;
  p.area = false;
  p.joined ??= join(spec.series);
  p.u = new uPlot(options, p.joined, p.host);
  p.quiet = false;
  touch(p.u);
  wheel(p);
};

/** With Ctrl the wheel zooms time about the pointer, with Shift the height; dragging with Shift zooms to an area. */
const wheel = p => {
  const { u } = p;
  u.over.addEventListener("wheel", e => {
    if (!e.ctrlKey && !e.shiftKey) return;
    e.preventDefault();
    const box = u.over.getBoundingClientRect();
    const k = Math.exp((e.deltaY || e.deltaX) * (e.deltaMode ? 0.05 : 0.0015));
    if (e.ctrlKey) {
      if (p.spec.own) return;
      const t = u.posToVal(e.clientX - box.left, "x");
      setRange(t - (t - range[0]) * k, t + (range[1] - t) * k);
    } else {
      const at = e.clientY - box.top, high = u.posToVal(at * (1 - k), "y"), low = u.posToVal(at + (box.height - at) * k, "y");
      if (!(high > low)) return;
      [p.low, p.high] = [low, high];
      u.redraw(true, true);
    }
  }, { passive: false });
  u.over.addEventListener("mousedown", e => { p.area = u.cursor.drag.y = e.shiftKey; }, { capture: true });
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
