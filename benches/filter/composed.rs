//! The filter that is assembled.

use fusion::core::belief::Belief;
use fusion::core::filter::{Backend, Estimator, Filter, Observed, Verdict};
use fusion::core::gate::{Gate, Open};
use fusion::core::loss::{Loss, Quadratic};
use fusion::core::model::{Input, Measurement, Size};
use fusion::core::time::Time;
use std::hint::black_box;
use std::sync::Arc;

/// Biases that walk: 15 states.
pub const PLAIN: &str = r#"
gyro.bias = { estimate = true, initial = [0, 0, 0], sigma = "0.01 deg/s", random_walk = "1e-6 rad/s/sqrt(s)" }
accelerometer.bias = { estimate = true, initial = [0, 0, 0], sigma = "5 mg", random_walk = "1e-4 m/s^2/sqrt(s)" }
"#;

/// The same, with scale factors: 21.
pub const SCALES: &str = r#"
gyro.bias = { estimate = true, initial = [0, 0, 0], sigma = "0.01 deg/s", random_walk = "1e-6 rad/s/sqrt(s)" }
accelerometer.bias = { estimate = true, initial = [0, 0, 0], sigma = "5 mg", random_walk = "1e-4 m/s^2/sqrt(s)" }
gyro.scale = { estimate = true, initial = [0, 0, 0], sigma = "0.1 %" }
accelerometer.scale = { estimate = true, initial = [0, 0, 0], sigma = "0.1 %" }
"#;

/// The same, all of them Gauss-Markov.
pub const MARKOV: &str = r#"
gyro.bias = { estimate = true, initial = [0, 0, 0], sigma = "0.01 deg/s", correlation_time = "1000 s" }
accelerometer.bias = { estimate = true, initial = [0, 0, 0], sigma = "5 mg", correlation_time = "1000 s" }
gyro.scale = { estimate = true, initial = [0, 0, 0], sigma = "0.1 %", correlation_time = "1000 s" }
accelerometer.scale = { estimate = true, initial = [0, 0, 0], sigma = "0.1 %", correlation_time = "1000 s" }
"#;

const PROCESS: &str = r#"
[process]
type = "strapdown"
source = "imu"
gyro.noise = "0.2 deg/sqrt(h)"
accelerometer.noise = "70 ug/sqrt(Hz)"
"#;

const OTHERS: &str = r#"
[sensor.gnss]
type = "gnss_position"
source = "gnss"
lever_arm = [0.4, -0.2, -1.1]
noise = { sigma = ["1.5 m", "1.5 m", "2.5 m"] }

[initial.start]
type = "explicit"
position = { latitude = "47 deg", longitude = "8 deg", height = "400 m" }
position_sigma = "3 m"
velocity = [10, -5, 1]
velocity_sigma = "0.5 m/s"
attitude = ["2 deg", "-3 deg", "130 deg"]
attitude_sigma = ["0.5 deg", "0.5 deg", "3 deg"]
"#;

pub const DT: f64 = 0.01;

/// Mean rates and forces of the samples, a slow turn with some shaking.
pub fn sample(k: usize) -> [f64; 6] {
    let t = k as f64 * DT;
    [
        0.02 * t.sin(),
        0.01 * (1.3 * t).cos(),
        0.1 + 0.02 * (0.7 * t).sin(),
        0.3 * (2.0 * t).sin(),
        0.2 * t.cos(),
        -9.8 + 0.1 * (3.0 * t).sin(),
    ]
}

fn prepared(k: usize) -> [f64; 13] {
    let mut numbers = [DT; 13];
    numbers[..6].copy_from_slice(&sample(k));
    numbers[6..12].copy_from_slice(&sample(k.saturating_sub(1)));
    numbers
}

pub fn fix(k: usize) -> [f64; 3] {
    let t = k as f64 * DT;
    [47_f64.to_radians() + 1.57e-6 * t, 8_f64.to_radians() - 1.15e-6 * t, 400.0 - t]
}

/// The assembled filter as programs have it, with its first belief.
pub fn started(sensors: &str) -> fusion::Navigator {
    let mut nav = fusion::Navigator::from_toml(&Composed::design(sensors)).expect("the design is sound");
    // The sample that opens the first interval starts the filter.
    nav.feed("imu", 0.0, &sample(0)).unwrap();
    nav
}

pub struct Composed {
    pub filter: Filter,
    pub gnss: Arc<dyn Measurement>,
    pub noise: [f64; 9],
    pub start: Belief,
    /// Each sample with the one before and its interval, as the process's preparation makes them.
    prepared: Vec<[f64; 13]>,
}

impl Composed {
    /// The text of the design with these errors of the sensors.
    pub fn design(sensors: &str) -> String {
        [PROCESS, sensors, OTHERS].concat()
    }

    pub fn new(sensors: &str, backend: Backend) -> Self {
        let nav = started(sensors);
        let start = nav.belief().expect("started").clone();
        let assembly = nav.assembly();
        let sensor = &assembly.sensors[0];
        let mut noise = [0.0; 9];
        (0..3).for_each(|i| noise[4 * i] = sensor.sigma[i] * sensor.sigma[i]);
        let size = Size::same(3);
        let mut filter = Filter::new(assembly.layout.clone(), assembly.process.clone(), backend, size);
        filter.set_belief(start.clone());
        Self {
            filter,
            gnss: sensor.model.clone(),
            noise,
            start,
            prepared: (0..2000).map(prepared).collect(),
        }
    }

    /// In the middle of a run: correlated.
    pub fn warm(sensors: &str, backend: Backend) -> Self {
        let mut all = Self::new(sensors, backend);
        for k in 1..=500 {
            all.predict(k);
            if k % 100 == 50 {
                all.update(&fix(k));
            }
        }
        all.start = all.filter.belief().clone();
        all
    }

    /// So many predictions from there.
    pub fn predictions(&mut self, steps: usize) {
        self.filter.set_belief(self.start.clone());
        (501..501 + steps).for_each(|k| self.predict(k));
        black_box(self.filter.belief());
    }

    /// So many updates from there, by the same fix.
    pub fn updates(&mut self, updates: usize) {
        let z = fix(500);
        self.filter.set_belief(self.start.clone());
        (0..updates).for_each(|_| self.update(black_box(&z)));
        black_box(self.filter.belief());
    }

    pub fn predict(&mut self, k: usize) {
        let input = Input {
            sample: &self.prepared[k],
            interval: DT,
        };
        self.filter.predict(Time::from_nanos(k as i64 * 10_000_000), &input).unwrap();
    }

    pub fn update(&mut self, z: &[f64; 3]) {
        self.update_through(z, &mut Open, &Quadratic);
    }

    pub fn update_through(&mut self, z: &[f64; 3], gate: &mut dyn Gate, loss: &dyn Loss) {
        let observed = Observed {
            sensor: 0,
            model: self.gnss.as_ref(),
            value: z,
            noise: &self.noise,
            quality: None,
            derivative_input: None,
            lateness: None,
        };
        assert_eq!(self.filter.update(&observed, gate, &[], loss).verdict, Verdict::Accepted);
    }
}
