"use strict";
// Sections of plots, each with its key, drawn when they come near the window.

const page = document.getElementById("plots");
page.textContent = "";
const section = (id, title, entries, single) => {
  const grid = el("div", { class: single ? "grid single" : "grid" });
  grid.hiddenGroups = new Set();
  grid.id = `${id}-plots`;
  const redraw = () => {
    for (const p of plots) if (p.u && p.spec.hidden === grid.hiddenGroups) {
      p.u.batch(() => p.spec.series.forEach((s, i) => p.u.setSeries(i + 1, { show: !isHidden(p.spec, s) })));
      p.u.redraw(true, true);
    }
    for (const m of maps) m.draw();
  };
  page.append(el("section", { id }, el("h2", {}, title), legend(entries, grid.hiddenGroups, redraw), grid));
  return grid;
};
const panel = (grid, title, spec) => {
  if (!spec.series.some(s => s.t.length)) return;
  Object.assign(spec, { title, hidden: grid.hiddenGroups });
  const out = el("output");
  const host = el("div", { class: "host" });
  grid.append(el("div", { class: spec.first ? "plot first" : "plot" }, el("div", { class: "head" }, el("b", { title }, title), out), host));
  plots.push({ spec, host, out, u: null });
};
/** Curves of an axis of their own, in place of time. */
const ownAxis = (grid, title, own, series, more = {}) => panel(grid, title, { series, own, ...more });

const runColor = i => `run${i % 6}`;
// The first run lies on top; where runs coincide, the later ones look out from under it.
const painted = runs.map((r, i) => [r, i]).reverse();
const runWidth = (i, least) => least + Math.min(i, 4) * 0.4;
/** Curves and bands of the runs hide with the run, bands also by themselves. */
const ofRun = (i, ...more) => [`run${i}`, ...more];
