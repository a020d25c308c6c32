//! SBET, a smoothed best estimate of trajectory, as programs for lidar and sonar read it.
//!
//! A record has 17 little-endian numbers of eight bytes, and the file has nothing else:
//!
//! | numbers | content | unit |
//! |---|---|---|
//! | 1 | time of the GPS week; the time of the log if its date is not known | s |
//! | 2 to 4 | latitude, longitude, height above the ellipsoid | rad, rad, m |
//! | 5 to 7 | velocity along north, east, down | m/s |
//! | 8 to 10 | roll, pitch, platform heading | rad |
//! | 11 | wander angle: 0, so the platform heading is the heading from north | rad |
//! | 12 to 14 | acceleration along the axes of the body: 0 | m/s² |
//! | 15 to 17 | angular rate about the axes of the body: 0 | rad/s |
//!
//! The axes x, y, z of the velocity are those of the wander frame. With a wander angle of 0 they are north, east, down. A
//! velocity or an attitude that the filter does not estimate is NaN. Acceleration and rate are no estimates; other
//! programs that write SBET have 0 there too.
//!
//! Source    Applanix, POSPac, table of the SBET format: <https://greenvalleyintl.com/wp-content/lidar360_en/Appendix/OUTFile.html>
//! Source    `readers.sbet` of PDAL reads the same fields: <https://pdal.io/stages/readers.sbet.html>
//! Not here  the accuracies, which are a separate file (`smrmsg`)

use fusion::core::belief::Belief;
use fusion::core::geometry::so3;
use fusion::output::{EstimateClock, EstimateFormat, EstimateSink, OutputFile};
use fusion::solution::Solution;
use std::io::{self, Write};

fusion::inventory::submit! {
    EstimateFormat {
        name: "sbet",
        ending: "sbet",
        about: "trajectory for programs of lidar and sonar: time of the GPS week, position, velocity, attitude",
        begin: |file, about| Ok(Box::new(Sbet { file, clock: about.clock })),
    }
}

/// A week of GPS \[ns\].
const WEEK: i64 = 604_800 * 1_000_000_000;

#[derive(Debug)]
struct Sbet {
    file: OutputFile,
    clock: EstimateClock,
}

impl EstimateSink for Sbet {
    fn write(&mut self, solution: &Solution, _belief: &Belief) -> io::Result<()> {
        record(solution, self.clock).map_or(Ok(()), |record| self.file.write_all(&record.map(f64::to_le_bytes).concat()))
    }

    fn finish(self: Box<Self>) -> io::Result<OutputFile> {
        Ok(self.file)
    }
}

/// The numbers of a record; `None` without a position.
pub(super) fn record(solution: &Solution, clock: EstimateClock) -> Option<[f64; 17]> {
    let (place, _) = solution.position?;
    let nanos = clock.gps_nanos(solution.time).map(|nanos| nanos.rem_euclid(WEEK));
    let v = solution.velocity.map_or([f64::NAN; 3], |(v, _)| v.into());
    let rpy = solution.attitude.map_or([f64::NAN; 3], |(q, _)| so3::to_rpy(&q).into());
    let mut record = [0.0; 17];
    record[..4].copy_from_slice(&[
        nanos.unwrap_or(solution.time.nanos()) as f64 / 1e9,
        place.lat,
        place.lon,
        place.height,
    ]);
    record[4..7].copy_from_slice(&v);
    record[7..10].copy_from_slice(&rpy);
    Some(record)
}
