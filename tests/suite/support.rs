use assert_cmd::assert::Assert;
use predicates::prelude::{Predicate, predicate};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A separate folder for a test, removed at its end.
pub struct Workspace {
    dir: PathBuf,
}

impl Workspace {
    /// With the files of [`design`] and [`fixes`].
    pub fn new(test: &str) -> Self {
        let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
        let _ = std::fs::remove_dir_all(&dir);
        std::fs::create_dir_all(&dir).unwrap();
        let workspace = Self { dir };
        workspace.write("design.toml", DESIGN);
        workspace.write("gnss.csv", fixes());
        workspace
    }

    pub fn path(&self, file: &str) -> PathBuf {
        self.dir.join(file)
    }

    pub fn write(&self, file: &str, text: impl AsRef<[u8]>) {
        std::fs::write(self.path(file), text).unwrap();
    }

    pub fn read(&self, file: &str) -> String {
        std::fs::read_to_string(self.path(file)).unwrap()
    }

    /// Runs the command here with captured output: no terminal.
    pub fn fusion(&self, args: &[&str]) -> Assert {
        assert_cmd::cargo::cargo_bin_cmd!("fusion")
            .args(args)
            .current_dir(&self.dir)
            .assert()
    }
}

/// The standard output of the command.
pub fn stdout(ran: &Assert) -> String {
    String::from_utf8(ran.get_output().stdout.clone()).unwrap()
}

/// The standard error of the command.
pub fn stderr(ran: &Assert) -> String {
    String::from_utf8(ran.get_output().stderr.clone()).unwrap()
}

/// The page that the command printed with `--format json`.
pub fn page(ran: &Assert) -> Value {
    serde_json::from_str(&stdout(ran)).unwrap_or_else(|error| panic!("{error}: {}", stdout(ran)))
}

/// The sections of such a page, by title.
fn sections(page: &Value) -> impl Iterator<Item = (&str, &Value)> {
    let sections = page["sections"].as_array().into_iter().flatten();
    sections.map(|section| (section["title"].as_str().unwrap_or_default(), section))
}

/// The titles of its sections, in order.
pub fn titles(page: &Value) -> Vec<&str> {
    sections(page).map(|(title, _)| title).collect()
}

/// The first table of the first section whose title begins so.
pub fn table<'p>(page: &'p Value, title: &str) -> &'p Value {
    let mut found = sections(page).filter(|(own, _)| own.starts_with(title));
    let (_, section) = found.next().unwrap_or_else(|| panic!("no section {title} in {page:#}"));
    &section["tables"][0]
}

/// Lines of a table with blanks squeezed, so that widths may change.
pub fn squeezed(text: &str) -> Vec<String> {
    text.lines().map(|l| l.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

/// Matches a text if one of its lines contains `part`, with blanks squeezed.
pub fn has(part: &'static str) -> impl Predicate<str> {
    predicate::function(move |text: &str| squeezed(text).iter().any(|line| line.contains(part))).fn_name(part)
}

/// Asserts that the command printed each of these parts, as [`has`] finds them.
pub fn shows(ran: Assert, parts: &[&'static str]) -> Assert {
    parts.iter().fold(ran, |ran, part| ran.stdout(has(part)))
}

/// A text whose lines fit a terminal of 100 columns and end without blanks.
pub fn narrow() -> impl Predicate<str> {
    let fits = |line: &str| line.chars().count() <= 100 && line.trim_end() == line;
    predicate::function(move |text: &str| text.lines().all(fits)).fn_name("lines of at most 100 columns")
}

impl Drop for Workspace {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            let _ = std::fs::remove_dir_all(&self.dir);
        }
    }
}

/// A small design without mistakes, on recorded fixes.
pub const DESIGN: &str = r#"[run]
description = "Constant velocity with GNSS"
origin = { latitude = "47 deg", longitude = "8 deg" }

[process]
type = "constant_velocity"
acceleration_noise = "0.5 m/s^2/sqrt(Hz)"
position_sigma = "10 m"
velocity_sigma = "5 m/s"

[sensor.gnss]
type = "gnss_position"
source = "gnss"
noise = { sigma = "2 m" }
gate = { type = "nis", probability = 0.999 }

[initial.fix]
type = "first_fix"
source = "gnss"
position_sigma = "5 m"
velocity_sigma = "1 m/s"

[source.gnss]
type = "csv"
path = "gnss.csv"
time = { column = "t" }

[source.gnss.channels.position]
latitude = "lat"
longitude = "lon"
height = "h"
unit = "deg"

[source.gnss.channels.velocity]
columns = ["vn", "ve", "vd"]
unit = "m/s"

[variant.ekf]
filter.backend = "ekf"
"#;

/// Fixes of a receiver that drives north at about 11 m/s, five metres of noise in a pattern.
pub fn fixes() -> String {
    let mut text = "t,lat,lon,h,vn,ve,vd\n".to_owned();
    for k in 0..60 {
        let noise = f64::from((k * 37) % 11 - 5) * 4e-6;
        text += &format!(
            "{k}.0,{:.7},{:.7},400.0,11.1,0.0,0.0\n",
            47.0 + 1e-4 * f64::from(k) + noise,
            8.0 - noise
        );
    }
    text
}

/// Compares with tests/snapshots/NAME.snap. The list of blocks is left out: a new block changes no snapshot.
pub fn snapshot(name: &str, text: &str) {
    let mut settings = insta::Settings::new();
    settings.set_snapshot_path(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/snapshots"));
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.add_filter("known types: `.*", "known types: …");
    settings.add_filter(r"design [0-9a-f]{16} · fusion \S+", "design … · fusion …");
    settings.bind(|| insta::assert_snapshot!(name, text));
}
