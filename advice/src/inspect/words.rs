//! The meaning of a column name: a quantity, an axis, a unit.

/// The parts of a column name.
#[derive(Clone, Debug, Default)]
pub(super) struct Words {
    /// The name without its unit, in lower case, words joined by `_`.
    pub(super) stem: String,
    /// Its unit as designs write it, if the name has one.
    pub(super) unit: Option<&'static str>,
}

/// Units as headers write them, without blanks and brackets, and as designs write them.
const UNITS: [(&str, &str); 59] = [
    ("mps2", "m/s^2"),
    ("ms2", "m/s^2"),
    ("m/s2", "m/s^2"),
    ("m/s^2", "m/s^2"),
    ("m/s²", "m/s^2"),
    ("ms^-2", "m/s^2"),
    ("g", "g"),
    ("mg", "mg"),
    ("radps", "rad/s"),
    ("rad/s", "rad/s"),
    ("rads^-1", "rad/s"),
    ("mrad/s", "mrad/s"),
    ("degps", "deg/s"),
    ("deg/s", "deg/s"),
    ("dps", "deg/s"),
    ("mps", "m/s"),
    ("m/s", "m/s"),
    ("ms^-1", "m/s"),
    ("km/h", "km/h"),
    ("kmh", "km/h"),
    ("kn", "kn"),
    ("kt", "kn"),
    ("kts", "kn"),
    ("knots", "kn"),
    ("rad", "rad"),
    ("deg", "deg"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("cdeg", "cdeg"),
    ("1e-7deg", "1e-7 deg"),
    ("cmps", "cm/s"),
    ("cm/s", "cm/s"),
    ("mmps", "mm/s"),
    ("mm/s", "mm/s"),
    ("mm", "mm"),
    ("cm", "cm"),
    ("m", "m"),
    ("meter", "m"),
    ("meters", "m"),
    ("s", "s"),
    ("sec", "s"),
    ("ms", "ms"),
    ("us", "us"),
    ("ns", "ns"),
    ("ga", "gauss"),
    ("gauss", "gauss"),
    ("mgauss", "mgauss"),
    ("ut", "uT"),
    ("nt", "nT"),
    ("tesla", "T"),
    ("µt", "uT"),
    ("pa", "Pa"),
    ("hpa", "hPa"),
    ("mbar", "hPa"),
    ("kpa", "kPa"),
    ("m2", "m^2"),
    ("m^2", "m^2"),
    ("pa2", "Pa^2"),
    ("lsb", "counts"),
];

fn unit(written: &str) -> Option<&'static str> {
    let plain: String = written.to_lowercase().chars().filter(|c| !c.is_whitespace()).collect();
    UNITS.iter().find(|(name, _)| *name == plain).map(|(_, unit)| *unit)
}

/// The unit in the name of a column.
pub(crate) fn stated_unit(column: &str) -> Option<&'static str> {
    Words::of(column).unit.filter(|unit| *unit != "counts")
}

/// Words for a quaternion.
pub(super) const QUATERNION: [&str; 5] = ["q", "quat", "quaternion", "orientation", "attitude"];

impl Words {
    /// Splits a name.
    pub(super) fn of(name: &str) -> Self {
        // An element of an array and then its unit: `x[0] [rad/s]`.
        if let Some((element, inside)) = name.rsplit_once(" [").filter(|(element, _)| element.ends_with(']')) {
            let words = Self::of(element);
            let unit = unit(inside.trim_end_matches(']')).or(words.unit);
            return Self { unit, ..words };
        }
        let bracket = name
            .find(['[', '('])
            .map(|at| (&name[..at], name[at + 1..].trim_end_matches([']', ')'])));
        let (plain, mut found) = match bracket {
            // A single t may be a time.
            Some((plain, inside)) => (plain, unit(inside).or_else(|| (inside.trim() == "T").then_some("T"))),
            None => (name, None),
        };
        let words = plain.split(|c: char| !c.is_alphanumeric() && !matches!(c, '/' | '^'));
        let mut words: Vec<String> = words.filter(|w| !w.is_empty()).map(str::to_lowercase).collect();
        if found.is_none() {
            // PX4 writes `vel_n_m_s`: the unit is made of the last words.
            let of_words = |count: usize| {
                let at = words.len().checked_sub(count).filter(|at| *at > 0)?;
                Some((at, unit(&words[at..].join("/"))?))
            };
            if let Some((at, known)) = [3, 2, 1].into_iter().find_map(of_words) {
                words.truncate(at);
                found = Some(known);
            }
        }
        // Elements of an array, as PX4 and ROS write them: `gyro_rad[0]`, `q[3]`. In round brackets MATLAB counts from 1.
        let is_element = name.ends_with(']');
        if let Some(axis) = bracket
            .and_then(|(_, inside)| inside.trim().parse::<usize>().ok())
            .filter(|_| is_element)
        {
            let is_quaternion = words.last().is_some_and(|word| QUATERNION.contains(&word.as_str()));
            let axes = if is_quaternion {
                &["w", "x", "y", "z"][..]
            } else {
                &["x", "y", "z"][..]
            };
            words.extend(axes.get(axis).map(|axis| (*axis).to_owned()));
        }
        Self {
            stem: words.join("_"),
            unit: found,
        }
    }

    /// The words before an axis that the stem ends with: `acc` of `acc_x`, `a` of `ax`, `v` of `vnorth`.
    pub(super) fn before(&self, axis: &str) -> Option<&str> {
        Some(self.stem.strip_suffix(axis)?.trim_end_matches('_'))
    }

    /// Whether its last word is in `words`.
    pub(super) fn ends_with(&self, words: &[&str]) -> bool {
        let last = self.stem.rsplit('_').next().unwrap_or_default();
        words.iter().any(|w| *w == last || *w == self.stem)
    }
}

/// Whether a stem starts with one of these words.
fn begins(stem: &str, words: &[&str]) -> bool {
    words.contains(&stem.split('_').next().unwrap_or_default()) || words.contains(&stem)
}

/// Whether a stem starts with one of these words, or has one with more than two letters: `imu_acc`.
pub(super) fn is_called(stem: &str, words: &[&str]) -> bool {
    begins(stem, words) || stem.split('_').any(|w| w.len() > 2 && words.contains(&w))
}

/// Whether a stem ends with one of these phrases, as `imu_angular_velocity` does.
pub(super) fn is_phrase(stem: &str, phrases: &[&str]) -> bool {
    let ends = |phrase: &&str| {
        stem.strip_suffix(*phrase)
            .is_some_and(|rest| rest.is_empty() || rest.ends_with('_'))
    };
    phrases.iter().any(ends)
}

/// Whether one of its words is one of these.
pub(super) fn contains(stem: &str, words: &[&str]) -> bool {
    stem.split('_').any(|w| words.contains(&w))
}

/// Whether a stem is a height, with nothing else but its instrument and datum: `altitude_ellipsoid`, `althae`, `hmsl`.
pub(super) fn is_height(stem: &str) -> bool {
    const HEIGHT: [&str; 10] = ["altitude", "alt", "height", "hgt", "elevation", "elev", "hae", "amsl", "msl", "h"];
    const OF: [&str; 13] = [
        "gps",
        "gnss",
        "above",
        "over",
        "mean",
        "sea",
        "level",
        "ellipsoidal",
        "ellipsoid",
        "ellips",
        "ell",
        "wgs84",
        "wgs",
    ];
    // Loggers join words with or without a sign between them.
    fn is_made(rest: &str, has_height: bool) -> bool {
        let after = |words: &[&str], has_height| {
            words
                .iter()
                .any(|w| rest.strip_prefix(w).is_some_and(|rest| is_made(rest, has_height)))
        };
        if rest.is_empty() {
            return has_height;
        }
        after(&HEIGHT, true) || after(&OF, has_height)
    }
    is_made(&stem.replace('_', ""), false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_element_in_square_brackets_is_an_axis() {
        for (name, stem, unit) in [
            ("gyro_rad[0]", "gyro_x", Some("rad")),
            ("q[3]", "q_z", None),
            ("gyro(1)", "gyro", None),
            ("xyz[2] [rad/s]", "xyz_z", Some("rad/s")),
            ("lat [1e-7 deg]", "lat", Some("1e-7 deg")),
            ("acc [m/s^2]", "acc", Some("m/s^2")),
        ] {
            let words = Words::of(name);
            assert_eq!((words.stem.as_str(), words.unit), (stem, unit), "{name}");
        }
    }

    #[test]
    fn heights_say_above_what_they_are() {
        for name in [
            "AltHAE",
            "HAE",
            "Alt_HAE",
            "AltMSL",
            "hMSL",
            "GPSAlt",
            "AltGPS",
            "AltWGS84",
            "AltEllipsoid",
            "HeightEll",
            "ellheight",
            "altitude_ellipsoid_m",
            "height_above_mean_sea_level (m)",
        ] {
            assert!(is_height(&Words::of(name).stem), "{name}");
        }
        for name in [
            "gps",
            "sea_level",
            "geoid_height",
            "hdop",
            "hacc",
            "alt_sigma",
            "half",
            "level",
            "sat_elevation",
        ] {
            assert!(!is_height(&Words::of(name).stem), "{name}");
        }
    }

    #[test]
    fn names_are_taken_apart_as_loggers_write_them() {
        let of = |name| {
            let w = Words::of(name);
            (w.stem, w.unit)
        };
        assert_eq!(of("wx_radps"), ("wx".to_owned(), Some("rad/s")));
        assert_eq!(of("a_RS_S_x [m s^-2]"), ("a_rs_s_x".to_owned(), Some("m/s^2")));
        assert_eq!(of("latitude(deg)"), ("latitude".to_owned(), Some("deg")));
        assert_eq!(of("#timestamp [ns]"), ("timestamp".to_owned(), Some("ns")));
        // A single letter is a name, not a unit.
        assert_eq!(of("g"), ("g".to_owned(), None));
        assert_eq!(Words::of("Acc_X").before("x"), Some("acc"));
        assert_eq!(Words::of("vn_mps").before("n"), Some("v"));
    }
}
