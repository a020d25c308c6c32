use std::path::{Path, PathBuf};
use std::process::Command;

/// A folder of its own for a test, removed at its end.
pub struct Workspace {
    dir: PathBuf,
}

/// What a run of the command left behind.
#[derive(Debug)]
pub struct Ran {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
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

    /// Runs the command here, its outputs captured: no terminal.
    pub fn fusion(&self, args: &[&str]) -> Ran {
        let output = Command::new(env!("CARGO_BIN_EXE_fusion"))
            .args(args)
            .current_dir(&self.dir)
            .output()
            .unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Ran {
            code: output.status.code().unwrap(),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }
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

/// Compares with tests/snapshots/NAME.txt; with FUSION_BLESS set, writes it.
pub fn snapshot(name: &str, actual: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/snapshots")
        .join(format!("{name}.txt"));
    if std::env::var_os("FUSION_BLESS").is_some() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, actual).unwrap();
        return;
    }
    let expected = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        expected == actual,
        "{} differs.\n--- expected\n{expected}\n--- actual\n{actual}\n--- if the new text is better, run the test with FUSION_BLESS=1",
        path.display()
    );
}
