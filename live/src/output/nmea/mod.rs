//! Sentences of NMEA 0183, version 4.10.
//!
//! | mode | when | GGA | RMC, VTG, THS |
//! |---|---|---|---|
//! | invalid | before the start; the filter is *lost*; the estimate is not finite | 0 | V, N, V |
//! | estimated | the health is not *good* | 6 | V, E, E |
//! | autonomous | the health is *good* | 1 | A, A, A |
//!
//! An invalid estimate is not sent: its fields are empty. So is the course while the speed is below its 1σ. Without a date
//! the time is empty, and `ZDA` is not sent. `HDT` has no mode: without a valid heading it is not sent.
//!
//! Source    IEC 61162-1; the status V of an estimated position is required there
//! Not here  the geoid: the altitude is above the ellipsoid, the separation is 0; satellites, HDOP, magnetic variation

mod fields;
#[cfg(test)]
mod tests;

use super::{About, Outgoing, Output, OutputSpec, opened};
use crate::link::Sender;
use fields::Now;
use fusion::models::register;
use schemars::JsonSchema;
use serde::Deserialize;
use std::io::{self, Write};

/// Sentences of NMEA 0183 for each estimate: position, velocity, heading, their 1σ and the mode. The altitude is above
/// the ellipsoid WGS-84. The quality is 1 in good health, 6 in other health, and 0 before the start or if *lost*.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NmeaSpec {
    /// The link by which it is sent.
    link: String,
    /// The sentences, in the order in which they are sent.
    #[serde(default)]
    sentences: Sentences,
    /// The two letters before the type of a sentence, such as `"IN"` for integrated navigation.
    #[serde(default)]
    talker: Talker,
}

register! { Output, "nmea", NmeaSpec, "link = \"autopilot\"\nsentences = [\"GGA\", \"RMC\", \"HDT\"]\ntalker = \"IN\"" }

#[typetag::deserialize(name = "nmea")]
impl OutputSpec for NmeaSpec {
    fn link(&self) -> Option<&str> {
        Some(&self.link)
    }

    fn open(&self, _about: &About) -> io::Result<Box<dyn Output>> {
        Ok(Box::new(Nmea {
            sentences: self.sentences.0.clone(),
            talker: self.talker.0.clone(),
            bytes: Vec::new(),
        }))
    }
}

/// A type of sentences.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "UPPERCASE")]
enum Sentence {
    /// Time, position and quality.
    Gga,
    /// Time, date, position, speed and course.
    Rmc,
    /// 1σ of the position.
    Gst,
    /// True heading.
    Hdt,
    /// Course and speed.
    Vtg,
    /// Time and date.
    Zda,
    /// True heading with its mode.
    Ths,
}

impl Sentence {
    const fn word(self) -> &'static str {
        match self {
            Self::Gga => "GGA",
            Self::Rmc => "RMC",
            Self::Gst => "GST",
            Self::Hdt => "HDT",
            Self::Vtg => "VTG",
            Self::Zda => "ZDA",
            Self::Ths => "THS",
        }
    }
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(try_from = "Vec<Sentence>")]
struct Sentences(Vec<Sentence>);

impl Default for Sentences {
    fn default() -> Self {
        Self(vec![Sentence::Gga, Sentence::Rmc, Sentence::Gst, Sentence::Hdt])
    }
}

impl TryFrom<Vec<Sentence>> for Sentences {
    type Error = &'static str;

    fn try_from(sentences: Vec<Sentence>) -> Result<Self, Self::Error> {
        if sentences.is_empty() {
            return Err("there is no sentence to send: give one at least, such as \"GGA\"");
        }
        Ok(Self(sentences))
    }
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(try_from = "String")]
struct Talker(String);

impl Default for Talker {
    fn default() -> Self {
        Self("GN".to_owned())
    }
}

impl TryFrom<String> for Talker {
    type Error = String;

    fn try_from(talker: String) -> Result<Self, Self::Error> {
        match talker.as_bytes() {
            // `P` begins the sentences of manufacturers.
            [b'A'..=b'O' | b'Q'..=b'Z', b'A'..=b'Z' | b'0'..=b'9'] => Ok(Self(talker)),
            _ => Err(format!(
                "`{talker}` is not a talker, which has two capital letters, such as \"GN\" or \"IN\""
            )),
        }
    }
}

struct Nmea {
    sentences: Vec<Sentence>,
    talker: String,
    bytes: Vec<u8>,
}

impl Output for Nmea {
    fn send(&mut self, estimate: &Outgoing, to: Option<&mut dyn Sender>) -> io::Result<()> {
        let to = opened(to)?;
        let now = Now::of(estimate);
        self.bytes.clear();
        for sentence in &self.sentences {
            if let Some(fields) = now.fields(*sentence) {
                let body = format!("{}{},{fields}", self.talker, sentence.word());
                let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
                write!(self.bytes, "${body}*{sum:02X}\r\n")?;
            }
        }
        if self.bytes.is_empty() { Ok(()) } else { to.send(&self.bytes) }
    }
}
