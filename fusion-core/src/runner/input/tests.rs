//! The input alone: rows in, samples out; gaps, suspects, and the mean of the input.

use super::*;
use crate::linear::Transition;
use crate::model::{Input, Process};
use crate::runner::rows::Stored;
use crate::runner::{Discard, InputLimits, Port, Row};
use crate::time::Time;

/// Reads one number, which it can change by 2 from one sample to the next.
#[derive(Debug)]
struct Motion;

impl Process for Motion {
    fn input_dim(&self) -> usize {
        1
    }
    fn propagate(&self, _: &mut [f64], _: &Input<'_>, _: f64) {}
    fn linearise(&self, _: &[f64], _: &Input<'_>, _: f64, _: &mut Transition) {}
    fn agility(&self) -> &[f64] {
        &[2.0]
    }
}

fn centi(k: i64) -> Time {
    Time::from_nanos(k * 10_000_000)
}

/// Reads the second column of a stream. A gap of more than half a second is too long to coast through.
fn intake() -> Intake {
    let port = Port {
        stream: 0,
        columns: vec![1],
        delay: 0,
    };
    let mut intake = Intake::new(port, &Motion);
    intake.keep_window(true);
    intake.limit(InputLimits {
        range: vec![1e5],
        longest_gap: 0.5,
        ..InputLimits::default()
    });
    intake
}

fn read(intake: &mut Intake, time: Time, value: f64) -> Reading {
    let mut stored = Stored::default();
    stored.take(&Row::new(0, time, &[f64::NAN, value]), time);
    intake.read(time, &stored)
}

/// Offers a row. Returns the judgement; the row is used if it passes, and kept if it waits.
fn offer(intake: &mut Intake, time: Time, value: f64) -> Result<(Judged, Option<Taken>), Discard> {
    let reading = read(intake, time, value);
    intake.admit(&reading)?;
    let judged = intake.judge(&reading);
    let taken = match judged {
        Judged::Passes => Some(intake.take(&reading)),
        Judged::Waits => {
            intake.wait(reading);
            None
        }
        _ => None,
    };
    Ok((judged, taken))
}

/// Rows of value 1 every 10 ms, from the first to before the last; no sample is left to run over.
fn feed(intake: &mut Intake, rows: core::ops::Range<i64>) {
    for k in rows {
        let passes = offer(intake, centi(k), 1.0).unwrap();
        assert_eq!(passes.0, Judged::Passes);
    }
    samples(intake);
}

/// The samples that are ready: beginning, end and number.
fn samples(intake: &mut Intake) -> Vec<(Time, Time, f64)> {
    let mut all = Vec::new();
    while let Some(sample) = intake.next() {
        assert_eq!(sample.input().interval, sample.end.seconds_since(sample.start));
        intake.expect(&sample);
        all.push((sample.start, sample.end, sample.input().sample[0]));
        intake.take_back(sample);
    }
    all
}

#[test]
fn a_row_closes_an_interval_and_opens_the_next() {
    let mut intake = intake();
    assert_eq!(offer(&mut intake, centi(1), 5.0), Ok((Judged::Passes, Some(Taken::First))));
    assert_eq!(samples(&mut intake), vec![]);
    assert_eq!(intake.latest(), Some(&[5.0][..]));
    for k in [2, 4] {
        assert_eq!(offer(&mut intake, centi(k), k as f64), Ok((Judged::Passes, Some(Taken::Sample))));
    }
    assert_eq!(samples(&mut intake), [(centi(1), centi(2), 2.0), (centi(2), centi(4), 4.0)]);
    assert_eq!(intake.end(), Some(centi(4)));
}

#[test]
fn a_row_that_cannot_be_used_changes_nothing() {
    let mut intake = intake();
    feed(&mut intake, 0..20);
    let refused = |intake: &mut Intake, k, value| offer(intake, centi(k), value).unwrap_err();
    assert_eq!(refused(&mut intake, 20, f64::NAN), Discard::NotFinite);
    assert_eq!(refused(&mut intake, 20, -2e5), Discard::OutOfRange { column: 0 });
    assert_eq!(refused(&mut intake, 19, 1.0), Discard::Late { now: centi(19) });
    assert_eq!((intake.end(), samples(&mut intake)), (Some(centi(19)), vec![]));
}

#[test]
fn a_silence_is_coasted_through_on_a_grid_until_it_is_too_long() {
    let mut intake = intake();
    feed(&mut intake, 0..20);
    // A sample covers ten usual intervals. A step is due once a later row is served.
    assert_eq!(intake.silence(centi(29)), None);
    assert_eq!(intake.silence(centi(30)), Some(Silence::Coasts(centi(29))));
    for step in [29, 39, 49, 59, 69] {
        assert_eq!(intake.silence(Time::MAX), Some(Silence::Coasts(centi(step))));
        intake.coast(centi(step));
        assert!(intake.is_coasting());
    }
    assert_eq!(intake.silence(centi(79)), None);
    assert_eq!(intake.silence(Time::MAX), Some(Silence::Stops(centi(79))));
    intake.close();
    assert_eq!((intake.silence(Time::MAX), intake.latest()), (None, None));
    assert_eq!(offer(&mut intake, centi(90), 1.0), Ok((Judged::Passes, Some(Taken::First))));
}

#[test]
fn the_row_after_a_gap_covers_one_usual_interval_but_no_time_that_was_coasted_through() {
    for (coasted, row, start) in [(None, 31, 30), (Some(29), 31, 30), (Some(29), 30, 29), (Some(39), 39, 39)] {
        let mut intake = intake();
        feed(&mut intake, 0..20);
        assert_eq!(intake.expected().unwrap().sample, [1.0]);
        coasted.into_iter().for_each(|to| intake.coast(centi(to)));
        // Half an interval later, so that no row is late.
        let time = centi(row).shifted(if row == 39 { 5_000_000 } else { 0 });
        let reading = read(&mut intake, time, 3.0);
        let resumes = Taken::Resumes {
            since: centi(19),
            start: centi(start),
        };
        assert_eq!(intake.take(&reading), resumes, "{coasted:?} {row}");
        assert_eq!(samples(&mut intake), vec![]);
        intake.resume(centi(start), &reading);
        assert_eq!(samples(&mut intake), [(centi(start), time, 3.0)]);
        // Samples before the gap predict nothing after it.
        assert!(!intake.is_coasting() && intake.expected().is_none());
    }
}

#[test]
fn a_jump_waits_until_the_next_rows_refute_or_confirm_it() {
    let jumped = || {
        let mut intake = intake();
        feed(&mut intake, 0..20);
        assert_eq!(offer(&mut intake, centi(20), 50.0), Ok((Judged::Waits, None)));
        intake
    };
    let spike = Discard::Spike { column: 0 };
    // The next row is as the one before the jump.
    let mut intake = jumped();
    assert_eq!(offer(&mut intake, centi(21), 1.0), Ok((Judged::Refutes, None)));
    let (suspect, why) = intake.settle().unwrap();
    assert_eq!((suspect.time, why), (centi(20), spike));
    intake.refuse(&suspect);
    assert_eq!((intake.settle().is_none(), intake.end()), (true, Some(centi(19))));
    // Two more rows are as the jump.
    let mut intake = jumped();
    assert_eq!(offer(&mut intake, centi(21), 50.0), Ok((Judged::Waits, None)));
    assert_eq!(offer(&mut intake, centi(22), 50.0), Ok((Judged::Confirms, None)));
    while let Some((suspect, _)) = intake.settle() {
        assert_eq!(intake.take(&suspect), Taken::Sample);
        intake.give_back(suspect);
    }
    assert_eq!(samples(&mut intake), [(centi(19), centi(20), 50.0), (centi(20), centi(21), 50.0)]);
    // No row follows. The silence begins at the row that waits.
    let intake = jumped();
    assert_eq!(intake.silence(centi(30)), None);
    assert_eq!(intake.silence(centi(31)), Some(Silence::Settles));
}

#[test]
fn an_input_with_the_memory_of_another_continues_in_the_same_way() {
    let mut original = intake();
    feed(&mut original, 0..20);
    assert_eq!(offer(&mut original, centi(20), 50.0), Ok((Judged::Waits, None)));
    let mut twin = intake();
    crate::testing::check_memory(&mut original, &mut twin).unwrap();
    let [first, second] = [original, twin].map(|mut intake| {
        let judged = offer(&mut intake, centi(21), 1.0);
        let (suspect, why) = intake.settle().unwrap();
        intake.refuse(&suspect);
        let taken = offer(&mut intake, centi(21), 1.0);
        (judged, suspect.time, why, taken, samples(&mut intake))
    });
    assert_eq!(first, second);
}

/// Row number k of a ramp, the mean over the 10 ms before it: a mean of such rows is the value in its middle.
fn ramp(k: i64) -> f64 {
    k as f64 - 0.5
}

/// The mean of the input about `time`, if rows up to number `taken` were taken, and `coming` are present.
fn mean(intake: &mut Intake, time: Time, coming: &[(i64, f64)]) -> (Time, Option<f64>) {
    let rows: Vec<(Time, [f64; 2])> = coming.iter().map(|(k, value)| (centi(*k), [0.0, *value])).collect();
    let certain = rows.last().map_or(Time::MIN, |(time, _)| *time);
    let mean = intake.average(time, None, certain, rows.iter().map(|(time, row)| (*time, &row[..])));
    (mean.looked, mean.is_known.then(|| intake.mean().sample[0]))
}

/// Rows of the ramp have been taken.
fn ramped(rows: impl Iterator<Item = i64>) -> Intake {
    let mut intake = intake();
    for k in rows {
        let reading = read(&mut intake, centi(k), ramp(k));
        if let Taken::Resumes { start, .. } = intake.take(&reading) {
            intake.resume(start, &reading);
        }
        intake.give_back(reading);
    }
    samples(&mut intake);
    intake
}

#[test]
fn the_input_is_averaged_as_far_after_as_before() {
    let mut intake = ramped(0..240);
    let coming: Vec<(i64, f64)> = (240..260).map(|k| (k, ramp(k))).collect();
    for before in [0, 3_000_000, 8_000_000] {
        let time = centi(239).shifted(-before);
        let (looked, found) = mean(&mut intake, time, &coming);
        let middle = time.seconds() * 100.0;
        // 100 ε of the sum of ten numbers of 250.
        assert!((found.unwrap() - middle).abs() < 1e-10, "{found:?} {middle}");
        // The first row that ends 50 ms after the time, or later.
        assert_eq!(looked, centi(244));
    }
    // Half of the window is missing: the mean is that of the 100 ms before.
    let (looked, found) = mean(&mut intake, centi(239), &[]);
    assert!((found.unwrap() - 234.0).abs() < 1e-10, "{found:?}");
    assert_eq!(looked, Time::MIN);
    // There is no input about this time.
    assert_eq!(mean(&mut intake, centi(700), &coming).1, None);
}

#[test]
fn a_row_that_is_still_to_come_and_not_plausible_is_left_out_of_the_mean() {
    let mut intake = ramped(0..240);
    for wrong in [f64::NAN, 1e9] {
        let coming: Vec<(i64, f64)> = (240..260).map(|k| (k, if k == 241 { wrong } else { ramp(k) })).collect();
        let found = mean(&mut intake, centi(239), &coming).1.unwrap();
        // The ten intervals of 234.5 to 243.5 without that of 240.5.
        assert!((found - (2390.0 - 240.5) / 9.0).abs() < 1e-10, "{found}");
    }
}

#[test]
fn after_a_gap_the_input_is_averaged_from_where_it_resumed() {
    let mut intake = ramped((0..300).chain(400..404));
    let coming: Vec<(i64, f64)> = (404..420).map(|k| (k, ramp(k))).collect();
    let found = mean(&mut intake, centi(403), &coming).1.unwrap();
    // The first sample covers the 10 ms before it: the mean is over 3.99 s to 4.08 s.
    assert!((found - 403.5).abs() < 1e-10, "{found}");
}
