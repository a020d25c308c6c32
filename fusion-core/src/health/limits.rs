//! The limits by which a filter's health is judged.

use crate::model::Literal;

/// Bounds of health.
#[derive(Clone, Copy, Debug, PartialEq, Literal)]
#[literal(at = "fusion_core::health")]
pub struct Limits {
    /// A filter is aligned once no axis of its attitude has a greater 1σ \[rad\]. It stays aligned until an axis has
    /// twice as much.
    pub aligned: f64,
    /// Gaps of the input up to this length are ignored \[s\].
    pub coasting: f64,
    /// Innovations, root mean square in units of their σ, beyond which the filter is degraded.
    pub innovations: f64,
    /// And beyond which it is lost.
    pub innovations_lost: f64,
    /// The mean time \[s\] between false alarms of the test for a mean of innovations, for a filter without error.
    /// Infinite switches the test off.
    pub false_alarm: f64,
    /// The time over which innovations are averaged \[s\]; ten measurements at least.
    pub window: f64,
    /// The time for which a sensor may be rejected \[s\]: three measurements at least.
    pub rejected: f64,
    /// The time of rejections after which the filter is lost, if no other sensor has been used meanwhile \[s\].
    pub rejected_lost: f64,
    /// The time after a sensor was re-acquired \[s\]: five measurements at least.
    pub reacquired: f64,
    /// A sensor may be silent for this number of its periods,
    pub silent_periods: f64,
    /// and this time at least \[s\].
    pub silent: f64,
    /// The time for which position and velocity may stay unmeasured \[s\]: at least three periods of the sensor that
    /// measured them last.
    pub unaided: f64,
    /// How far a calibration parameter may be from its initial value, in units of its initial σ.
    pub calibration: f64,
    /// How far a parameter may have moved while sensors contradicted the estimate, in units of what
    /// its covariance explains.
    pub pulled: f64,
    /// How far a parameter may move in a minute that no sensor contradicts, in units of the 1σ that it had.
    pub jumped: f64,
    /// The least credible 1σ of the motion.
    pub floor: Floor,
    /// How long a reason is reported after it has ceased to hold \[s\].
    pub hold: f64,
}

/// The least 1σ that an estimate of the motion can have.
#[derive(Clone, Copy, Debug, PartialEq, Literal)]
#[literal(at = "fusion_core::health")]
pub struct Floor {
    /// Of each axis of position \[m\].
    pub position: f64,
    /// Of each axis of velocity \[m/s\].
    pub velocity: f64,
    /// Of each axis of attitude, and of a heading \[rad\].
    pub attitude: f64,
}

impl Limits {
    /// The limits of a design that declares none.
    ///
    /// | limit | reason |
    /// |---|---|
    /// | 15° | sin of it is within 1 % of the angle: small enough to be linearised about |
    /// | 2.5 and 10 σ | recorded logs in good health stay below 2.3 σ over 10 s |
    /// | 100 h between false alarms | once in some hundred missions of an hour, for any set of sensors |
    /// | 2 s of rejections | three fixes at 1 Hz; wrong fixes in a row are rarer than single ones |
    /// | 30 s to *lost* | the time after which gates re-acquire |
    /// | 30 periods | a tunnel or a street canyon; a longer silence is a loss |
    /// | 30 s unaided | a tunnel; 1 mg, a usual accelerometer bias, moves the position by 4 m |
    /// | 5 σ of calibration | one axis in 2 million of a correct declaration |
    /// | 5 σ of pull | the same; undisturbed recorded logs reach 6 once, in a bias that follows the temperature |
    /// | 8 σ of a jump | undisturbed recorded logs reach 6 once, in the scale of a skidding wheel; half a turn is 25 |
    /// | floors | a hundredth of what the best sensors measure |
    pub const DEFAULT: Self = Self {
        aligned: crate::state::ALIGNED,
        coasting: 0.2,
        innovations: 2.5,
        innovations_lost: 10.0,
        false_alarm: 100.0 * 3600.0,
        window: 10.0,
        rejected: 2.0,
        rejected_lost: 30.0,
        reacquired: 10.0,
        silent_periods: 30.0,
        silent: 5.0,
        unaided: 30.0,
        calibration: 5.0,
        pulled: 5.0,
        jumped: 8.0,
        floor: Floor {
            position: 1e-4,
            velocity: 1e-5,
            attitude: 1e-7,
        },
        hold: 5.0,
    };

    /// The same limits for an estimator without covariance: tests that need a σ are switched off.
    #[must_use]
    pub const fn without_sigma(self) -> Self {
        Self {
            innovations: f64::INFINITY,
            innovations_lost: f64::INFINITY,
            false_alarm: f64::INFINITY,
            jumped: f64::INFINITY,
            floor: Floor {
                position: 0.0,
                velocity: 0.0,
                attitude: 0.0,
            },
            ..self
        }
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self::DEFAULT
    }
}
