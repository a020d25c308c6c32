"use strict";
// Added to a page by its tests: counts what was left blank, zooms, points and resets.
setTimeout(() => drawNow(plots), 100);
setTimeout(() => {
  const blank = [...document.querySelectorAll("canvas")].filter(c => {
    const pixels = new Uint32Array(c.getContext("2d").getImageData(0, 0, c.width, c.height).data.buffer);
    return new Set(pixels).size < 4;
  });
  root.dataset.drawn = String(plots.filter(p => p.u).length + maps.length);
  root.dataset.blank = String(blank.length);
  root.dataset.canvases = String(document.querySelectorAll("canvas").length);
  root.dataset.scales = plots.filter(p => p.spec.series.some(s => s.clamped)).map(p => +p.u.scales.y.max.toFixed(6)).join(" ");
  const middle = (span[0] + span[1]) / 2;
  setRange(middle, middle + (span[1] - span[0]) / 10);
  point(middle + (span[1] - span[0]) / 20, null);
  setTimeout(() => {
    root.dataset.linked = String(timed().filter(p => Math.abs(p.u.scales.x.min - range[0]) < 1e-6 && p.out.value).length);
    plots[0]?.u.over.dispatchEvent(new MouseEvent("dblclick", { bubbles: true }));
    setTimeout(() => {
      root.dataset.reset = String(timed().filter(p => p.u.scales.x.max === span[1]).length);
      root.dataset.overflow = String(Math.max(0, document.documentElement.scrollWidth - innerWidth));
      root.dataset.checked = "1";
    }, 50);
  }, 50);
}, 300);
