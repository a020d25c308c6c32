"use strict";
// What every page begins with: its data, and how numbers, colours and keys of plots look. The scripts of a page share
// their names.

const root = document.documentElement;
const data = JSON.parse(document.getElementById("data").textContent);
const runs = data.runs ?? [];
const several = runs.length > 1;

// ---- data ------------------------------------------------------------------------------
// Times count from the log's beginning where they are those of a calendar.
const zero = data.span[0] > 1e6 || data.span[0] < 0 ? Math.floor(data.span[0]) : 0;
const span = data.span.map(t => t - zero);
if (!(span[1] > span[0])) span[1] = span[0] + 1;
const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
const table = d => {
  const t = new Float64Array(bytes(d.t)).map(t => t - zero);
  return { t, c: d.c.map(c => new Float32Array(bytes(c))) };
};
const empty = d => d.t.length === 0 || !d.c.some(c => c.some(v => v === v));
const plus = (a, b, k) => a.map((v, i) => v + k * b[i]);
/** Index of the sample nearest to time t. */
const nearest = (ts, t) => {
  let a = 0, b = ts.length - 1;
  if (b < 0) return -1;
  while (b - a > 1) { const m = (a + b) >> 1; if (ts[m] < t) a = m; else b = m; }
  return t - ts[a] <= ts[b] - t ? a : b;
};
const outages = runs[0] ? runs[0].outages.map(w => w.map(t => t - zero)) : [];
/** From, to and name of each declared fault. */
const faults = runs[0] ? runs[0].faults.map(([a, b, name]) => [a - zero, b - zero, name]) : [];
const faultsAt = t => faults.filter(f => t >= f[0] && t <= f[1]).map(f => `fault ${f[2]}`);
/** Colours of health, from good to bad. */
const states = { good: "track", aligning: "soft", coasting: "run3", degraded: "denied", lost: "bad" };
const health = runs[0] ? runs[0].health.map(([a, b, state]) => [a - zero, b - zero, state]) : [];
const healthAt = t => health.find(h => t >= h[0] && t <= h[1])?.[2];

// ---- looks -----------------------------------------------------------------------------
let style = getComputedStyle(root);
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
/** An angle within a turn: a heading from 0° to 360°, any other one within ±180°. */
const within = (v, kind) => { const w = ((v % 360) + 360) % 360; return w > 180 && kind !== "heading" ? w - 360 : w; };
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
/**
 * The key of a section's plots: [mark, colour, text, group]. An entry with a group is a button that hides the curves of
 * that group; `changed` hears of it.
 */
const legend = (entries, hidden, changed) => {
  const list = el("ul", { class: "legend" });
  for (const [kind, name, text, group] of entries) {
    if (group == null) { list.append(el("li", {}, swatch(kind, name), text)); continue; }
    const button = el("button", { type: "button", "aria-pressed": "true", title: "show or hide", "data-group": group }, swatch(kind, name), text);
    button.onclick = () => {
      const shown = hidden.delete(group);
      if (!shown) hidden.add(group);
      button.setAttribute("aria-pressed", String(shown));
      changed();
    };
    list.append(el("li", {}, button));
  }
  return list;
};
