//! Runs EKF2 of PX4, by the crate `ekf2`, over a log of fusion-nav's simulator.
//!
//! `autopilot LOG OUT LATENCY_MS KIND`: writes the estimates from the moment at which EKF2 says that its position is
//! valid. Parameters are the defaults of PX4, except what the log states: the latency and the antenna. The vehicle is
//! in the air from the first GNSS velocity of 1 m/s on, as a land detector would say.

use ekf2::types::{BaroSample, GnssSample, ImuSample, MagSample};
use ekf2::{Ekf, HeightReference};
use std::error::Error;
use std::fmt::Write;

const LATITUDE: f64 = 40.1164;
const LONGITUDE: f64 = -88.3697;
const HEIGHT: f64 = 200.0;
/// The sphere of PX4's map projection.
const RADIUS: f64 = 6_371_000.0;
const HEADER: &str = "t_s,pos_n,pos_e,pos_d,q0,q1,q2,q3,sigma_pos_n,sigma_pos_e,sigma_pos_d\n";

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [log, out, latency, kind] = &arguments[..] else {
        return Err("autopilot LOG OUT LATENCY_MS KIND".into());
    };
    let mut ekf = Ekf::new().map_err(|e| format!("{e:?}"))?;
    ekf.params_mut().set_gps_delay_ms(latency.parse()?);
    // The defaults of PX4, which the crate does not have: the longest delay, and heights of GNSS.
    ekf.params_mut().set_delay_max_ms(200.0);
    ekf.params_mut().set_hgt_ref(HeightReference::Gnss);
    ekf.set_is_fixed_wing(kind == "fixed-wing");
    let east = RADIUS * LATITUDE.to_radians().cos();
    let (mut written, mut before, mut place) = (HEADER.to_owned(), None, None);
    for line in std::fs::read_to_string(log)?.lines() {
        if let Some(arm) = line.strip_prefix("# GNSS antenna ") {
            let arm: Vec<f32> = arm.split(' ').take(3).map(str::parse).collect::<Result<_, _>>()?;
            ekf.params_mut().set_gps_pos_body([arm[0], arm[1], arm[2]]);
        }
        if !line.starts_with(|c: char| c.is_ascii_digit()) {
            continue;
        }
        let cells: Vec<&str> = line.split(',').collect();
        let number = |k: usize| cells[k].parse::<f64>().unwrap_or(0.0);
        let float = |k: usize| number(k) as f32;
        let vector = |k: usize| [float(k), float(k + 1), float(k + 2)];
        // A stamp of zero means none to EKF2.
        let time = (number(0) * 1e6).round() as u64 + 1_000_000;
        match cells[1] {
            "imu" => {
                let step = before.map_or(0.005, |before: u64| (time - before) as f32 * 1e-6);
                before = Some(time);
                let increment = |k: usize| vector(k).map(|v| v * step);
                ekf.set_imu_data(&ImuSample::new(time, increment(2), increment(5), step, step));
                ekf.update();
                if ekf.global_position_valid() && ekf.attitude_valid() {
                    let (latitude, longitude, height) = ekf.lat_lon_alt();
                    let north = (latitude - LATITUDE).to_radians() * RADIUS;
                    let (east, down) = ((longitude - LONGITUDE).to_radians() * east, HEIGHT - f64::from(height));
                    let (q, variance) = (ekf.quaternion(), ekf.pos_variance());
                    write!(written, "{:.4},{north:.6},{east:.6},{down:.6}", number(0))?;
                    for value in q.into_iter().chain(variance.map(f32::sqrt)) {
                        write!(written, ",{value:.6}")?;
                    }
                    written.push('\n');
                }
            }
            "gnss_pos" => place = Some([number(2), number(3), number(4)]),
            "gnss_vel" => {
                let Some([n, e, d]) = place.take() else { continue };
                if vector(2).iter().map(|v| v * v).sum::<f32>() > 1.0 {
                    ekf.set_in_air_status(true);
                }
                let (latitude, longitude) = (LATITUDE + (n / RADIUS).to_degrees(), LONGITUDE + (e / east).to_degrees());
                let height = (HEIGHT - d) as f32;
                // 1σ of the instruments, as every log states them; satellites and their geometry are good.
                let fix = GnssSample::new(time, latitude, longitude, height, vector(2), 0.9, 1.8, 0.15, 1.0, 3, 16);
                ekf.set_gps_data(&fix);
            }
            "baro" => ekf.set_baro_data(&BaroSample::new(time, float(2))),
            "mag" => ekf.set_mag_data(&MagSample::new(time, vector(2))),
            _ => {}
        }
    }
    std::fs::write(out, written)?;
    Ok(())
}
