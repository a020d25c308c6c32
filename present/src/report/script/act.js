"use strict";
// The bar with contents and range of time, the keys, and when what is drawn.

// ---- bar and contents ------------------------------------------------------------------
if (plots.length || maps.length) {
  const button = (text, name, act) => { const b = el("button", { type: "button", "aria-label": name, title: name }, text); b.onclick = act; return b; };
  const links = [...document.querySelectorAll("main section[id]")].map(s => el("a", { href: `#${s.id}` }, s.querySelector("h2").textContent));
  const buttons = [
    button("‹", "earlier", () => move(-0.5)), button("−", "zoom out", () => zoom(2)),
    button("+", "zoom in", () => zoom(0.5)), button("›", "later", () => move(0.5)), button("Reset", "show all", reset),
  ];
  bar.out = el("output", { "aria-label": "time shown" });
  document.querySelector("main").prepend(el("div", { id: "bar" }, el("nav", { id: "contents", "aria-label": "contents" }, ...links), bar.out, ...buttons));
  document.body.append(tip);
}

// ---- keys ------------------------------------------------------------------------------
/** To the next sample of the first plot in sight, or a two-hundredth of what is shown where samples are denser. */
const step = way => {
  const first = timed()[0];
  if (!first) return;
  const width = range[1] - range[0], least = width / 200, at = cursor ?? (way > 0 ? range[0] : range[1]);
  const ts = first.joined[0], i = nearest(ts, at) + way;
  const next = cursor != null && i >= 0 && i < ts.length && Math.abs(ts[i] - at) > least ? ts[i] : at + way * least;
  const t = Math.min(Math.max(next, span[0]), span[1]);
  if (t < range[0] || t > range[1]) setRange(t - width / 2, t + width / 2);
  point(t, null);
};
addEventListener("keydown", e => {
  if (e.ctrlKey || e.altKey || e.metaKey || e.target.closest?.("input, textarea, select")) return;
  const act = {
    ArrowLeft: () => e.shiftKey ? move(-0.25) : step(-1), ArrowRight: () => e.shiftKey ? move(0.25) : step(1),
    "+": () => zoom(0.5), "-": () => zoom(2), 0: reset, Escape: () => { tell(null); point(null, null); },
  }[e.key];
  if (!act) return;
  act();
  e.preventDefault();
});

// ---- drawing, resizing, printing -------------------------------------------------------
/** Draws what is not drawn yet of `some` plots. */
const drawNow = some => { for (const p of some) if (!p.u) build(p, p.host.clientWidth); };
const near = new IntersectionObserver(seen => {
  const hosts = new Set(seen.filter(s => s.isIntersecting).map(s => s.target));
  const due = plots.filter(p => hosts.has(p.host) && !p.u);
  drawNow(due);
  if (cursor != null && due.length) point(cursor, null);
  count();
}, { rootMargin: "600px" });
const count = () => { root.dataset.drawn = String(plots.filter(p => p.u).length + maps.length); };
const drawAll = () => {
  style = getComputedStyle(root);
  for (const p of plots) {
    p.u?.destroy();
    p.u = null;
    // Its place on the page is that of the plot to come.
    p.host.style.minHeight = `${plotHeight(p.spec)}px`;
    near.unobserve(p.host);
    near.observe(p.host);
  }
  for (const m of maps) m.draw();
  report();
  count();
};
drawAll();
let width = innerWidth;
addEventListener("resize", () => {
  if (innerWidth === width || root.dataset.print) return;
  width = innerWidth;
  drawAll();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (!root.dataset.print) drawAll(); });
addEventListener("beforeprint", () => { root.dataset.print = "1"; tell(null); point(null, null); drawAll(); drawNow(plots); });
addEventListener("afterprint", () => { delete root.dataset.print; drawAll(); });
root.dataset.ready = String(Math.round(performance.now()));
