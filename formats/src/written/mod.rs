//! Estimates in the formats of other programs, for `fusion run --also`.
//!
//! | name | for | has |
//! |---|---|---|
//! | `geojson` | maps in a browser, QGIS (RFC 7946) | a point an epoch, with its figures; ellipses of 3σ |
//! | `gpx` | devices and maps (GPX 1.1) | a point an epoch, with 3σ as an extension |
//! | `kml` | Google Earth (KML 2.2 with `gx:Track`) | the path over time, 3σ and speed as graphs, ellipses of 3σ |
//! | `mcap` | Foxglove, readers of bags of ROS 2 | Odometry, NavSatFix, TF, diagnostics |
//! | `parquet` | pandas, polars | the columns and digits of estimates.csv |
//! | `sbet` | programs of lidar and sonar | time of the GPS week, position, velocity, attitude |
//! | `tum` | evo, TUM's tools | stamp, position east, north, up and attitude quaternion |
//!
//! An ellipse is written where it does not overlap with the one before it.

mod ellipse;
mod geojson;
mod gpx;
mod kml;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(feature = "parquet")]
mod parquet;
mod sbet;
#[cfg(test)]
mod tests;
mod tum;

use fusion::source::table::utc_text;

/// Declares a format whose feature is off: a run that asks for it says what to do.
#[cfg(not(all(feature = "mcap", feature = "parquet")))]
macro_rules! without {
    ($feature:literal, $signature:path) => {
        #[cfg(not(feature = $feature))]
        fusion::inventory::submit! {
            fusion::output::EstimateFormat {
                name: $feature,
                ending: $feature,
                about: concat!("not in this program, which was built without the feature `", $feature, "`"),
                begin: |_, _| Err(std::io::Error::other(crate::absent::unwritable(&$signature))),
            }
        }
    };
}
#[cfg(not(all(feature = "mcap", feature = "parquet")))]
without! { "mcap", crate::signature::MCAP }
#[cfg(not(all(feature = "mcap", feature = "parquet")))]
without! { "parquet", crate::signature::PARQUET }

/// The time of a map: UTC with milliseconds, such as `2025-07-08T19:34:18.250Z`.
fn utc(gps_nanos: i64) -> String {
    let seconds = gps_nanos.div_euclid(1_000_000_000);
    let milliseconds = gps_nanos.rem_euclid(1_000_000_000) / 1_000_000;
    let text = utc_text(seconds);
    format!("{}.{milliseconds:03}Z", text.trim_end_matches('Z'))
}
