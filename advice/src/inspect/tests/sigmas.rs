//! How a first design uses the 1σ that a log reports.

use super::super::names::reported_by_name;
use super::*;

/// The fixes of [`fixes`] with a scatter of `size` \[m/s\], and columns that report the 1σ of their velocities.
fn reporting(size: f64, columns: &[(&'static str, &dyn Fn(f64) -> f64)]) -> LogTable {
    let mut all = fixes(1.0);
    all.path = "gnss.csv".into();
    for (k, seed) in [(4, 20.0), (5, 21.0)] {
        let base = if k == 4 { 3.0 } else { 0.0 };
        let values = (0..300).map(|row| base + size * noise(f64::from(row), seed));
        all.columns[k].values = values.collect();
    }
    all.columns.extend(table(columns, 300, 1.0).columns);
    all
}

fn design(fixes: LogTable) -> String {
    let mut shaken = unit();
    shaken.path = "imu.csv".into();
    Inspection::look(vec![Log::of(shaken), Log::of(fixes)])
        .design(Path::new("/"))
        .unwrap()
}

fn can_be_built(design: &str) -> bool {
    // Tables made here have no delimiter.
    let design = design.replace("delimiter = \"\"\n", "");
    let (document, mistakes) = fusion::config::Document::parse("design.toml", &design);
    mistakes.is_empty() && fusion::run::examine::build(document).is_ok()
}

/// The factor and the added 1σ of the velocities in a design.
fn noise_of(design: &str) -> Option<(f64, f64)> {
    let table = design.split("[sensor.gnss_velocity]").nth(1)?.split("noise = {").nth(1)?;
    let after = |key: &str| table.split(key).nth(1)?.split([',', ' ']).next()?.parse().ok();
    table.trim_start().starts_with("from_source = true").then_some(())?;
    Some((after("scale = ")?, after("sigma = [\"")?))
}

/// The 1σ of a uniform distribution over ±1 is 1/√3.
const EVEN: f64 = 0.577;

#[test]
fn a_velocity_is_as_noisy_as_each_row_reports() {
    let north = |t: f64| if t < 100.0 { 0.3 } else { 0.2 };
    let columns: [(&str, &dyn Fn(f64) -> f64); 3] = [
        ("svn_mps", &north),
        ("sve_mps", &north),
        ("svd_mps", &|t| 0.4 + 1e-3 * noise(t, 1.0)),
    ];
    let text = design(reporting(0.2 / EVEN, &columns));
    let channel = "velocity_sigma = { columns = [\"svn_mps\", \"sve_mps\", \"svd_mps\"], unit = \"m/s\" }";
    assert!(text.contains(channel), "{text}");
    let (scale, least) = noise_of(&text).unwrap();
    // Errors are as reported, within the scatter of a quantile of 300. The added 1σ does not hide the reported ones.
    assert!((0.9..1.2).contains(&scale) && least < 0.25, "{text}");
    // The design can be built.
    assert!(can_be_built(&text), "{text}");
}

#[test]
fn an_optimistic_receiver_gets_the_factor_that_its_own_scatter_shows() {
    let small = |t: f64| 0.05 + 1e-3 * noise(t, 1.0);
    let columns: [(&str, &dyn Fn(f64) -> f64); 3] = [("svn_mps", &small), ("sve_mps", &small), ("svd_mps", &small)];
    let (scale, _) = noise_of(&design(reporting(0.2 / EVEN, &columns))).unwrap();
    // Four times; a quantile of 300 is accurate to a few percent.
    assert!((3.4..4.6).contains(&scale), "{scale}");
}

#[test]
fn what_some_rows_do_not_report_is_one_number() {
    let holes = |t: f64| if t == 7.0 { f64::NAN } else { 0.2 + 1e-3 * noise(t, 1.0) };
    let columns: [(&str, &dyn Fn(f64) -> f64); 3] = [("svn_mps", &holes), ("sve_mps", &holes), ("svd_mps", &holes)];
    let text = design(reporting(0.2 / EVEN, &columns));
    assert!(noise_of(&text).is_none() && !text.contains("svn_mps"), "{text}");
}

#[test]
fn variances_and_one_number_for_all_axes_are_reported_too() {
    let squared = |t: f64| 0.04 + 1e-3 * noise(t, 1.0);
    let columns: [(&str, &dyn Fn(f64) -> f64); 3] = [("var_vn", &squared), ("var_ve", &squared), ("var_vd", &squared)];
    let text = design(reporting(0.2 / EVEN, &columns));
    let channel = "velocity_sigma = { columns = [\"var_vn\", \"var_ve\", \"var_vd\"], unit = \"m^2/s^2\", variance = true }";
    assert!(text.contains(channel), "{text}");
    assert!(noise_of(&text).is_some_and(|(scale, _)| (0.9..1.2).contains(&scale)), "{text}");
    assert!(can_be_built(&text), "{text}");
    let all = |t: f64| 0.2 + 1e-3 * noise(t, 1.0);
    let text = design(reporting(0.2 / EVEN, &[("sAcc [m/s]", &all)]));
    let channel = "velocity_sigma = { columns = [\"sAcc [m/s]\", \"sAcc [m/s]\", \"sAcc [m/s]\"], unit = \"m/s\" }";
    assert!(text.contains(channel), "{text}");
    assert!(can_be_built(&text), "{text}");
}

#[test]
fn names_alone_tell_what_is_reported() {
    let of = |names: &[&str]| {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let all = reported_by_name(&names).into_iter();
        all.map(|r| (r.kind, r.columns, r.unit)).collect::<Vec<_>>()
    };
    let expected = |kind, names: [&str; 3], unit: &str| (kind, names.map(str::to_owned).to_vec(), unit.to_owned());
    assert_eq!(
        of(&["sdn(m)", "sde(m)", "sdu(m)", "sdvn", "sdve", "sdvu"]),
        [
            expected(Kind::PositionSigma, ["sdn(m)", "sde(m)", "sdu(m)"], "m"),
            expected(Kind::VelocitySigma, ["sdvn", "sdve", "sdvu"], "m/s")
        ]
    );
    assert_eq!(
        of(&["velocity_sigma_north", "velocity_sigma_east", "velocity_sigma_down"]),
        [expected(
            Kind::VelocitySigma,
            ["velocity_sigma_north", "velocity_sigma_east", "velocity_sigma_down"],
            "m/s"
        )]
    );
    assert_eq!(
        of(&["vel_accuracy (ft/s)", "speed_accuracy (cm/s)"]),
        [expected(Kind::VelocitySigma, ["speed_accuracy (cm/s)"; 3], "cm/s")]
    );
    // Metres along a track, a number without a unit, and columns that are no 1σ.
    assert_eq!(of(&["s [m]", "sAcc", "std (m)", "dvl_std_m", "vn", "ve", "vd", "accuracy"]), []);
}
