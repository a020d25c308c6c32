//! report.html in a browser, used by mouse and keys.

use crate::support::Workspace;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Checks that `page.js` makes: one more or less is a change of it.
const CHECKS: &str = "36";

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
    w.fusion(&["run", "--out", "out"]).success();
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
