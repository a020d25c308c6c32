//! The designs under configs/backends: that each of them runs in every variant, and the order of the backends
//! where the effect is large.

use fusion::config::Document;
use fusion::design::{Design, FilterSpec};
use fusion::run::{Options, run};
use fusion_judge::campaign::{Pooled, monte_carlo};
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/backends")
}

fn design(file: &Path, variant: Option<&str>, backend: Option<&str>) -> Design {
    let mut document = Document::load(file).unwrap_or_else(|d| panic!("{d}"));
    if let Some(variant) = variant {
        document.overlay(&format!("variant.{variant}")).unwrap_or_else(|d| panic!("{d:?}"));
    }
    if let Some(words) = backend {
        document.set(&FilterSpec::table_of(words).unwrap()).unwrap();
    }
    Design::read(document).unwrap_or_else(|d| panic!("{}: {d}", file.display()))
}

#[test]
fn every_scene_runs_in_every_variant_and_says_whether_it_converged() {
    let scenes = std::fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path());
    let mut count = 0;
    for file in scenes.filter(|path| path.extension().is_some_and(|e| e == "toml")) {
        let variants: Vec<String> = toml::from_str::<toml::Table>(&std::fs::read_to_string(&file).unwrap())
            .unwrap()
            .get("variant")
            .and_then(|v| v.as_table())
            .map_or_else(Vec::new, |v| v.keys().cloned().collect());
        for variant in core::iter::once(None).chain(variants.iter().map(|v| Some(v.as_str()))) {
            let summary = run(&design(&file, variant, None), &Options::default(), &mut |_| {});
            let summary = summary.unwrap_or_else(|d| panic!("{}: {d}", file.display()));
            assert!(summary.score().unwrap().convergence.is_some(), "{} {variant:?}", file.display());
            count += 1;
        }
    }
    // Three scenes, three variants of them besides.
    assert!(count >= 6, "{count}");
}

fn ten_runs(backend: &str) -> Pooled {
    let design = design(&folder().join("range-only.toml"), None, Some(backend));
    let campaign = monte_carlo(&design, &Options::default(), 0..10, 1, 0, &|_| {});
    campaign.unwrap_or_else(|d| panic!("{d}")).campaign.pooled()
}

/// Of 200 runs with ranges alone 51 % converge in time linearised once, 96 % iterated, 22 % linearised once in an
/// invariant chart, and all of them iterated in it; NEES 1400, 53, 1400 and 1.7.
#[test]
fn ranges_alone_need_both_the_chart_and_the_iteration() {
    let [once, iterated, chart, both] = ["error_state", "iekf", "invariant", "invariant+iterated"].map(ten_runs);
    let nees = |of: &Pooled| of.nees[0].unwrap();
    assert_eq!(both.converged, Some(1.0));
    // 1.3 here, 1.7 over 200 runs; the next best has 9.5 here.
    assert!(nees(&both) < 4.0, "{both:?}");
    for other in [&once, &chart] {
        assert!(other.converged.unwrap() < 0.9, "{other:?}");
        assert!(nees(other) > 20.0 * nees(&both), "{other:?} {both:?}");
    }
    assert!(nees(&iterated) > nees(&both) && nees(&iterated) < nees(&once), "{iterated:?}");
}
