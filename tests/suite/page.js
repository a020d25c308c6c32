"use strict";
// Added to a copy of report.html by page.rs: uses the page as a reader does, by mouse and keys, and writes into the root
// element how many checks there were and which failed.
(async () => {
  const failures = [];
  let checks = 0;
  const check = (name, holds, seen) => {
    checks++;
    if (!holds) failures.push(`${name} (${seen})`);
  };
  const near = (a, b, by) => Math.abs(a - b) <= by;
  const wait = () => new Promise(done => setTimeout(done, 120));
  /** An event at a point of the window, on whatever lies there. */
  const mouse = (type, x, y, more = {}) => {
    const Kind = type === "wheel" ? WheelEvent : MouseEvent;
    document.elementFromPoint(x, y)?.dispatchEvent(new Kind(type, { bubbles: true, cancelable: true, clientX: x, clientY: y, movementX: 1, movementY: 1, view: window, ...more }));
  };
  const click = element => {
    const box = element.getBoundingClientRect();
    mouse("click", box.left + box.width / 2, box.top + box.height / 2);
  };
  const drag = (a, b, more) => {
    mouse("mousemove", ...a, more);
    mouse("mousedown", ...a, more);
    mouse("mousemove", (a[0] + b[0]) / 2, (a[1] + b[1]) / 2, { ...more, buttons: 1 });
    mouse("mousemove", ...b, { ...more, buttons: 1 });
    mouse("mouseup", ...b, more);
  };
  const key = (name, more = {}) => document.body.dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true, cancelable: true, ...more }));
  /** Pixels of a canvas in a colour of the page. */
  const inked = (canvas, name) => {
    const wanted = [1, 3, 5].map(i => parseInt(color(name).slice(i, i + 2), 16));
    const { data: pixels } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let count = 0;
    for (let i = 0; i < pixels.length; i += 4) if (wanted.every((c, k) => near(pixels[i + k], c, 8))) count++;
    return count;
  };
  const bring = async element => { element.scrollIntoView({ block: "center" }); await wait(); };
  const over = p => p.u.over.getBoundingClientRect();
  const scales = p => [p.u.scales.x.min, p.u.scales.x.max, p.u.scales.y.min, p.u.scales.y.max];

  try {
    // Virtual time outruns the frames in which a browser tells what comes near the window.
    drawNow(plots);
    await wait();
    const section = document.getElementById("position");
    const p = plots.find(p => section.contains(p.host));
    await bring(p.host);

    // A key hides its curve, in the plots of its section only, and shows it again.
    const button = [...section.querySelectorAll(".legend button")].find(b => b.dataset.group === "run0");
    const before = inked(p.u.ctx.canvas, "run0");
    click(button);
    await wait();
    check("a curve is hidden", before > 200 && inked(p.u.ctx.canvas, "run0") < before / 20, `${before} ${inked(p.u.ctx.canvas, "run0")}`);
    check("its key says so", button.getAttribute("aria-pressed") === "false", button.outerHTML);
    click(button);
    await wait();
    check("a curve is shown again", near(inked(p.u.ctx.canvas, "run0"), before, before / 20), inked(p.u.ctx.canvas, "run0"));

    // The smoothed estimates hide by a key of their own, with their band, and the estimates stay.
    const second = plots.filter(q => section.contains(q.host))[1];
    const afterwards = [...section.querySelectorAll(".legend button")].find(b => b.dataset.group === "smoothed");
    check("the smoothed way and its error are drawn", [p, second].every(q => q.spec.series.filter(s => s.groups?.includes("smoothed")).length === 3), second.spec.title);
    const smoothed = inked(p.u.ctx.canvas, "run3");
    click(afterwards);
    await wait();
    check("the smoothed way is hidden", smoothed > 50 && inked(p.u.ctx.canvas, "run3") < smoothed / 5, `${smoothed} ${inked(p.u.ctx.canvas, "run3")}`);
    check("the estimate is still shown", inked(p.u.ctx.canvas, "run0") > before / 2, inked(p.u.ctx.canvas, "run0"));
    click(afterwards);
    await wait();
    check("the smoothed way is shown again", near(inked(p.u.ctx.canvas, "run3"), smoothed, smoothed / 5), inked(p.u.ctx.canvas, "run3"));

    // Dragging zooms all plots to these times.
    await bring(p.host);
    let box = over(p);
    const middle = box.top + box.height / 2;
    const [from, to] = [0.25, 0.5].map(k => p.u.posToVal(k * box.width, "x"));
    drag([box.left + 0.25 * box.width, middle], [box.left + 0.5 * box.width, middle]);
    await wait();
    const pixel = (span[1] - span[0]) / box.width;
    check("a drag zooms time", near(range[0], from, pixel) && near(range[1], to, pixel), `${range} for ${from} ${to}`);
    check("all plots follow", timed().length > 1 && timed().every(q => near(q.u.scales.x.min, range[0], 1e-9)), timed().length);
    check("the bar tells the range", bar.out.value.startsWith(instant(range[0])), bar.out.value);
    click([...document.querySelectorAll("#bar button")].find(b => b.textContent === "Reset"));
    await wait();
    check("the button resets", range[0] === span[0] && range[1] === span[1], range);

    // The wheel with Ctrl zooms time about the pointer, with Shift the height alone; without them it scrolls the page.
    const x = box.left + 0.3 * box.width, under = p.u.posToVal(0.3 * box.width, "x");
    let was = scales(p);
    mouse("wheel", x, middle, { deltaY: -300 });
    await wait();
    check("the wheel alone changes nothing", String(scales(p)) === String(was), scales(p));
    mouse("wheel", x, middle, { deltaY: -300, ctrlKey: true });
    await wait();
    check("Ctrl and the wheel zoom time", range[1] - range[0] < 0.8 * (span[1] - span[0]), range);
    check("the time under the pointer stays", near(p.u.posToVal(0.3 * box.width, "x"), under, pixel), p.u.posToVal(0.3 * box.width, "x"));
    was = scales(p);
    mouse("wheel", x, middle, { deltaY: -300, shiftKey: true });
    await wait();
    let is = scales(p);
    check("Shift and the wheel zoom the height", is[3] - is[2] < 0.8 * (was[3] - was[2]) && is[0] === was[0] && is[1] === was[1], `${was} ${is}`);
    mouse("dblclick", x, middle);
    await wait();
    is = scales(p);
    check("a double click resets both", is[0] === span[0] && is[1] === span[1] && is[3] - is[2] >= was[3] - was[2], is);

    // Dragging with Shift zooms to an area.
    const [high, low] = [0.25, 0.75].map(k => p.u.posToVal(k * box.height, "y"));
    drag([x, box.top + 0.25 * box.height], [x + 0.3 * box.width, box.top + 0.75 * box.height], { shiftKey: true });
    await wait();
    is = scales(p);
    const dot = 2 * (high - low) / box.height;
    check("Shift and a drag zoom to an area", near(is[0], under, pixel) && near(is[2], low, dot) && near(is[3], high, dot), `${is} for ${under} ${low} ${high}`);
    reset();
    await wait();

    // The pointer on a plot: all of its values, and the place on the map.
    const s = p.spec.series.find(s => s.label === "estimate");
    mouse("mousemove", box.left + 0.6 * box.width, middle);
    await wait();
    const t = cursor, i = nearest(s.t, t);
    check("the cursor is under the pointer", near(t, p.u.posToVal(0.6 * box.width, "x"), pixel), t);
    const text = `estimate ${show(s.y[i])} ± ${show(s.half[i])}`;
    check("hovering tells values", !tip.hidden && tip.textContent.includes(text) && tip.textContent.includes(p.spec.title), `${tip.textContent} for ${text}`);
    check("other plots tell theirs", timed().filter(q => q !== p).every(q => q.out.value.startsWith(`${show(cursor)} s`)), cursor);
    check("the map marks the place", near(maps[0].state().marked, t, pixel), maps[0].state().marked);

    // The pointer on the path: the time, in every plot.
    const canvas = maps[0].canvas, path = runs[0].path, k = path.t.length >> 1;
    await bring(canvas);
    const place = () => { const at = maps[0].place(path.c[0][k], path.c[1][k]), r = canvas.getBoundingClientRect(); return [r.left + at[0], r.top + at[1]]; };
    mouse("mousemove", ...place());
    await wait();
    const found = nearest(path.t, cursor);
    // Within four pixels on the map: the path may pass there more than once.
    const away = Math.hypot(path.c[0][found] - path.c[0][k], path.c[1][found] - path.c[1][k]);
    check("the path gives the time", cursor != null && away * maps[0].scale() <= 4, `${cursor} ${away}`);
    check("time plots show it", near(p.u.cursor.left, p.u.valToPos(cursor, "x"), 1), p.u.cursor.left);
    check("the map tells of it", tip.textContent.includes("north") && tip.textContent.includes(`${show(cursor)} s`), tip.textContent);

    // The map: an area, a pan, a zoom about the pointer, and back.
    let view = maps[0].state();
    const r = canvas.getBoundingClientRect(), [cx, cy] = [r.left + r.width / 2, r.top + r.height / 2];
    drag([cx - 60, cy - 40], [cx + 60, cy + 40]);
    await wait();
    let seen = maps[0].state();
    check("dragging zooms the map", seen.w < 0.5 * view.w, `${view.w} ${seen.w}`);
    view = seen;
    drag([cx, cy], [cx + 50, cy], { shiftKey: true });
    await wait();
    seen = maps[0].state();
    check("with Shift it pans", near(seen.e, view.e - 50 / maps[0].scale(), 1 / maps[0].scale()) && seen.w === view.w, `${view.e} ${seen.e}`);
    mouse("wheel", cx, cy, { deltaY: -300, ctrlKey: true });
    await wait();
    check("Ctrl and the wheel zoom the map", maps[0].state().w < 0.8 * view.w, maps[0].state().w);
    mouse("dblclick", cx, cy);
    await wait();
    check("a double click shows all of it", maps[0].state().w > view.w, maps[0].state().w);

    // Follow: the cursor's place stays in the middle.
    await bring(canvas.closest(".plot").querySelector(".follow"));
    click(canvas.closest(".plot").querySelector(".follow"));
    point(path.t[k], null);
    await wait();
    seen = maps[0].state();
    check("the map follows the cursor", near(seen.n, path.c[0][k], 1e-3) && near(seen.e, path.c[1][k], 1e-3), `${seen.n} ${seen.e}`);
    click(canvas.closest(".plot").querySelector(".follow"));
    reset();

    // Keys.
    const start = cursor;
    key("ArrowRight");
    const later = cursor;
    key("ArrowLeft");
    check("arrow keys step", later > start && cursor < later, `${start} ${later} ${cursor}`);
    key("+");
    const zoomed = [...range];
    check("+ zooms", near(zoomed[1] - zoomed[0], (span[1] - span[0]) / 2, 1e-6), zoomed);
    key("ArrowRight", { shiftKey: true });
    check("arrow keys with Shift pan", near(range[0] - zoomed[0], (zoomed[1] - zoomed[0]) / 4, 1e-6), range);
    key("0");
    check("0 resets", range[0] === span[0] && range[1] === span[1], range);
    key("Escape");
    check("Escape takes the cursor away", cursor === null && tip.hidden, cursor);

    // Contents.
    scrollTo(0, 0);
    await wait();
    const links = [...document.querySelectorAll("#contents a")];
    const wanted = ["#result", "#trajectory", "#position", "#parameters", "#nees", "#innovations", "#numbers"];
    check("contents name the sections", wanted.every(w => links.some(a => a.getAttribute("href") === w)), links.map(a => a.hash));
    links.find(a => a.hash === "#parameters").click();
    await wait();
    const top = document.getElementById("parameters").getBoundingClientRect().top;
    check("a link scrolls to its section", scrollY > 100 && top >= 0 && top < 200, `${scrollY} ${top}`);

    // Paper.
    dispatchEvent(new Event("beforeprint"));
    check("on paper everything is drawn", plots.every(q => q.u) && root.dataset.print === "1", plots.filter(q => !q.u).length);
    check("on paper there are no buttons", [...document.querySelectorAll("#bar, .follow, #tip")].every(b => getComputedStyle(b).display === "none"), "");
    check("paper is light", getComputedStyle(document.body).width === "718px" && color("page") === "#ffffff", getComputedStyle(document.body).width);
    dispatchEvent(new Event("afterprint"));
    check("afterwards the bar is back", getComputedStyle(document.getElementById("bar")).display !== "none", "");
  } catch (error) {
    failures.push(`${error} ${error.stack}`);
  }
  root.dataset.checks = String(checks);
  root.dataset.failures = failures.join(" | ");
})();
