//! KML 2.2 for Google Earth: the path over time as `gx:Track`, with 3σ and speed as graphs, and ellipses of 3σ.
//!
//! A track lists all times, then all places, then all figures. So the places and the figures of a run are kept until its
//! end. Without a date of the log, time zero is 1970-01-01.
//!
//! Memory   56 bytes for each epoch that is written

use super::ellipse::Ellipses;
use super::utc;
use fusion::core::belief::Belief;
use fusion::core::math;
use fusion::output::{EstimateClock, EstimateFormat, EstimateSink, OutputFile};
use fusion::solution::{Solution, sigmas};
use fusion::source::table::gps_of_unix;
use std::io::{self, Write};

fusion::inventory::submit! {
    EstimateFormat {
        name: "kml",
        ending: "kml",
        about: "path over time for Google Earth, with graphs of 3σ and speed, and ellipses of 3σ",
        begin: |mut file, about| {
            file.write_all(HEAD.as_bytes())?;
            Ok(Box::new(Kml { file, clock: about.clock, ellipses: Ellipses::default(), path: Vec::new() }))
        },
    }
}

const HEAD: &str = concat!(
    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n",
    "<kml xmlns=\"http://www.opengis.net/kml/2.2\" xmlns:gx=\"http://www.google.com/kml/ext/2.2\">\n<Document><name>estimates</name>\n",
    "<Style id=\"sigma\"><LineStyle><color>ff2060e0</color></LineStyle><PolyStyle><color>402060e0</color></PolyStyle></Style>\n",
    "<Schema id=\"figures\">",
    "<gx:SimpleArrayField name=\"sigma3\" type=\"float\"><displayName>3 sigma horizontal [m]</displayName></gx:SimpleArrayField>",
    "<gx:SimpleArrayField name=\"sigma3_down\" type=\"float\"><displayName>3 sigma vertical [m]</displayName></gx:SimpleArrayField>",
    "<gx:SimpleArrayField name=\"speed\" type=\"float\"><displayName>speed [m/s]</displayName></gx:SimpleArrayField>",
    "</Schema>\n<Folder><name>3 sigma</name>\n"
);

#[derive(Debug)]
struct Kml {
    file: OutputFile,
    clock: EstimateClock,
    ellipses: Ellipses,
    path: Vec<Point>,
}

/// An epoch of the path.
#[derive(Clone, Copy, Debug)]
struct Point {
    gps_nanos: i64,
    /// Longitude and latitude \[deg\], height \[m\].
    place: [f64; 3],
    /// 3σ horizontal and vertical \[m\], speed \[m/s\]; NaN without a velocity.
    figures: [f64; 3],
}

impl EstimateSink for Kml {
    fn write(&mut self, solution: &Solution, _belief: &Belief) -> io::Result<()> {
        let Some((place, covariance)) = &solution.position else {
            return Ok(());
        };
        let unix_zero = || gps_of_unix(0.0).map_or(0, |seconds| (seconds * 1e9) as i64);
        let gps_nanos = self
            .clock
            .gps_nanos(solution.time)
            .unwrap_or_else(|| unix_zero() + solution.time.nanos());
        let spread = 3.0 * sigmas(covariance);
        self.path.push(Point {
            gps_nanos,
            place: [place.lon.to_degrees(), place.lat.to_degrees(), place.height],
            figures: [
                math::hypot(spread.x, spread.y),
                spread.z,
                solution.velocity.as_ref().map_or(f64::NAN, |(v, _)| math::hypot(v.x, v.y)),
            ],
        });
        if let Some(ring) = self.ellipses.next(place, covariance) {
            write!(
                self.file,
                "<Placemark><name>{:.1} s</name><styleUrl>#sigma</styleUrl><Polygon><outerBoundaryIs><LinearRing><coordinates>",
                solution.time.seconds()
            )?;
            for (lat, lon) in ring {
                write!(self.file, "{:.9},{:.9} ", lon.to_degrees(), lat.to_degrees())?;
            }
            self.file
                .write_all(b"</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>\n")?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> io::Result<OutputFile> {
        let Self { mut file, path, .. } = *self;
        file.write_all(b"</Folder>\n<Placemark><name>path</name><gx:Track><altitudeMode>clampToGround</altitudeMode>\n")?;
        for point in &path {
            writeln!(file, "<when>{}</when>", utc(point.gps_nanos))?;
        }
        for Point {
            place: [lon, lat, height], ..
        } in &path
        {
            writeln!(file, "<gx:coord>{lon:.9} {lat:.9} {height:.3}</gx:coord>")?;
        }
        file.write_all(b"<ExtendedData><SchemaData schemaUrl=\"#figures\">\n")?;
        for (k, name) in ["sigma3", "sigma3_down", "speed"].into_iter().enumerate() {
            writeln!(file, "<gx:SimpleArrayData name=\"{name}\">")?;
            for point in &path {
                let figure = Some(point.figures[k]).filter(|figure| figure.is_finite()).unwrap_or_default();
                writeln!(file, "<gx:value>{figure:.3}</gx:value>")?;
            }
            file.write_all(b"</gx:SimpleArrayData>\n")?;
        }
        file.write_all(b"</SchemaData></ExtendedData></gx:Track></Placemark>\n</Document></kml>\n")?;
        Ok(file)
    }
}
