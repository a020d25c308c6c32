//! GeoJSON (RFC 7946): a point for each epoch, with its figures as properties, and ellipses of 3σ as polygons.

use super::ellipse::Ellipses;
use super::utc;
use fusion::core::belief::Belief;
use fusion::core::math;
use fusion::output::{EstimateClock, EstimateFormat, EstimateSink, OutputFile};
use fusion::solution::{Solution, sigmas};
use std::io::{self, Write};

fusion::inventory::submit! {
    EstimateFormat {
        name: "geojson",
        ending: "geojson",
        about: "points with time, speed, attitude and 3σ for maps, and ellipses of 3σ",
        begin: |mut file, about| {
            file.write_all(b"{\"type\":\"FeatureCollection\",\"features\":[")?;
            Ok(Box::new(GeoJson { file, clock: about.clock, ellipses: Ellipses::default(), is_first: true }))
        },
    }
}

#[derive(Debug)]
struct GeoJson {
    file: OutputFile,
    clock: EstimateClock,
    ellipses: Ellipses,
    is_first: bool,
}

impl EstimateSink for GeoJson {
    fn write(&mut self, solution: &Solution, _belief: &Belief) -> io::Result<()> {
        let Some((place, covariance)) = &solution.position else {
            return Ok(());
        };
        let seconds = solution.time.seconds();
        self.begin()?;
        let (lat, lon) = (place.lat.to_degrees(), place.lon.to_degrees());
        write!(
            self.file,
            "{{\"type\":\"Feature\",\"geometry\":{{\"type\":\"Point\",\"coordinates\":[{lon:.9},{lat:.9},{:.3}]}},\"properties\":{{\"t_s\":{seconds:.6}",
            place.height
        )?;
        if let Some(nanos) = self.clock.gps_nanos(solution.time) {
            write!(self.file, ",\"time\":\"{}\"", utc(nanos))?;
        }
        let spread = 3.0 * sigmas(covariance);
        write!(
            self.file,
            ",\"sigma3_north_m\":{:.3},\"sigma3_east_m\":{:.3},\"sigma3_down_m\":{:.3}",
            spread.x, spread.y, spread.z
        )?;
        if let Some((velocity, _)) = &solution.velocity {
            write!(self.file, ",\"speed_mps\":{:.3}", math::hypot(velocity.x, velocity.y))?;
        }
        if let Some((rpy, _)) = solution.rpy() {
            let [roll, pitch, yaw] = [rpy.x, rpy.y, rpy.z].map(f64::to_degrees);
            write!(self.file, ",\"roll_deg\":{roll:.3},\"pitch_deg\":{pitch:.3},\"yaw_deg\":{yaw:.3}")?;
        }
        self.file.write_all(b"}}")?;
        let Some(ring) = self.ellipses.next(place, covariance) else {
            return Ok(());
        };
        self.begin()?;
        self.file
            .write_all(b"{\"type\":\"Feature\",\"geometry\":{\"type\":\"Polygon\",\"coordinates\":[[")?;
        for (k, (lat, lon)) in ring.iter().enumerate() {
            let comma = if k == 0 { "" } else { "," };
            write!(self.file, "{comma}[{:.9},{:.9}]", lon.to_degrees(), lat.to_degrees())?;
        }
        write!(self.file, "]]}},\"properties\":{{\"t_s\":{seconds:.6},\"what\":\"3 sigma\"}}}}")
    }

    fn finish(self: Box<Self>) -> io::Result<OutputFile> {
        let mut file = self.file;
        file.write_all(b"\n]}\n")?;
        Ok(file)
    }
}

impl GeoJson {
    /// Begins a feature on a new line.
    fn begin(&mut self) -> io::Result<()> {
        let comma: &[u8] = if core::mem::take(&mut self.is_first) { b"\n" } else { b",\n" };
        self.file.write_all(comma)
    }
}
