//! Findings about calibrations that moved while innovations were too large.

use super::super::instrument::Reports;
use super::*;
use fusion::observe::{Excess, Moved};
use fusion::rows::SourceReport;
use fusion::run::SourceStatistics;

fn latency() -> Moved {
    Moved {
        name: "gnss.time_offset".to_owned(),
        is_vector: false,
        axis: 0,
        from: 0.0,
        to: -0.2,
        sigma: 0.05,
        sigmas: 4.0,
        unit: "s".to_owned(),
    }
}

fn excess(sensor: &str, nis: f64) -> Excess {
    Excess {
        sensor: sensor.to_owned(),
        from: 12.0,
        to: 110.0,
        measurements: 98,
        nis,
        dof: 3,
        moved: vec![latency()],
    }
}

/// A velocity of a receiver whose file has these unread columns.
fn told(unread: &[&str], reports: Option<Reports>, nis: f64, excesses: Vec<Excess>) -> Vec<String> {
    let velocity = Instrument {
        measures: Some(Measures::Velocity),
        reports,
        ..instrument(None)
    };
    let other = Instrument {
        name: "wheels".to_owned(),
        ..instrument(None)
    };
    let report = SourceReport {
        unread: unread.iter().map(|name| (*name).to_owned()).collect(),
        ..SourceReport::default()
    };
    let summary = Summary::default()
        .with(vec![sensor(nis)])
        .with(vec![SourceStatistics::new("receiver", &report)])
        .with(excesses);
    let instruments = [velocity, other];
    judged(&instruments, &summary).findings().iter().map(ToString::to_string).collect()
}

fn reports(is_declared: bool) -> Option<Reports> {
    Some(Reports {
        channel: "velocity_sigma".to_owned(),
        width: 3,
        is_declared,
        sigma: "\"4 cm/s\"".to_owned(),
    })
}

#[test]
fn a_calibration_that_moved_is_told_with_the_columns_that_nothing_reads() {
    let columns = ["q", "sn_m", "se_m", "su_m", "svn_mps", "sve_mps", "svd_mps"];
    let all = told(&columns, reports(false), 3.0, vec![excess("gnss", 12.0)]);
    let evidence = "innovations of `gnss` were 2 times what is expected from 12.0 s to 110.0 s (mean NIS 12 of 3 over 98 measurements), and \
                    `gnss.time_offset` moved from 0 to -0.2 s, 4 times the 1σ of 0.05 s that it had";
    assert!(all.len() == 1 && all[0].starts_with(evidence), "{all:#?}");
    let edit = "`svn_mps`, `sve_mps`, `svd_mps`: write `source.receiver.channels.velocity_sigma = { columns = [\"svn_mps\", \"sve_mps\", \
                \"svd_mps\"], unit = \"m/s\" }` and write `sensor.gnss.noise = { sigma = \"4 cm/s\", from_source = true }`";
    assert!(all[0].contains(edit), "{all:#?}");
    // A channel that is in the file only has to be used.
    let all = told(&[], reports(true), 3.0, vec![excess("gnss", 12.0)]);
    assert!(
        all[0].contains("in its channel `velocity_sigma`: write `sensor.gnss.noise"),
        "{all:#?}"
    );
    // The noise is named if there are no such columns, or they are of another quantity or fewer axes, or the sensor
    // uses them.
    let others = [
        told(&["q"], reports(false), 3.0, vec![excess("gnss", 12.0)]),
        told(&["sn_m", "se_m", "su_m"], reports(false), 3.0, vec![excess("gnss", 12.0)]),
        told(&["sigma_vn", "sigma_ve"], reports(false), 3.0, vec![excess("gnss", 12.0)]),
        told(&columns, None, 3.0, vec![excess("gnss", 12.0)]),
    ];
    for all in others {
        let advice = "either the `noise` of `gnss` is 2 times too small then";
        assert!(all.len() == 1 && all[0].contains(advice) && !all[0].contains("write"), "{all:#?}");
    }
}

#[test]
fn columns_are_named_where_all_innovations_are_too_large_and_a_sensor_is_told_once() {
    let columns = ["svn_mps", "sve_mps", "svd_mps"];
    let all = told(&columns, reports(false), 12.0, vec![excess("gnss", 12.0)]);
    assert_eq!(all.len(), 1, "{all:#?}");
    let evidence = "NIS of `gnss` is 12 of 3, innovations are 2 times what is expected; from 12.0 s to 110.0 s `gnss.time_offset` moved";
    assert!(all[0].starts_with(evidence) && all[0].contains("`svn_mps`"), "{all:#?}");
    // This is too much for noise.
    let all = told(&columns, reports(false), 400.0, Vec::new());
    assert!(all.iter().all(|told| !told.contains("svn_mps")), "{all:#?}");
}

#[test]
fn what_two_sensors_moved_at_a_time_is_told_of_the_one_with_the_larger_innovations() {
    let both = |nis: f64, from: f64| {
        let other = Excess {
            from,
            to: from + 50.0,
            ..excess("wheels", nis)
        };
        let all = told(&[], None, 3.0, vec![excess("gnss", 12.0), other]);
        all.iter()
            .map(|told| told.split('`').nth(1).unwrap_or_default().to_owned())
            .collect::<Vec<_>>()
    };
    assert_eq!(both(6.0, 50.0), ["gnss"]);
    assert_eq!(both(24.0, 50.0), ["wheels"]);
    // At another time it is a separate move.
    assert_eq!(both(6.0, 300.0), ["gnss", "wheels"]);
}
