"use strict";
// What is drawn of a campaign: fans of its errors, and the mean NEES over its runs.
{
  const entries = [["line", "run0", "median", "median"], ["band", "run0", "5, 25, 75, 95 %", "band"], ["line", "bad", "worst run", "worst"]];
  if (data.fans.length) {
    const grid = section("errors", "Errors over time", entries);
    for (const f of data.fans) {
      const { t, c } = table(f.table);
      // Of quantiles 5, 25, 50, 75, 95 % and the largest, each pair of edges is a band.
      const series = [[4, 0], [3, 1]].flatMap(([high, low]) => [
        { kind: "edge", upper: true, t, y: c[high], color: "run0", groups: ["band"], label: `${high === 4 ? 95 : 75} %` },
        { kind: "edge", t, y: c[low], color: "run0", groups: ["band"], label: `${high === 4 ? 5 : 25} %` },
      ]);
      series.push({ kind: "line", t, y: c[5], color: "bad", groups: ["worst"], width: 1, label: "worst" });
      series.push({ kind: "line", t, y: c[2], color: "run0", groups: ["median"], label: "median" });
      panel(grid, `${f.name} error, RMS [${f.unit}]`, { series, scale: "length" });
    }
  }
  const judged = data.fans.filter(f => f.dof > 0);
  if (judged.length) {
    const grid = section("nees", "Mean NEES over the runs", [["line", "run0", "mean", "mean"], ["dash", "soft", "expected mean and its 95 % band", "expected"]]);
    for (const f of judged) {
      const { t, c } = table(f.nees);
      const inside = t.reduce((n, _, i) => n + (c[0][i] >= c[1][i] && c[0][i] <= c[2][i]), 0);
      const dashed = { kind: "line", t, color: "soft", groups: ["expected"], dash: [6, 4], width: 0.75 };
      const series = [{ ...dashed, y: c[1] }, { ...dashed, y: c[2] }, { ...dashed, y: t.map(() => f.dof), width: 1.25 }];
      series.push({ kind: "line", t, y: c[0], color: "run0", groups: ["mean"], label: "mean NEES" });
      panel(grid, `${f.name} NEES of ${f.dof}: ${(100 * inside / t.length).toFixed(1)} % inside the band`, { series, scale: "nis" });
    }
  }
}
