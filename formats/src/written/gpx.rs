//! GPX 1.1: a track with a point for each epoch, and 3σ as an extension.

use super::utc;
use fusion::core::belief::Belief;
use fusion::output::{EstimateClock, EstimateFormat, EstimateSink, OutputFile};
use fusion::solution::{Solution, sigmas};
use std::io::{self, Write};

fusion::inventory::submit! {
    EstimateFormat {
        name: "gpx",
        ending: "gpx",
        about: "track for devices and maps, with 3σ as an extension",
        begin: |mut file, about| {
            file.write_all(HEAD.as_bytes())?;
            Ok(Box::new(Gpx { file, clock: about.clock }))
        },
    }
}

/// GPX demands that the elements of an extension have their own namespace.
const HEAD: &str = concat!(
    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n",
    "<gpx version=\"1.1\" creator=\"fusion\" xmlns=\"http://www.topografix.com/GPX/1/1\" xmlns:fusion=\"https://example.org/fusion\">\n",
    "<trk><name>estimates</name><trkseg>\n"
);

#[derive(Debug)]
struct Gpx {
    file: OutputFile,
    clock: EstimateClock,
}

impl EstimateSink for Gpx {
    fn write(&mut self, solution: &Solution, _belief: &Belief) -> io::Result<()> {
        let Some((place, covariance)) = &solution.position else {
            return Ok(());
        };
        let (lat, lon) = (place.lat.to_degrees(), place.lon.to_degrees());
        write!(self.file, "<trkpt lat=\"{lat:.9}\" lon=\"{lon:.9}\"><ele>{:.3}</ele>", place.height)?;
        if let Some(nanos) = self.clock.gps_nanos(solution.time) {
            write!(self.file, "<time>{}</time>", utc(nanos))?;
        }
        let spread = 3.0 * sigmas(covariance);
        writeln!(
            self.file,
            "<extensions><fusion:t_s>{:.6}</fusion:t_s><fusion:sigma3_north_m>{:.3}</fusion:sigma3_north_m>\
             <fusion:sigma3_east_m>{:.3}</fusion:sigma3_east_m><fusion:sigma3_down_m>{:.3}</fusion:sigma3_down_m></extensions></trkpt>",
            solution.time.seconds(),
            spread.x,
            spread.y,
            spread.z
        )
    }

    fn finish(self: Box<Self>) -> io::Result<OutputFile> {
        let mut file = self.file;
        file.write_all(b"</trkseg></trk>\n</gpx>\n")?;
        Ok(file)
    }
}
