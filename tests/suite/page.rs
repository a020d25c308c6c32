//! report.html in a browser, used by mouse and keys.

use crate::support::Workspace;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Checks that `page.js` makes: one more or less is a change of it.
const CHECKS: &str = "40";

/// A browser, if there is one.
fn chromium() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let names = ["chromium", "chromium-browser", "google-chrome"];
    std::env::split_paths(&path)
        .flat_map(|dir| names.map(|n| dir.join(n)))
        .find(|p| p.is_file())
}

/// The root element of `page` with `script` added to it, after so much virtual time \[ms\].
fn after(browser: &Path, w: &Workspace, page: &str, script: &str, time: u32) -> String {
    let file = w.path("used.html");
    std::fs::write(&file, page.replace("</body>", &format!("<script>{script}</script></body>"))).unwrap();
    let quiet = "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking \
                 --disable-component-update --disable-sync --hide-scrollbars --window-size=1280,900 --dump-dom";
    let output = Command::new(browser)
        .args(quiet.split_whitespace())
        .arg(format!("--virtual-time-budget={time}"))
        .arg(format!("--user-data-dir={}", w.path("profile").display()))
        .arg(format!("file://{}", file.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout);
    let start = dom
        .find("<html")
        .unwrap_or_else(|| panic!("no page: {}", String::from_utf8_lossy(&output.stderr)));
    dom[start..].split_inclusive('>').next().unwrap_or_default().to_owned()
}

fn attribute<'a>(root: &'a str, name: &str) -> Option<&'a str> {
    root.split_once(&format!("data-{name}=\""))?.1.split('"').next()
}

#[test]
fn clicks_keys_and_the_wheel_do_what_the_page_says() {
    let Some(browser) = chromium() else {
        println!("skipped: clicks on report.html: no chromium on the PATH");
        return;
    };
    let w = Workspace::new("page-clicks");
    w.fusion(&["run", "--out", "out", "--smooth"]).success();
    let page = w.read("out/report.html");
    // Virtual time passes as fast as the page allows: the script needs some five seconds of it.
    let root = after(&browser, &w, &page, include_str!("page.js"), 60_000);
    assert_eq!(attribute(&root, "error"), None, "{root}");
    assert_eq!(
        (attribute(&root, "failures"), attribute(&root, "checks")),
        (Some(""), Some(CHECKS)),
        "{root}"
    );
}

#[test]
fn a_campaign_has_a_page_that_leads_to_its_worst_runs() {
    let w = Workspace::new("page-campaign");
    w.fusion(&[
        "montecarlo",
        "-n",
        "5",
        "--set",
        "sensor.gps_position.noise.sigma=2 m",
        "--out",
        "out",
    ])
    .success();
    let page = w.read("out/montecarlo.html");
    let runs = w.read("out/runs.csv");
    let mut reader = csv::Reader::from_reader(runs.as_bytes());
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    // Three runs have a report, which tells their seed; the others the command that makes it.
    for file in ["worst-1.html", "worst-2.html", "worst-3.html"] {
        assert!(page.contains(&format!("<a href=\"{file}\">")), "{file}");
        let report = w.read(&format!("out/{file}"));
        assert_eq!(
            rows.iter().filter(|row| report.contains(&format!("seed {}<", &row[1]))).count(),
            1,
            "{file}"
        );
    }
    let command = |row: &csv::StringRecord| {
        format!(
            "fusion run --set 'sensor.gps_position.noise.sigma=2 m' --seed {} --out run-{}",
            &row[1], &row[0]
        )
    };
    let told: Vec<_> = rows
        .iter()
        .filter(|row| page.contains(&format!("<code>{}</code>", command(row))))
        .collect();
    assert_eq!(told.len(), 2, "{rows:?}");
    let Some(browser) = chromium() else {
        println!("skipped: plots of montecarlo.html: no chromium on the PATH");
        return;
    };
    // Errors and NEES of position, velocity, attitude; the worst run is never better than the median.
    let script = "drawNow(plots); root.dataset.plots = plots.map(p => p.spec.title.split(' ')[0]).join(); \
                  root.dataset.ordered = String(data.fans.every(f => { const { t, c } = table(f.table); \
                  return t.length > 100 && t.every((_, i) => c[5][i] >= c[2][i] && c[2][i] >= c[0][i]); }));";
    let root = after(&browser, &w, &page, script, 5_000);
    let found = ["error", "plots", "ordered"].map(|name| attribute(&root, name));
    let six = "Position,Velocity,Attitude,Position,Velocity,Attitude";
    assert_eq!(found, [None, Some(six), Some("true")], "{root}");
}
