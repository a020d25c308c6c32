//! Samples that cannot be, or that only seem so.

use super::*;

#[test]
fn a_single_sample_of_any_size_is_no_input() {
    let clean = belief_after(&only_input(rows(200, 0..0)));
    for spike in [3.5, -50.0, 1e9] {
        let mut rows = only_input(rows(200, 0..0));
        rows[150].2 = spike;
        let mut runner = runner(0.0);
        let told = told(&mut runner, &rows);
        assert_eq!(told.iter().filter(|e| e.starts_with("Discarded")).count(), 1, "{spike}");
        assert!(
            told.iter().any(|e| *e == "Discarded process 1.500000 s 150 Spike { column: 0 }"),
            "{told:?}"
        );
        // The sample after it covers the time of both.
        assert!((runner.belief().x[1] - clean.x[1]).abs() < 1e-12);
    }
}

#[test]
fn a_change_that_stays_waits_and_is_used_from_its_first_sample_on() {
    let mut rows = only_input(rows(200, 0..0));
    rows[150..].iter_mut().for_each(|row| row.2 = 21.0);
    let mut runner = runner(0.0);
    let mut refused = 0;
    let mut observer = |event: &Event<'_>| refused += usize::from(matches!(event, Event::Discarded { .. }));
    let velocity = [149, 150, 151, 152, 199].map(|k| {
        let fed = rows.iter().take_while(|row| row.1 <= centi(k)).count();
        let new: Rows = rows.drain(..fed).collect();
        feed(&mut runner, &new, &mut observer);
        runner.belief().x[1]
    });
    // 1e-12: rounding of 200 steps.
    let is_near = |v: &[f64], wanted: &[f64]| v.iter().zip(wanted).all(|(v, w)| (v - w).abs() < 1e-12);
    assert!(is_near(&velocity, &[1.49, 1.49, 1.49, 2.12, 11.99]), "{velocity:?}");
    assert_eq!(refused, 0);
}

#[test]
fn two_samples_that_return_are_spikes_and_three_are_not() {
    let refused = |values: &[f64]| {
        let mut rows = only_input(rows(200, 0..0));
        rows[150..].iter_mut().zip(values).for_each(|(row, value)| row.2 = *value);
        told(&mut runner(0.0), &rows).iter().filter(|e| e.contains("Spike")).count()
    };
    assert_eq!(refused(&[9.0, 9.0]), 2);
    assert_eq!(refused(&[9.0, -35.0]), 2);
    assert_eq!(refused(&[9.0, 9.0, 9.0]), 0);
    // Less than half of the jump from 1 to 9 ends below 5; then 4.9 is one, too.
    assert_eq!(refused(&[9.0, 4.9]), 2);
    assert_eq!(refused(&[9.0, 5.1, 5.1]), 0);
}

#[test]
fn shocks_that_come_again_and_again_are_soon_no_spikes() {
    // One in ten samples is a shock: nothing is known about the first few, and their size is learnt.
    let mut rows = only_input(rows(4000, 0..0));
    rows.iter_mut().skip(100).step_by(10).for_each(|row| row.2 = 9.0);
    let refused = told(&mut runner(0.0), &rows);
    let refused: Vec<_> = refused.iter().filter(|e| e.contains("Spike")).collect();
    assert!((1..40).contains(&refused.len()), "{}", refused.len());
    // A spike of another size is still a spike.
    rows[3005].2 = 1e6;
    let told = told(&mut runner(0.0), &rows);
    assert_eq!(told.iter().filter(|e| e.contains("Spike")).count(), refused.len() + 1);
    assert!(told.iter().any(|e| e.starts_with("Discarded process 30.050000 s")));
}

#[test]
fn what_waits_before_a_gap_or_the_end_was_a_spike() {
    let mut rows = only_input(rows(300, 151..200));
    rows[149..151].iter_mut().for_each(|row| row.2 = 21.0);
    rows.last_mut().unwrap().2 = 21.0;
    let told = told(&mut runner(0.0), &rows);
    let refused: Vec<_> = told.iter().filter(|e| e.contains("Spike")).collect();
    assert_eq!(refused.len(), 3, "{refused:?}");
    // The gap begins before them.
    let gap = format!("Resumed {{ since: {:?}", centi(148));
    assert!(
        told.iter().any(|e| e.starts_with(&gap)),
        "{gap} {:?}",
        told.iter().find(|e| e.starts_with("Resumed"))
    );
}

#[test]
fn noise_of_any_size_is_no_spike() {
    // Uniform between ±40: changes of 27 on average, at most 80, the agility being 2.
    let mut rows = only_input(rows(20_000, 0..0));
    let mut random = crate::testing::Lcg::new(3);
    rows.iter_mut().for_each(|row| row.2 = 40.0 * random.signed());
    let told = told(&mut runner(0.0), &rows);
    assert!(!told.iter().any(|e| e.starts_with("Discarded")));
}

#[test]
fn an_instrument_that_freezes_is_no_input_and_one_that_is_always_constant_is() {
    let frozen = |rows: &Rows| told(&mut runner(0.0), rows).iter().filter(|e| e.ends_with("Frozen")).count();
    assert_eq!(frozen(&only_input(rows(2000, 0..0))), 0);
    let mut changing = only_input(rows(2000, 0..0));
    changing.iter_mut().enumerate().for_each(|(k, row)| row.2 = (k as f64 * 0.1).sin());
    assert_eq!(frozen(&changing), 0);
    // 50 repetitions of sample 1000; the first ten may be chance.
    (1001..1051).for_each(|k| changing[k].2 = changing[1000].2);
    assert_eq!(frozen(&changing), 40);
}

#[test]
fn a_number_beyond_the_range_of_its_instrument_is_no_input_however_often_it_comes() {
    let mut runner = runner(0.0);
    runner.limit_input(InputLimits {
        range: vec![5.0],
        ..InputLimits::default()
    });
    let mut rows = only_input(rows(200, 0..0));
    rows[150..155].iter_mut().for_each(|row| row.2 = -5.1);
    let told = told(&mut runner, &rows);
    let refused: Vec<_> = told.iter().filter(|e| e.ends_with("OutOfRange { column: 0 }")).collect();
    assert_eq!(refused.len(), 5);
}
