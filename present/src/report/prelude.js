"use strict";
// Before anything can fail: errors become visible to a test, and canvases sharp in print.
{
  const root = document.documentElement;
  const note = text => { root.dataset.error = root.dataset.error ? `${root.dataset.error} | ${text}` : text; };
  addEventListener("error", e => note(e.message || "error"));
  addEventListener("unhandledrejection", e => note(String(e.reason)));
  addEventListener("securitypolicyviolation", e => note(`blocked ${e.blockedURI}`));
  const log = console.error;
  console.error = (...args) => { note(args.join(" ")); log.apply(console, args); };
  const ratio = Math.max(2, Math.min(3, devicePixelRatio || 1));
  Object.defineProperty(window, "devicePixelRatio", { get: () => ratio, configurable: true });
}
