//! Messages of MAVLink 1 and 2: logs of ground stations, files `.tlog`, and the bytes of a link.
//!
//! ```text
//! [microseconds since 1970, from the recorder] frame …
//! ```
//!
//! A topic is a message, `HIGHRES_IMU`. If several systems or components send it, the topics of all but the first have
//! their numbers: `HIGHRES_IMU[1.158]`. Columns have the names, the scales and the units of the definitions, and an
//! enumeration is its number. The stamp counts microseconds since the start of the sender ([`clock`]); `log_time` is the
//! time of the recorder. The first message shows whether there is a recorder.
//!
//! Live      a message is given when its last byte is there
//! Damage    bytes between frames, and frames with a wrong checksum, are passed over; unknown types are counted
//! Own       `mavlink` 0.21 builds for 80 s of processor time with both dialects, has no units, and rejects messages with
//!           an unknown number of an enumeration
//! Not here  signatures are not verified; the dialects of others, which a crate adds as a [`Dialect`]
//! Source    <https://mavlink.io/en/guide/serialization.html>

mod clock;
mod definition;
mod frame;
mod meaning;
mod reader;
#[cfg(test)]
mod tests;

pub use definition::{Dialect, Message, Sender};

use crate::messages::message_format;
use crate::signature::MAVLINK;
use reader::Mavlink;

message_format! {
    /// Messages of MAVLink: a log of a ground station (.tlog), or the bytes of a link. Stamps count microseconds since the
    /// start of the sender.
    MavlinkSpec reads Mavlink as "mavlink";
    stamps in "stamp", unit "us", since None;
    signature MAVLINK;
    example r#"
path = "log.tlog"
topic = "HIGHRES_IMU"
[channels.angular_rate]
columns = ["xgyro", "ygyro", "zgyro"]
unit = "rad/s"
"#;
}
