//! The command as a separate process, from 87 MB of text to its files: 21 states, 56 minutes of an inertial unit at
//! 200 Hz and GNSS at 1 Hz.
//!
//! Prints the user time and the wall-clock time, each the least of three runs. The user time comes from `/proc`, in
//! hundredths of a second; systems without it have no user time.

use fusion::assembly::{assemble, declared_streams};
use fusion::config::Document;
use fusion::design::Design;
use fusion::rows::Nobody;
use fusion::world::SimulatedRows;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

/// Rows of the inertial unit.
const EPOCHS: usize = 672_000;
/// Each figure is the least of this number of runs: other work of the machine can only make a run longer.
const RUNS: usize = 3;

/// The filter, for its own log and for the world in which the log is made.
const FILTER: &str = r#"
[process]
type = "strapdown"
source = "imu"
gyro.noise = "0.125 deg/sqrt(h)"
gyro.bias = { estimate = true, initial = [0, 0, 0], sigma = "1 deg/h", random_walk = "1e-7 rad/s/sqrt(s)" }
gyro.scale = { estimate = true, initial = [0, 0, 0], sigma = "150 ppm" }
accelerometer.noise = "0.33 mm/s/sqrt(s)"
accelerometer.bias = { estimate = true, initial = [0, 0, 0], sigma = "1 mg", random_walk = "1e-5 m/s^2/sqrt(s)" }
accelerometer.scale = { estimate = true, initial = [0, 0, 0], sigma = "300 ppm" }

[sensor.gnss]
type = "gnss_position"
source = "gnss"
lever_arm = [0.3, 0, "-1 m"]
noise = { sigma = ["1 m", "1 m", "2 m"] }
gate = { type = "nis", probability = 0.999 }

[initial.start]
type = "explicit"
position_sigma = "2 m"
velocity = [0, 0, 0]
velocity_sigma = "0.1 m/s"
attitude = [0, 0, "30 deg"]
attitude_sigma = ["0.1 deg", "0.1 deg", "1 deg"]
"#;

const WORLD: &str = r#"
[simulation]
start = { heading = "30 deg" }
imu = { rate = "200 Hz", preset = "hg1700" }
sensor.gnss = { rate = "1 Hz", white = ["1 m", "1 m", "2 m"] }
"#;

const LOG: &str = r#"
[source.imu]
type = "csv"
path = "imu.csv"
time = { column = "t_s", unit = "s" }
rate = "200 Hz"
[source.imu.channels]
angular_rate = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
specific_force = { columns = ["fx", "fy", "fz"], unit = "m/s^2" }

[source.gnss]
type = "csv"
path = "gnss.csv"
time = { column = "t_s", unit = "s" }
[source.gnss.channels]
position = { latitude = "lat_rad", longitude = "lon_rad", height = "h_m", unit = "rad" }
"#;

/// The folder of log, design and results; removed at the end.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn origin(rate: &str) -> String {
    let place = r#"origin = { latitude = "36.1 deg", longitude = "129.4 deg", height = "10 m" }"#;
    format!("[run]\nseed = 1\n{place}\n{rate}\n")
}

/// A drive around one block after the other, until the log is long enough.
fn world() -> Design {
    let side = r#"{ type = "straight", distance = "500 m", speed = "12 m/s", acceleration = "1 m/s^2" }"#;
    let corner = r#"{ type = "turn", angle = "90 deg", radius = "30 m" }"#;
    let legs = vec![format!("{side}, {corner}"); 100].join(", ");
    let rest = r#"{ type = "rest", duration = "10 s" }"#;
    let text = [&origin(""), FILTER, WORLD, &format!("trajectory = [{rest}, {legs}]")].concat();
    let (document, mistakes) = Document::parse("world.toml", &text);
    assert!(mistakes.is_empty(), "{mistakes:?}");
    Design::read(document).unwrap_or_else(|d| panic!("{d}"))
}

/// Writes the log; numbers with all their digits.
fn write_log(folder: &Path) -> io::Result<u64> {
    let design = world();
    let assembly = assemble(&design, declared_streams(&design).unwrap()).unwrap_or_else(|d| panic!("{d}"));
    let simulation = design.simulation.as_ref().unwrap();
    let mut world = SimulatedRows::new(&design, simulation, &assembly, None).unwrap_or_else(|d| panic!("{d}"));
    let create = |name: &str| Ok::<_, io::Error>(BufWriter::new(File::create(folder.join(name))?));
    let (mut imu, mut gnss) = (create("imu.csv")?, create("gnss.csv")?);
    writeln!(imu, "t_s,wx,wy,wz,fx,fy,fz")?;
    writeln!(gnss, "t_s,lat_rad,lon_rad,h_m")?;
    let mut rows = 0;
    while let Some(row) = world.next(&mut Nobody) {
        let name = assembly.streams[row.stream].name.as_str();
        let out = match name {
            "imu" if rows == EPOCHS => break,
            "imu" => {
                rows += 1;
                &mut imu
            }
            "gnss" => &mut gnss,
            _ => continue,
        };
        write!(out, "{:.3}", row.time.seconds())?;
        row.values.iter().try_for_each(|value| write!(out, ",{value}"))?;
        writeln!(out)?;
    }
    assert_eq!(rows, EPOCHS, "the drive is long enough");
    imu.flush()?;
    gnss.flush()?;
    Ok(fs::metadata(folder.join("imu.csv"))?.len())
}

/// User time of all children so far \[s\]; proc(5), field 16 of `stat`, in the 100 Hz that Linux shows.
fn spent() -> Option<f64> {
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    // The name, the second field, may have blanks and brackets.
    let (_, fields) = stat.rsplit_once(')')?;
    let ticks: f64 = fields.split_whitespace().nth(13)?.parse().ok()?;
    Some(ticks / 100.0)
}

/// User time, if it is known, and wall-clock time of one run \[s\].
fn time(folder: &Path, arguments: &[&str]) -> (Option<f64>, f64) {
    let (before, clock) = (spent(), Instant::now());
    let mut command = Command::new(env!("CARGO_BIN_EXE_fusion"));
    command.arg("run").args(arguments).current_dir(folder);
    let done = command.stdout(Stdio::null()).status().expect("the command was built");
    assert!(done.success(), "fusion run {arguments:?}");
    (
        spent().zip(before).map(|(after, before)| after - before),
        clock.elapsed().as_secs_f64(),
    )
}

/// Prints the figures.
pub fn figures() {
    let folder = Folder(std::env::temp_dir().join(format!("fusion-process-{}", std::process::id())));
    fs::create_dir_all(&folder.0).expect("a temporary folder");
    let bytes = write_log(&folder.0).expect("room for the log");
    let design = |name: &str, rate: &str| fs::write(folder.0.join(name), [&origin(rate), FILTER, LOG].concat());
    design("all.toml", "").expect("room for a design");
    design("thinned.toml", r#"output_rate = "10 Hz""#).expect("room for a design");
    let cases: [(&str, &[&str]); 3] = [
        ("all written", &["all.toml", "--out", "all"]),
        ("10 Hz written", &["thinned.toml", "--out", "thinned"]),
        ("none written", &["all.toml"]),
    ];
    println!("process/{EPOCHS} epochs: {:.1} MB of text", bytes as f64 * 1e-6);
    for (case, arguments) in cases {
        let times = if super::once::is_test() { 1 } else { RUNS };
        let runs: Vec<_> = (0..times).map(|_| time(&folder.0, arguments)).collect();
        let wall = runs.iter().map(|(_, wall)| *wall).fold(f64::INFINITY, f64::min);
        let user = runs.iter().filter_map(|(user, _)| *user).reduce(f64::min);
        let user = user.map_or_else(|| "–".to_owned(), |s| format!("{s:.2}"));
        println!("process/{EPOCHS} epochs/{case}: {user} s user, {wall:.2} s by the clock");
    }
}
