use super::*;

/// Uniform numbers by SplitMix64 (Steele, Lea and Flood 2014), normal ones by Box and Muller.
struct Normal(u64);

impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn next(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (core::f64::consts::TAU * self.uniform()).cos()
    }
}

/// One sample a second of the three noises.
///
/// Flicker noise is a sum of Gauss-Markov processes, their correlation times from a third of a sample
/// to ten logs, by a ratio r: where the spectrum is to be B²/πf (one-sided), each has the variance
/// B² ln r / π. With r = 2 the sum ripples by 0.1 %.
fn simulated(n: usize, true_: Noises, seed: u64) -> Vec<f64> {
    let mut normal = Normal(seed);
    let size = true_.flicker * (2_f64.ln() / core::f64::consts::PI).sqrt();
    let mut times = vec![0.3_f64];
    while times.last().is_some_and(|t| *t < 10.0 * n as f64) {
        times.push(times[times.len() - 1] * 2.0);
    }
    let mut parts: Vec<(f64, f64)> = times.iter().map(|tau| ((-1.0 / tau).exp(), size * normal.next())).collect();
    let mut walk = 0.0;
    (0..n)
        .map(|_| {
            walk += true_.walk * normal.next();
            for (decay, x) in &mut parts {
                *x = *decay * *x + size * (1.0 - *decay * *decay).sqrt() * normal.next();
            }
            true_.white * normal.next() + parts.iter().map(|(_, x)| x).sum::<f64>() + walk
        })
        .collect()
}

/// How far each size moves, relatively, where every σ² of the exact curve is off by its standard error
/// √(2/freedom), each in the worst direction: σ of neighbours are correlated, but not more than that.
fn worst(true_: Noises, curve: &[Point]) -> [f64; 3] {
    let sizes = |n: Noises| [n.white, n.flicker, n.walk];
    let exact: Vec<Point> = curve
        .iter()
        .map(|p| Point {
            sigma: true_.deviation(p.tau),
            ..*p
        })
        .collect();
    let mut sums = [0.0; 3];
    for k in 0..exact.len() {
        let mut off = exact.clone();
        off[k].sigma *= (1.0 + (2.0 / off[k].freedom).sqrt()).sqrt();
        let moved = sizes(Noises::fit(&off).unwrap());
        for (sum, (moved, wanted)) in sums.iter_mut().zip(moved.iter().zip(sizes(true_))) {
            *sum += (moved / wanted - 1.0).abs();
        }
    }
    sums
}

/// White noise passes into flicker noise at τ = N²/(0.441 B²) = 30 s, flicker noise into the random
/// walk at 1000 s. Each size is to be found within twice its worst standard error: 4, 10 and 23 %.
#[test]
fn the_sizes_that_were_simulated_are_found() {
    let wanted = Noises {
        white: 10.0,
        flicker: 2.75,
        walk: 0.1,
    };
    for seed in 1..=3 {
        let curve = deviation(&simulated(400_000, wanted, seed), 1.0);
        let found = Noises::fit(&curve).unwrap();
        let bounds = worst(wanted, &curve);
        let pairs = [
            (found.white, wanted.white),
            (found.flicker, wanted.flicker),
            (found.walk, wanted.walk),
        ];
        for ((found, wanted), bound) in pairs.into_iter().zip(bounds) {
            let error = (found / wanted - 1.0).abs();
            assert!(bound < 0.12 && error < 2.0 * bound, "seed {seed}: {found} of {wanted}, ±{bound}");
        }
    }
}

/// The numbers of the test of NIST SP 1065, table 31: nine frequencies, whose overlapping deviations
/// at one and two samples are printed there.
#[test]
fn the_nbs_test_data_give_their_published_deviations() {
    let frequencies = [892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0];
    // Twice over, so that nine clusters of two samples fit; the first half is the published set.
    let points = deviation(&frequencies.repeat(2), 1.0);
    let direct = |m: usize, data: &[f64]| {
        let mean = |at: usize| data[at..at + m].iter().sum::<f64>() / m as f64;
        let terms = data.len() + 1 - 2 * m;
        let squares: f64 = (0..terms).map(|k| (mean(k + m) - mean(k)).powi(2)).sum();
        (squares / (2.0 * terms as f64)).sqrt()
    };
    // 91.22945 and 85.95287: as published, to all digits printed.
    assert!((direct(1, &frequencies) - 91.22945).abs() < 5e-6);
    assert!((direct(2, &frequencies) - 85.95287).abs() < 5e-6);
    for point in &points {
        let expected = direct(point.tau as usize, &frequencies.repeat(2));
        // 1e-12: sums of a few dozen numbers
        assert!((point.sigma / expected - 1.0).abs() < 1e-12, "{point:?} {expected}");
    }
    assert_eq!(points.len(), 2);
}

#[test]
fn a_curve_of_one_noise_shows_no_other() {
    let only_white = Noises {
        white: 2.0,
        ..Noises::default()
    };
    let curve: Vec<Point> = (0..30)
        .map(|k| {
            let tau = 10_f64.powf(f64::from(k) / 10.0);
            let sigma = only_white.deviation(tau);
            Point {
                tau,
                sigma,
                freedom: 1e4 / tau,
            }
        })
        .collect();
    let found = Noises::fit(&curve).unwrap();
    // The square root of rounding in the squares.
    assert!(
        (found.white - 2.0).abs() < 1e-9 && found.flicker < 1e-6 && found.walk < 1e-6,
        "{found:?}"
    );
}

#[test]
fn what_has_no_curve_is_refused() {
    assert!(deviation(&[1.0; 17], 1.0).is_empty());
    assert_eq!(Noises::fit(&deviation(&[1.0; 100], 1.0)), None);
}

/// A study of three axes with these random walks of the bias.
fn study(walks: [f64; 3]) -> Study {
    let axis = |walk| Axis {
        mean: 0.0,
        curve: vec![Point {
            tau: 50.0,
            sigma: 1e-3,
            freedom: 8.0,
        }],
        noises: Noises {
            white: 1e-3,
            flicker: 0.0,
            walk,
        },
    };
    Study {
        instrument: Instrument::Accelerometer,
        name: "rest.csv".to_owned(),
        span: 450.0,
        rate: 50.0,
        gaps: 0,
        increments: None,
        axes: walks.map(axis),
    }
}

#[test]
fn a_walk_that_no_log_shows_is_left_out_of_a_design() {
    let none = toml(&[study([0.0; 3])]);
    assert!(!none.contains("random_walk =") && none.contains("shows up to τ = 50 s"), "{none}");
    let one = toml(&[study([0.0, 2e-5, 1e-5])]);
    assert!(one.contains("[\"1.00e-5 m/s^2/sqrt(s)\", \"2.00e-5 m"), "{one}");
    assert!(one.contains("shows in x:"), "{one}");
}

#[test]
fn a_moment_is_a_time_from_the_first_sample_a_stamp_or_a_date() {
    assert_eq!(Moment::parse("120"), Some(Moment::Elapsed(120.0)));
    assert_eq!(Moment::parse("@1520530308.5"), Some(Moment::Stamp(1_520_530_308.5)));
    // The first day of GPS time; leap seconds came later.
    assert_eq!(Moment::parse("1980-01-07T00:00:00Z"), Some(Moment::Stamp(86_400.0)));
    for wrong in ["", "@", "noon", "inf", "12:00"] {
        assert_eq!(Moment::parse(wrong), None, "{wrong}");
    }
}
