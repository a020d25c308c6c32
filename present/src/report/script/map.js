"use strict";
// The map: the path over north and east. Dragging zooms to an area, with Shift it pans, Ctrl and the wheel zoom about
// the pointer; the cursor of the time plots marks the place, and the pointer on the path the time.
function makeMap({ canvas, host, out, part, follow, title, hidden }, true_path, lines, fixes, asked) {
  const [low, high] = data.extent;
  const whole = () => part ? { ...part } : ({ n: (low[0] + high[0]) / 2, e: (low[1] + high[1]) / 2, h: Math.max(high[0] - low[0], 1) * 1.08, w: Math.max(high[1] - low[1], 1) * 1.06 });
  /** Where the path `d` is at time t, on the line between two of its points. */
  const place = (d, t) => {
    let i = d.t.findIndex(u => u >= t);
    if (i < 0) i = d.t.length - 1;
    if (i === 0 || d.t[i] <= t) return d.c.map(c => c[i]);
    const share = (t - d.t[i - 1]) / (d.t[i] - d.t[i - 1]);
    return d.c.map(c => c[i - 1] + share * (c[i] - c[i - 1]));
  };
  const isWithin = (d, t) => d.t.length > 0 && t >= d.t[0] && t <= d.t.at(-1);
  let view = whole(), drag = null, marked = null, box = null, follows = false;
  const shows = group => !hidden.has(group);
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
    const dots = (d, c) => {
      ctx.fillStyle = color(c);
      for (const now of [false, true]) {
        ctx.globalAlpha = zoomed && !now ? 0.2 : 0.75;
        ctx.beginPath();
        for (let i = 0; i < d.t.length; i++) if (inRange(d.t[i]) === now) { const x = X(d.c[1][i]), y = Y(d.c[0][i]); ctx.moveTo(x + 2, y); ctx.arc(x, y, 2, 0, 7); }
        ctx.fill();
      }
      ctx.globalAlpha = 1;
    };
    for (const f of fixes) if (shows(`fix ${f.name}`)) dots(f.used, "fix");
    const line = (d, c, width, dash) => {
      ctx.strokeStyle = color(c);
      ctx.setLineDash(dash);
      for (const now of zoomed ? [false, true] : [true]) {
        ctx.globalAlpha = zoomed && !now ? 0.25 : 1;
        ctx.lineWidth = now ? width : 1;
        ctx.beginPath();
        const put = (n, e) => ctx.lineTo(X(e), Y(n));
        const part = zoomed && now;
        if (part && isWithin(d, range[0])) put(...place(d, range[0]));
        for (let i = 0; i < d.t.length; i++) if (!part || inRange(d.t[i])) put(d.c[0][i], d.c[1][i]);
        if (part && isWithin(d, range[1])) put(...place(d, range[1]));
        ctx.stroke();
      }
      ctx.setLineDash([]);
      ctx.globalAlpha = 1;
    };
    if (shows("asked")) {
      ctx.strokeStyle = color("bad");
      ctx.lineWidth = 2;
      ctx.setLineDash([2, 3]);
      ctx.beginPath();
      for (const [[n0, e0], [n1, e1]] of asked) { ctx.moveTo(X(e0), Y(n0)); ctx.lineTo(X(e1), Y(n1)); }
      ctx.stroke();
      ctx.setLineDash([]);
    }
    const under = lines.filter(d => shows(d.group)).reverse();
    for (const d of under) line(d, d.color, d.width, []);
    const reference = true_path && shows("truth") ? true_path : null;
    if (reference && withheld) dots(reference, "truth");
    else if (reference) line(reference, "truth", 1.5, [6, 4]);
    ctx.strokeStyle = color("bad");
    ctx.lineWidth = 1.75;
    for (const f of fixes) {
      if (!shows(`rejected ${f.name}`)) continue;
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
      for (const d of (reference ? [{ ...reference, color: "truth" }] : []).concat(under)) {
        if (!d.t.length) continue;
        const [n, e] = place(d, marked);
        ctx.beginPath();
        ctx.arc(X(e), Y(n), 5.5, 0, 7);
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
  const zoomed = (k, e, n) => {
    view = { e: e + (view.e - e) * k, n: n + (view.n - n) * k, w: view.w * k, h: view.h * k };
    redraw();
  };
  const pan = (right, up) => { view = { ...view, e: view.e + right, n: view.n + up }; redraw(); };
  /** The nearest moment of the first path, if the pointer is on it. */
  const moment = (n, east) => {
    const d = lines[0] ?? true_path;
    let best = null, distance = (25 / box.k) ** 2;
    for (let i = 1; i < d.t.length; i++) {
      const dn = d.c[0][i] - d.c[0][i - 1], de = d.c[1][i] - d.c[1][i - 1], square = dn * dn + de * de;
      const along = square > 0 ? ((n - d.c[0][i - 1]) * dn + (east - d.c[1][i - 1]) * de) / square : 0;
      const [from, to] = [0, 1].map(k => (range[k] - d.t[i - 1]) / (d.t[i] - d.t[i - 1]));
      if (from > 1 || to < 0) continue;
      const share = Math.min(Math.max(along, 0, from), 1, to);
      const q = (d.c[0][i - 1] + share * dn - n) ** 2 + (d.c[1][i - 1] + share * de - east) ** 2;
      if (q < distance) { distance = q; best = d.t[i - 1] + share * (d.t[i] - d.t[i - 1]); }
    }
    return best;
  };
  const describe = (n, east, t) => {
    const lines_ = [title, `north ${show(n)} m   east ${show(east)} m`];
    if (t == null) return lines_;
    lines_.push([`${show(t)} s`, healthAt(t), ...faultsAt(t)].filter(Boolean).join("   "));
    const named = lines.map(l => [l.name, l]).concat(true_path ? [[trueName, true_path]] : []);
    for (const [name, d] of named) {
      if (!d.t.length) continue;
      const [n, e] = place(d, t);
      lines_.push(`${name}: north ${show(n)}   east ${show(e)}`);
    }
    return lines_;
  };
  canvas.addEventListener("mousedown", e => { drag = { from: at(e), last: at(e), pans: e.shiftKey || e.button === 1 }; canvas.focus({ preventScroll: true }); e.preventDefault(); });
  canvas.addEventListener("mousemove", e => {
    const [x, y] = at(e);
    if (!box) return;
    if (drag?.pans) {
      pan((drag.last[0] - x) / box.k, (y - drag.last[1]) / box.k);
      drag.last = [x, y];
      return;
    }
    if (drag) { drag.to = [x, y]; redraw(); return; }
    const n = box.N(y), east = box.E(x), t = moment(n, east);
    point(t, null);
    const text = describe(n, east, t);
    out.value = text.slice(1, 3).join("   ");
    tell(text, e.clientX, e.clientY);
  });
  canvas.addEventListener("mouseleave", () => { out.value = ""; tell(null); if (!drag) point(null, null); });
  addEventListener("mouseup", () => {
    const d = drag;
    drag = null;
    if (!d?.to || !box) return;
    const w = Math.abs(d.to[0] - d.from[0]), h = Math.abs(d.to[1] - d.from[1]);
    if (w > 8 && h > 8) view = { e: box.E((d.to[0] + d.from[0]) / 2), n: box.N((d.to[1] + d.from[1]) / 2), w: w / box.k, h: h / box.k };
    redraw();
  });
  canvas.addEventListener("wheel", e => {
    if (!e.ctrlKey || !box) return;
    e.preventDefault();
    const [x, y] = at(e);
    zoomed(Math.exp(e.deltaY * (e.deltaMode ? 0.05 : 0.0015)), box.E(x), box.N(y));
  }, { passive: false });
  canvas.addEventListener("keydown", e => {
    if (e.ctrlKey || e.altKey || e.metaKey || !box) return;
    const step = 0.1 * Math.min(box.iw, box.ih) / box.k;
    const act = {
      ArrowLeft: () => pan(-step, 0), ArrowRight: () => pan(step, 0), ArrowUp: () => pan(0, step), ArrowDown: () => pan(0, -step),
      "+": () => zoomed(0.8, view.e, view.n), "-": () => zoomed(1.25, view.e, view.n),
    }[e.key];
    if (!act) return;
    act();
    e.preventDefault();
    e.stopPropagation();
  });
  canvas.addEventListener("dblclick", reset);
  const center = () => {
    const d = lines[0] ?? true_path;
    if (!follows || marked == null || !d.t.length) return;
    const [n, e] = place(d, marked);
    view = { ...view, n, e };
  };
  follow.onclick = () => {
    follows = !follows;
    follow.setAttribute("aria-pressed", String(follows));
    // All of the path cannot be followed: a quarter of it is shown.
    if (follows && view.w === whole().w) view = { ...view, w: view.w / 4, h: view.h / 4 };
    center();
    redraw();
  };
  return {
    draw,
    reset: () => { view = whole(); redraw(); },
    mark: t => {
      if (t === marked) return;
      marked = t;
      // The place under the pointer must not move away from it.
      if (!canvas.matches(":hover")) center();
      redraw();
    },
    canvas,
    state: () => ({ ...view, marked }),
    /** Where a place is on the canvas, and pixels per metre. */
    place: (n, e) => [box.X(e), box.Y(n)],
    scale: () => box.k,
  };
}
