//! How improbable a figure has to be before a rule reports it. One level is shared by all rules.

use crate::rules::ALL;
use fusion::score::Consistency;
use fusion_core::consistency::{chi_square_quantile, chi_square_tail};
use fusion_core::math;
use statrs::distribution::{Binomial, ContinuousCDF, DiscreteCDF, StudentsT};

/// The probability that a consistent run has a finding by chance.
pub(crate) const BY_CHANCE: f64 = 0.05;

/// Rules that state a fact, which is not there by chance: `log-damaged`.
const FACTS: usize = 1;

/// The level of one of `tests` figures that a rule judges: the probability of a finding by chance is shared equally by
/// the rules, and by the figures of a rule (Bonferroni).
pub(crate) fn level(tests: usize) -> f64 {
    BY_CHANCE / ((ALL.len() - FACTS) * tests.max(1)) as f64
}

/// The number of its 1σ beyond which one of `tests` normal figures is improbable, on either side.
pub(crate) fn sigmas(tests: usize) -> f64 {
    // The square of a normal number is χ² with one degree of freedom.
    math::sqrt(chi_square_quantile(1.0 - level(tests), 1.0))
}

/// The number of its standard errors beyond which one of `tests` figures is improbable, on either side, if the scatter
/// between so many `parts` of a log gives the standard error.
pub(crate) fn standard_errors(tests: usize, parts: usize) -> f64 {
    beyond(level(tests), parts)
}

/// The number of standard errors beyond which a figure is with this probability, on either side. The scatter between
/// `parts` gives the standard error, so this is Student's t.
pub(crate) fn beyond(probability: f64, parts: usize) -> f64 {
    let t = StudentsT::new(0.0, 1.0, parts.saturating_sub(1) as f64);
    t.map_or(f64::INFINITY, |t| t.inverse_cdf(1.0 - 0.5 * probability))
}

/// Whether the mean of the squares of so many `independent` normal numbers of variance 1 is improbably small. It is one
/// of `tests` figures.
pub(crate) fn is_small_variance(mean: f64, independent: f64, tests: usize) -> bool {
    independent > 0.0 && 1.0 - chi_square_tail(mean * independent, independent) < level(tests)
}

/// Whether a mean statistic is improbably large. It is one of `tests` figures.
pub(crate) fn is_large_mean(c: &Consistency, tests: usize) -> bool {
    c.independent > 0.0 && chi_square_tail(c.mean * c.independent, c.dof as f64 * c.independent) < level(tests)
}

/// Whether `found` or more of `all` are improbable if each has this `probability`. It is one of `tests` figures.
pub(crate) fn is_more_than(found: u64, all: u64, probability: f64, tests: usize) -> bool {
    let at_most = found.checked_sub(1).zip(Binomial::new(probability, all).ok());
    at_most.is_some_and(|(fewer, chance)| chance.sf(fewer) < level(tests))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_level_is_shared_by_rules_and_figures() {
        let all: f64 = (0..7).map(|_| level(7)).sum::<f64>() * (ALL.len() - FACTS) as f64;
        assert!((all - BY_CHANCE).abs() < 1e-12, "{all}");
        // Two-sided: 5 % shared by 49 rules is 1.02e-3, beyond 3.28σ.
        assert!(
            (3.2..3.4).contains(&sigmas(1)) && sigmas(1000) > 4.5,
            "{} {}",
            sigmas(1),
            sigmas(1000)
        );
    }

    #[test]
    fn few_parts_ask_for_more_standard_errors() {
        // Tables of Student's t: 5 % with 19 degrees of freedom, 0.1 % with 8.
        assert!((beyond(0.05, 20) - 2.093).abs() < 1e-3 && (beyond(0.001, 9) - 5.041).abs() < 1e-3);
        assert!(standard_errors(1, 8) > standard_errors(1, 20) && standard_errors(100, 20) > standard_errors(1, 20));
        // With many parts it is a normal number.
        assert!((standard_errors(7, 100_000) - sigmas(7)).abs() < 1e-2);
        assert_eq!(beyond(0.05, 1), f64::INFINITY);
    }

    #[test]
    fn counts_and_means_are_compared_with_chance() {
        // Three of 18 with 1.11 % each: C(18, 3) 0.0111³ 0.9889¹⁵ = 0.94e-3, and 1.3e-3 of 20.
        let p = (-4.5_f64).exp();
        assert!(is_more_than(3, 18, p, 1) && !is_more_than(3, 20, p, 1) && !is_more_than(0, 20, p, 1));
        // The 1σ of the mean of 300 χ² of 3 is 3 √(2/900) = 0.14.
        let mean = |mean: f64| Consistency {
            mean,
            dof: 3,
            count: 300,
            independent: 300.0,
            band: (0.0, 0.0),
        };
        assert!(is_large_mean(&mean(3.6), 1) && !is_large_mean(&mean(3.35), 1));
    }

    #[test]
    fn a_variance_is_small_only_beyond_the_chance_of_its_numbers() {
        // The 1σ of the mean of 200 squares is √(2/200) = 0.1; 3.1 of them, and a skewed tail.
        assert!(is_small_variance(0.6, 200.0, 1) && !is_small_variance(0.75, 200.0, 1));
        assert!(!is_small_variance(0.6, 20.0, 1) && !is_small_variance(0.0, 0.0, 1));
    }
}
