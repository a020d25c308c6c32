//! Whole pages: their size, their safety, and their display in a browser.

use super::{Frame, Recording, Run, render};
use fusion::observe::{Filters, RunEvent, RunObserver};
use fusion::run::{Computation, Counts, Failures, Identity, Start, Summary};
use fusion::score::{Comparison, EpochError, ReferenceEpoch};
use fusion::solution::Solution;
use fusion_core::filter::{Update, Verdict};
use fusion_core::gate::Mode;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::runner::{Event, Row, RowId};
use fusion_core::time::Time;
use nalgebra::{Matrix3, Vector3};
use std::path::{Path, PathBuf};
use std::process::Command;

const ORIGIN: Geodetic = Geodetic {
    lat: 0.63,
    lon: 2.26,
    height: 10.0,
};

/// A recording, and the reference that estimates are compared with.
struct Compared {
    recording: Recording,
    comparison: Comparison,
}

impl Compared {
    fn new() -> Self {
        let frame = Frame {
            origin: Some(ORIGIN),
            ..Frame::default()
        };
        Self {
            recording: Recording::new(frame),
            comparison: Comparison::new(Vector3::zeros(), []),
        }
    }

    fn estimate(&mut self, solution: &Solution) {
        self.recording.estimate(solution);
        let told = |epoch: &ReferenceEpoch, error: Option<&EpochError>| {
            self.recording.reference(epoch, error);
            Ok::<_, core::convert::Infallible>(())
        };
        self.comparison.reach(solution, None, told).unwrap();
    }
}

/// A vehicle on a circle for `seconds`, sampled at `rate`; the estimate is `offset` metres away from the truth.
/// It has inertial data, a compass, fixes (every 50th is rejected), and a denial in the middle.
fn recording_at(rate: i64, seconds: f64, offset: f64) -> Recording {
    let mut r = Compared::new();
    let steps = (seconds * rate as f64) as i64;
    for i in 0..steps {
        let time = Time::from_nanos(i * (1_000_000_000 / rate));
        let t = time.seconds();
        let angle = 0.05 * t;
        let wobble = (t * 37.0).sin() + (t * 11.3).cos();
        let ned = Vector3::new(50.0 * angle.sin(), 50.0 - 50.0 * angle.cos(), 0.1 * wobble);
        let v = Vector3::new(2.5 * angle.cos(), 2.5 * angle.sin(), 0.0);
        let q = so3::from_rpy(0.02 * wobble, 0.0, angle);
        r.comparison.push(ReferenceEpoch {
            time,
            position: Some(ORIGIN.offset(&ned)),
            velocity: Some(v),
            attitude: Some(q),
            ..ReferenceEpoch::default()
        });
        r.recording
            .input("angular rate", "deg/s", time, &[wobble, -wobble, 2.9 + 0.2 * wobble]);
        r.recording
            .input("specific force", "m/s²", time, &[0.1 * wobble, 0.1, -9.8 + 0.1 * wobble]);
        let error = Vector3::new(offset + 0.2 * wobble, 0.3 * (t * 0.11).sin(), 0.1);
        r.estimate(&Solution {
            time,
            position: Some((ORIGIN.offset(&(ned + error)), Matrix3::identity() * (0.25 + offset))),
            velocity: Some((v + 0.1 * error, Matrix3::identity() * 0.01)),
            attitude: Some((q * so3::exp(&(0.01 * error)), Matrix3::identity() * 1e-4)),
            ..Solution::default()
        });
        if i % 3 == 0 {
            let heading = angle.to_degrees() + wobble;
            r.recording
                .input("heading", "deg", time, &[heading - 360.0 * (heading / 360.0).round()]);
            let compass = update(Verdict::Accepted, wobble * wobble, 6.6, Mode::Track);
            let (residual, sigma) = ([0.01 * wobble], [0.01]);
            r.recording
                .measurement("compass", time, None, &with_rows(compass, &residual, &sigma));
        }
        if i % rate == 0 {
            let denied = (0.4..0.5).contains(&(t / seconds));
            let rejected = denied || i % (50 * rate) == 0;
            let fix = ORIGIN.offset(&(ned + Vector3::new(wobble, -wobble, 0.0) * if rejected { 8.0 } else { 1.0 }));
            let (verdict, nis) = if rejected {
                (Verdict::Rejected, 300.0 + wobble)
            } else {
                (Verdict::Accepted, 3.0 + wobble)
            };
            let gnss = update(verdict, nis, 16.3, if denied { Mode::Denied } else { Mode::Track });
            let residual = [wobble, -wobble, 0.3].map(|v| if rejected { 8.0 * v } else { v });
            r.recording
                .measurement("gnss", time, Some(fix), &with_rows(gnss, &residual, &[1.0, 1.0, 2.0]));
        }
    }
    r.recording
}

fn recording(seconds: f64, offset: f64) -> Recording {
    recording_at(100, seconds, offset)
}

fn update(verdict: Verdict, nis: f64, threshold: f64, mode: Mode) -> Update<'static> {
    Update {
        verdict,
        value: &[],
        predicted: &[],
        noise: &[],
        residual: &[],
        innovation_sigma: &[],
        innovation_factor: &[],
        nis,
        statistic: nis,
        threshold,
        mode,
        power: &[],
        weight: 1.0,
        rivals: fusion_core::filter::Rivals::NONE,
        jacobian: None,
    }
}

fn with_rows<'a>(update: Update<'a>, residual: &'a [f64], innovation_sigma: &'a [f64]) -> Update<'a> {
    Update {
        residual,
        innovation_sigma,
        ..update
    }
}

fn summary() -> Summary {
    Summary::default()
        .with(Identity {
            description: "A circle".to_owned(),
            ..Identity::default()
        })
        .with(Start {
            started: Some(0.0),
            ..Start::default()
        })
        .with(Counts {
            epochs: 1,
            ..Counts::default()
        })
}

#[test]
fn four_hours_at_100_hz_stay_below_four_megabytes_and_in_bounded_memory() {
    // Without optimisation 100 Hz take a minute; 10 Hz fill the same buffers.
    let rate = if cfg!(debug_assertions) { 10 } else { 100 };
    let short = recording_at(rate, 4_000.0, 0.0);
    let long = recording_at(rate, 14_400.0, 0.0);
    // Fixes come at 1 Hz: theirs are the only buffers that the short run has not filled.
    assert!(
        long.bytes() < 2 * short.bytes() && long.bytes() < 12_000_000,
        "{} and {} bytes",
        short.bytes(),
        long.bytes()
    );
    let summary = summary();
    let run = |name| Run {
        name,
        recording: &long,
        summary: &summary,
    };
    for runs in [&[run("a")][..], &[run("a"), run("b"), run("c"), run("d")]] {
        let page = render("Four hours", runs);
        assert!(page.len() < 4_000_000, "{} bytes for {} runs", page.len(), runs.len());
        assert!(page.len() > 2_000_000, "the budget is used: {} bytes", page.len());
    }
}

#[test]
fn names_cannot_break_out_of_the_page() {
    const EVIL: &str = "</script><script>alert(1)</script><img src=x onerror=\"alert('2')\">&";
    let mut r = recording(2.0, 0.0);
    r.measurement(EVIL, Time::default(), None, &update(Verdict::Accepted, 1.0, 2.0, Mode::Track));
    r.input(EVIL, EVIL, Time::default(), &[1.0]);
    let s = summary()
        .with(Identity {
            description: format!("{EVIL} described"),
            ..Identity::default()
        })
        .with(Failures {
            first: vec![EVIL.to_owned()],
            ..Failures::default()
        })
        .with(Computation {
            backend: EVIL.to_owned(),
            ..Computation::default()
        })
        .with(vec![fusion::observe::SensorStatistics {
            name: EVIL.to_owned(),
            ..Default::default()
        }]);
    let page = render(
        EVIL,
        &[Run {
            name: EVIL,
            recording: &r,
            summary: &s,
        }],
    );
    assert!(!page.contains("<script>alert") && !page.contains("<img"));
    // The page's own scripts and its data, and nothing that ends one early.
    let own = super::page::OF_RUNS.concat().len() + 3;
    assert_eq!(page.matches("<script").count(), own);
    assert_eq!(page.matches("</script").count(), own);
    assert!(page.contains("&lt;/script&gt;&lt;script&gt;alert(1)"));
}

#[test]
fn a_page_refers_to_nothing_outside_itself() {
    let (r, s) = (recording(2.0, 0.0), summary());
    let page = render(
        "Alone",
        &[Run {
            name: "a",
            recording: &r,
            summary: &s,
        }],
    );
    assert!(page.contains("default-src 'none'"));
    for reference in ["<link", " src=\"", "@import", "url(", "fetch(", "XMLHttpRequest", "import("] {
        assert!(!page.contains(reference), "{reference}");
    }
}

#[test]
fn a_run_without_anything_is_still_a_page() {
    let (r, s) = (Recording::new(Frame::default()), Summary::default());
    assert!(
        render(
            "Nothing",
            &[Run {
                name: "a",
                recording: &r,
                summary: &s
            }]
        )
        .contains("No reference")
    );
    assert!(render("Nothing at all", &[]).contains("Nothing at all"));
}

#[test]
fn the_error_is_that_at_the_reference_epoch() {
    // The reference lies between two estimates; position is carried on, not interpolated.
    let mut r = Compared::new();
    let at = |north: f64| ORIGIN.offset(&Vector3::new(north, 0.0, 0.0));
    let estimate = |t: f64, north: f64| Solution {
        time: Time::from_seconds(t),
        position: Some((at(north), Matrix3::identity())),
        velocity: Some((Vector3::new(1.0, 0.0, 0.0), Matrix3::identity())),
        ..Solution::default()
    };
    r.comparison.push(ReferenceEpoch {
        time: Time::from_seconds(0.5),
        position: Some(at(0.0)),
        ..ReferenceEpoch::default()
    });
    r.estimate(&estimate(0.0, 2.0));
    r.estimate(&estimate(1.0, 9.0));
    let errors = r.recording.position.error.columns(10, false);
    assert_eq!(errors.time, [0.5]);
    // 2 m and half a second of 1 m/s; a millimetre covers the curvature of the Earth.
    assert!((errors.values[0][0] - 2.5).abs() < 1e-3);
    assert_eq!(errors.values[3][0], 3.0);
}

#[test]
fn measurements_become_fixes_with_their_verdict_and_rows_become_sensor_data() {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/ins-gps.toml");
    let document = fusion::config::Document::load(&file).unwrap();
    let design = fusion::design::Design::read(document).unwrap();
    let assembly = fusion::assembly::assemble(&design, fusion::assembly::declared_streams(&design).unwrap()).unwrap();
    let mut r = Recording::of(&design, &assembly);
    let stream = |name: &str| assembly.streams.iter().position(|s| s.name == name).unwrap();
    let sensor = assembly.sensors.iter().position(|s| s.name == "position").unwrap();
    let filters = Filters::of(&assembly);
    let filter = filters.iter().next().unwrap();
    let origin = Geodetic::from(design.run.origin.unwrap());
    for i in 0..4_i64 {
        let time = Time::from_nanos(i * 1_000_000_000);
        let place = origin.offset(&Vector3::new(i as f64, 0.0, 0.0));
        let imu = Row::new(stream("imu"), time, &[0.1, 0.0, 0.0, 0.0, 0.0, -9.8]);
        r.on(&RunEvent::Row(&imu)).unwrap();
        let verdict = if i == 2 { Verdict::Rejected } else { Verdict::Accepted };
        let update = Update {
            value: &[place.lat, place.lon, place.height],
            ..update(verdict, 1.0, 16.0, Mode::Track)
        };
        let row = RowId {
            stream: stream("position"),
            number: 0,
            stamp: time,
            arrival: time,
            disturbed: false,
        };
        let event = &Event::Updated { sensor, update, time, row };
        r.on(&RunEvent::Filter { filter, event }).unwrap();
    }
    let north = |k: usize| {
        r.sensors[sensor].fixes[k]
            .iter()
            .map(|(t, p)| (t, p[0].round()))
            .collect::<Vec<_>>()
    };
    assert_eq!(north(0), [(0.0, 0.0), (1.0, 1.0), (3.0, 3.0)]);
    assert_eq!(north(1), [(2.0, 2.0)]);
    assert_eq!(
        r.inputs.iter().take(2).map(|i| i.name.as_str()).collect::<Vec<_>>(),
        ["angular rate", "specific force"]
    );
    assert_eq!((r.inputs[0].unit.as_str(), r.inputs[1].unit.as_str()), ("deg/s", "m/s²"));
    let rate = r.inputs[0].trace.columns(10, false).values[0][0];
    assert!((rate - 5.7296).abs() < 1e-3, "0.1 rad/s in degrees");
}

#[test]
fn innovations_of_accepted_measurements_are_kept_per_row_and_those_of_others_apart() {
    let mut r = Recording::new(Frame::default());
    let verdicts = [Verdict::Accepted, Verdict::Rejected, Verdict::Reacquired, Verdict::Unusable];
    for (i, verdict) in verdicts.into_iter().enumerate() {
        let time = Time::from_seconds(i as f64);
        let update = update(verdict, 1.0, 9.0, Mode::Track);
        let v = 1.0 + i as f64;
        let power = Update {
            power: &[7.0, f64::INFINITY],
            ..update
        };
        r.measurement("velocity", time, None, &with_rows(power, &[v, -v], &[0.5, 2.0]));
        r.measurement("four", time, None, &with_rows(update, &[v; 4], &[1.0; 4]));
    }
    let columns = r.sensors[0].updates.columns(10, false).values;
    let shown = |k: usize| columns[k].iter().map(|v| (!v.is_nan()).then_some(*v)).collect::<Vec<_>>();
    assert_eq!(columns.len(), 5 + 4 * 2);
    assert_eq!(shown(5), [Some(1.0), None, None, None]);
    assert_eq!(shown(6), [Some(-1.0), None, None, None]);
    assert_eq!(shown(7), [None, Some(2.0), Some(3.0), None]);
    assert_eq!(shown(8), [None, Some(-2.0), Some(-3.0), None]);
    assert_eq!(shown(9), [Some(1.5); 4]);
    assert_eq!(shown(10), [Some(6.0); 4]);
    assert_eq!((shown(11), shown(12)), (vec![Some(7.0); 4], vec![None; 4]));
    // More than three rows are judged, not drawn.
    assert_eq!(r.sensors[1].updates.columns(10, false).values.len(), 5);
}

#[test]
fn yaw_is_drawn_without_jumps_and_error_turns_agree() {
    let mut r = Compared::new();
    for i in 0..200 {
        let time = Time::from_seconds(f64::from(i) * 0.1);
        let yaw = 3.1 + 0.05 * f64::from(i);
        r.comparison.push(ReferenceEpoch {
            time,
            attitude: Some(so3::from_rpy(0.0, 0.0, yaw)),
            ..ReferenceEpoch::default()
        });
        // The estimate starts on the other side of ±180°.
        let attitude = Some((so3::from_rpy(0.0, 0.0, yaw + 0.1), Matrix3::identity() * 1e-4));
        r.estimate(&Solution {
            time,
            attitude,
            ..Solution::default()
        });
    }
    for trace in [&r.recording.attitude.estimate, &r.recording.attitude.truth] {
        let yaw = &trace.columns(1000, false).values[2];
        assert!(yaw.windows(2).all(|w| (w[1] - w[0] - 2.865).abs() < 0.01), "0.05 rad a step");
    }
    assert_eq!(r.recording.attitude.turns.map(|t| t.z), Some(360.0));
    assert!(
        r.recording.attitude.error.columns(1000, false).values[2]
            .iter()
            .all(|e| (e - 5.73).abs() < 0.01)
    );
}

/// A browser, if there is one.
fn chromium() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let names = ["chromium", "chromium-browser", "google-chrome"];
    std::env::split_paths(&path)
        .flat_map(|dir| names.map(|n| dir.join(n)))
        .find(|p| p.is_file())
}

/// The page's root element after its script has run.
fn root_in_browser(browser: &Path, name: &str, page: &str) -> String {
    let dir = std::env::temp_dir().join(format!("fusion-report-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&dir);
    std::fs::create_dir_all(&dir).unwrap();
    let file = dir.join("report.html");
    let check = concat!("<script>", include_str!("check.js"), "</script></body>");
    std::fs::write(&file, page.replace("</body>", check)).unwrap();
    let quiet = "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking \
                 --disable-component-update --disable-sync --hide-scrollbars --window-size=1280,900 --virtual-time-budget=8000";
    let output = Command::new(browser)
        .args(quiet.split_whitespace())
        .arg(format!("--user-data-dir={}", dir.join("profile").display()))
        .arg("--dump-dom")
        .arg(format!("file://{}", file.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout).into_owned();
    let _ = std::fs::remove_dir_all(&dir);
    let start = dom
        .find("<html")
        .unwrap_or_else(|| panic!("no page: {}", String::from_utf8_lossy(&output.stderr)));
    dom[start..].split_inclusive('>').next().unwrap_or_default().to_owned()
}

fn attribute<'a>(root: &'a str, name: &str) -> Option<&'a str> {
    root.split_once(&format!("data-{name}=\""))?.1.split('"').next()
}

/// Innovations are scaled to their band, or without one to those used: of at most 0.02 and 2 twice,
/// and 0.3. Those rejected are eight times as large.
fn check_scales(name: &str, root: &str) {
    let scales: Vec<f64> = attribute(root, "scales").unwrap().split(' ').map(|s| s.parse().unwrap()).collect();
    match name {
        "one" => assert_eq!(scales, [0.0324, 3.24, 3.24, 6.48]),
        _ => assert!(
            scales
                .iter()
                .zip([0.0216, 2.16, 2.16, 0.324])
                .all(|(s, most)| (0.8 * most..=most).contains(s)),
            "{scales:?}"
        ),
    }
}

#[test]
fn a_browser_draws_every_plot_without_error_or_request() {
    let Some(browser) = chromium() else {
        println!("skipped: no chromium on the PATH");
        return;
    };
    let s = summary();
    let (a, b) = (recording(300.0, 0.0), recording(300.0, 2.0));
    let alone = render(
        "One run",
        &[Run {
            name: "a",
            recording: &a,
            summary: &s,
        }],
    );
    let both = render(
        "Two runs",
        &[
            Run {
                name: "a",
                recording: &a,
                summary: &s,
            },
            Run {
                name: "b",
                recording: &b,
                summary: &s,
            },
        ],
    );
    for (name, page) in [("one", &alone), ("two", &both)] {
        let root = root_in_browser(&browser, name, page);
        // 3 × 3 values, as many errors, 3 NEES, the NIS of 2 sensors with 3 and 1 innovations, each with its histogram
        // and its autocorrelation, 4 plots of sensor data, the distance of the fixes, and the map. With another run
        // there are 3 × 3 differences too.
        let (drawn, timed) = if name == "one" { ("41", "32") } else { ("50", "41") };
        let wanted = [
            ("error", None),
            ("drawn", Some(drawn)),
            ("canvases", Some(drawn)),
            ("blank", Some("0")),
        ];
        let acted = [
            ("linked", Some(timed)),
            ("reset", Some(timed)),
            ("overflow", Some("0")),
            ("checked", Some("1")),
        ];
        for (key, value) in wanted.into_iter().chain(acted) {
            assert_eq!(attribute(&root, key), value, "data-{key} of {name}: {root}");
        }
        check_scales(name, &root);
    }
    // A page that fails says so: the test can see an error and a request.
    let broken = alone.replace("<main>", "<main><img src=\"http://127.0.0.1:9/x.png\"><script>nothing()</script>");
    let root = root_in_browser(&browser, "broken", &broken);
    let error = attribute(&root, "error").unwrap_or_default();
    assert!(
        error.contains("blocked http://127.0.0.1:9/x.png") && error.contains("nothing is not defined"),
        "{root}"
    );
}
