//! Outages, gaps and the start.

use super::*;
use fusion::run::Start;

#[test]
fn outages_that_end_beyond_three_sigma_are_found_where_chance_does_not_explain_them() {
    let outages = |bold: usize, all: usize| -> Vec<Drift> {
        let drift = |k| Drift {
            end_horizontal: if k < bold { 31.0 } else { 29.0 },
            end_sigma: 10.0,
            ..Drift::default()
        };
        (0..all).map(drift).collect()
    };
    // The level of one figure of a rule is 0.10 %. The probability of k or more of n: 1.1 % (1, 1), 0.7 % (2, 12), 0.04 %
    // (2, 3), 0.13 % (3, 20), 0.09 % (3, 18).
    for (bold, all, is_told) in [
        (0, 5, false),
        (1, 1, false),
        (2, 3, true),
        (2, 12, false),
        (3, 18, true),
        (3, 20, false),
        (9, 9, true),
    ] {
        let found = bold_outages(&outages(bold, all));
        assert_eq!(found.is_some(), is_told, "{bold} of {all}: {found:?}");
    }
    let told = bold_outages(&outages(3, 12)).unwrap().to_string();
    assert!(
        told.starts_with("at the end of 3 of 12 outages the error is more than 3σ"),
        "{told}"
    );
}

#[test]
fn one_outage_is_told_by_its_size_and_with_what_moved_the_estimate() {
    let outages = |worst: f64, moved: f64| -> Vec<Drift> {
        let drift = |k: u32| Drift {
            from: 60.0 * f64::from(k),
            end_horizontal: if k == 5 { 4.0 * worst } else { 4.0 },
            end_sigma: 4.0,
            moved: Some(Moved {
                sensor: "standing".to_owned(),
                time: 312.3,
                sigmas: moved,
            }),
            ..Drift::default()
        };
        (0..13).map(drift).collect()
    };
    // 13 exp(−x²/2) is 1.3e-3 at 4.3σ and 0.8e-3 at 4.4σ; one of 13 beyond 3σ is 13 %.
    assert!(bold_outages(&outages(10.1, 9.0)).is_none() && far_outage(&outages(4.3, 9.0)).is_none());
    let told = far_outage(&outages(4.4, 9.0)).unwrap();
    assert!(
        told.evidence.contains("outage at 300.0 s the error is 17.6 m, 4.4 times") && told.advice.contains("`standing` at 312.3 s"),
        "{told}"
    );
    // Behaviour that a consistent filter shows now and then is not reported.
    assert!(!far_outage(&outages(10.1, 1.9)).unwrap().advice.contains("standing"));
    let summary = Summary::default().with(Score {
        drift: outages(10.1, 9.0),
        ..Score::default()
    });
    let found = judged(&[], &summary).findings();
    assert!(found.iter().any(|f| f.about == "outages"), "{found:?}");
}

#[test]
fn a_start_in_the_last_quarter_is_told_with_what_it_waited_for() {
    let of = |seconds: f64| {
        Summary::default().with(Start {
            started: Some(5.0 + seconds),
            waited: Some(fusion::observe::Wait {
                seconds,
                of: 40.0,
                waited: vec![("levelling".to_owned(), "a rest".to_owned())],
            }),
            ..Start::default()
        })
    };
    let line = |summary: &Summary| summary.late_start().map(ToString::to_string);
    let told = |summary: &Summary| judged(&[], summary).findings().first().map(ToString::to_string);
    // A twentieth is 2 s, a quarter 10 s.
    assert_eq!((line(&of(2.0)), told(&of(2.0))), (None, None));
    let early = line(&of(4.0)).unwrap();
    let said = "10 % of the log is before it and was not used: `levelling` waited for a rest";
    assert!(early == said && told(&of(10.0)).is_none(), "{early}");
    let late = told(&of(39.0)).unwrap();
    assert!(
        late.starts_with("the filter started at 44.0 s; 98 % of the log") && late.contains("waited for a rest"),
        "{late}"
    );
}

#[test]
fn a_silence_that_separates_recordings_is_no_gap() {
    let report = fusion::rows::SourceReport {
        used: 1001,
        first: Some(Time::default()),
        last: Some(Time::from_seconds(100.0)),
        longest_gap: Some((Time::from_seconds(2.0), 8.1)),
        ..Default::default()
    };
    let summary = Summary::default().with(vec![fusion::run::SourceStatistics::new("receiver", &report)]);
    let instruments = [instrument(None)];
    let of = |restart_after| Facts {
        restart_after,
        ..judged(&instruments, &summary)
    };
    let is_told = |judged: Facts<'_>| judged.findings().iter().any(|f| f.evidence.contains("no row for 8.1 s"));
    assert!(is_told(of(None)) && is_told(of(Some(10.0))) && !is_told(of(Some(5.0))));
}
