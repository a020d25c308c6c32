//! The names and the first bytes of each format, which are known without its feature.

/// How files of a format are recognised.
pub(crate) struct Signature {
    /// The `type` of its sources, and the feature of this crate.
    pub(crate) name: &'static str,
    /// The endings of its file names.
    pub(crate) endings: &'static [&'static str],
    /// Whether these first bytes are of the format.
    pub(crate) recognises: fn(&[u8]) -> bool,
}

/// MCAP, of ROS 2 or of others.
pub(crate) const MCAP: Signature = Signature {
    name: "mcap",
    endings: &[".mcap", ".mcap.zstd"],
    recognises: |first| first.starts_with(b"\x89MCAP0\r\n"),
};

/// A bag of ROS 1.
pub(crate) const ROSBAG: Signature = Signature {
    name: "rosbag",
    endings: &[".bag"],
    recognises: |first| first.starts_with(b"#ROSBAG V2.0\n"),
};

/// A bag of ROS 2 in SQLite.
pub(crate) const ROSBAG2: Signature = Signature {
    name: "rosbag2",
    endings: &[".db3", ".db3.zstd"],
    recognises: |first| first.starts_with(b"SQLite format 3\0"),
};

/// A log of PX4.
pub(crate) const ULOG: Signature = Signature {
    name: "ulog",
    endings: &[".ulg"],
    recognises: |first| first.starts_with(b"ULog\x01\x12\x35"),
};

/// A log of ArduPilot.
pub(crate) const DATAFLASH: Signature = Signature {
    name: "dataflash",
    endings: &[".bin", ".BIN"],
    recognises: |first| first.starts_with(&[0xa3, 0x95]),
};

/// A log of a u-blox receiver, mixed with NMEA and RTCM.
pub(crate) const UBX: Signature = Signature {
    name: "ubx",
    endings: &[".ubx"],
    recognises: |first| first.windows(2).any(|pair| pair == [0xb5, 0x62]),
};

/// Messages of MAVLink: the log of a ground station, or the bytes of a link.
pub(crate) const MAVLINK: Signature = Signature {
    name: "mavlink",
    endings: &[".tlog"],
    recognises: is_mavlink,
};

/// Sentences of NMEA 0183.
pub(crate) const NMEA: Signature = Signature {
    name: "nmea",
    endings: &[".nmea"],
    recognises: is_nmea,
};

/// A table of Parquet.
pub(crate) const PARQUET: Signature = Signature {
    name: "parquet",
    endings: &[".parquet"],
    recognises: |first| first.starts_with(b"PAR1"),
};

/// A table of Arrow IPC, also called Feather.
pub(crate) const ARROW: Signature = Signature {
    name: "arrow",
    endings: &[".arrow", ".feather"],
    recognises: |first| first.starts_with(b"ARROW1"),
};

/// Two frames follow each other from the first byte on, each perhaps with a stamp of eight bytes before it.
fn is_mavlink(first: &[u8]) -> bool {
    // The length of a frame without a signature, from its first byte and that of its content.
    let frame = |bytes: &[u8]| match *bytes {
        [0xfe, length, ..] => Some(8 + usize::from(length)),
        [0xfd, length, 0, ..] => Some(12 + usize::from(length)),
        [0xfd, length, 1, ..] => Some(25 + usize::from(length)),
        _ => None,
    };
    [0, 8].into_iter().any(|before| {
        let next = |from: usize| Some(from + before + frame(first.get(from + before..)?)?);
        next(0).and_then(next).is_some()
    })
}

/// The first line begins with the address of a sentence: `$GPGGA,` or `$GNRMC,`.
fn is_nmea(first: &[u8]) -> bool {
    if first.windows(2).any(|pair| pair == [0xb5, 0x62]) {
        return false;
    }
    let Some((b'$', address)) = first.split_first() else { return false };
    let end = address.iter().position(|byte| *byte == b',');
    end.is_some_and(|end| (3..=6).contains(&end) && address[..end].iter().all(u8::is_ascii_alphanumeric))
}
