//! Logs of vehicles and robots as sources of [`fusion`], each a feature of this crate.
//!
//! ```text
//! file ── MessageReader ──▶ messages of all topics ── Pass ──▶ rows of each topic ── decode ──▶ rows in SI
//! ```
//!
//! A log of messages is read once for all sources of a run that use it. `inspect` reads it once for all topics. A
//! format whose feature is off is recognised, and the error names the feature.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

#[allow(dead_code, reason = "a program may be built with all formats")]
mod absent;
#[cfg(any(feature = "mcap", feature = "rosbag"))]
mod bytes;
#[cfg(any(feature = "mcap", feature = "rosbag"))]
mod chunks;
#[cfg(any(feature = "parquet", feature = "arrow"))]
mod columns;
#[cfg(any(
    feature = "mcap",
    feature = "rosbag",
    feature = "ulog",
    feature = "dataflash",
    feature = "ubx",
    feature = "nmea",
    feature = "mavlink"
))]
#[allow(dead_code, reason = "not every format uses all of it")]
mod damage;
#[cfg(feature = "dataflash")]
mod dataflash;
#[cfg(any(feature = "mcap", feature = "rosbag2"))]
mod folder;
#[cfg(feature = "mavlink")]
pub mod mavlink;
#[cfg(feature = "mcap")]
mod mcap;
pub mod messages;
#[cfg(feature = "nmea")]
mod nmea;
#[cfg(any(feature = "mcap", feature = "rosbag", feature = "rosbag2"))]
pub mod ros;
#[cfg(feature = "rosbag")]
mod rosbag;
#[cfg(feature = "rosbag2")]
mod rosbag2;
#[allow(dead_code, reason = "a program may be built without any format")]
mod signature;
#[cfg(any(feature = "mcap", feature = "rosbag", feature = "rosbag2"))]
mod stamped;
#[cfg(any(feature = "ulog", feature = "dataflash", feature = "ubx", feature = "nmea", feature = "mavlink"))]
#[allow(dead_code, reason = "not every format uses all of it")]
mod stream;
#[cfg(test)]
#[allow(dead_code, reason = "a program may be built without any format")]
mod testing;
#[cfg(feature = "ubx")]
mod ubx;
#[cfg(feature = "ulog")]
mod ulog;
#[cfg(any(feature = "mcap", feature = "rosbag"))]
mod unpack;
mod written;
#[cfg(any(feature = "mcap", feature = "rosbag2"))]
mod zstd;

/// An array with more elements than this has no columns: it is an image or a scan. A covariance of 6 axes has 36.
pub const LONGEST_ARRAY: usize = 64;

/// The formats whose feature is off.
mod without {
    #[cfg(not(feature = "mcap"))]
    mod mcap {
        crate::absent::absent_format!(Absent, "mcap", crate::signature::MCAP);
    }
    #[cfg(not(feature = "rosbag"))]
    mod rosbag {
        crate::absent::absent_format!(Absent, "rosbag", crate::signature::ROSBAG);
    }
    #[cfg(not(feature = "rosbag2"))]
    mod rosbag2 {
        crate::absent::absent_format!(Absent, "rosbag2", crate::signature::ROSBAG2);
    }
    #[cfg(not(feature = "ulog"))]
    mod ulog {
        crate::absent::absent_format!(Absent, "ulog", crate::signature::ULOG);
    }
    #[cfg(not(feature = "dataflash"))]
    mod dataflash {
        crate::absent::absent_format!(Absent, "dataflash", crate::signature::DATAFLASH);
    }
    #[cfg(not(feature = "ubx"))]
    mod ubx {
        crate::absent::absent_format!(Absent, "ubx", crate::signature::UBX);
    }
    #[cfg(not(feature = "mavlink"))]
    mod mavlink {
        crate::absent::absent_format!(Absent, "mavlink", crate::signature::MAVLINK);
    }
    #[cfg(not(feature = "nmea"))]
    mod nmea {
        crate::absent::absent_format!(Absent, "nmea", crate::signature::NMEA);
    }
    #[cfg(not(feature = "arrow"))]
    mod arrow {
        crate::absent::absent_format!(Absent, "arrow", crate::signature::ARROW);
    }
    #[cfg(not(feature = "parquet"))]
    mod parquet {
        crate::absent::absent_format!(Absent, "parquet", crate::signature::PARQUET);
    }
}

/// Links the formats into a program; call it once, so that the linker keeps them.
pub const fn link() {}
