//! Reasons with the names of the design.

use crate::assembly::Assembly;
use crate::observe::Heard;
use core::fmt;
use fusion_core::health::{Reason, State};
use fusion_core::memory::{Memory, Tape};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// One of the words of the program: under this name, serde does not borrow it from its input.
type Word = &'static str;

/// A reason for the health of a filter, in the names of the design.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct NamedReason {
    /// The reason: `no_input`, `stopped`, `gave_up`, `refused`, `unsound`, `floor`, `calibration`,
    /// `pulled`, `jumped`, `innovations`, `biased`, `rejected`, `reacquired`, `silent`, `ahead`, `unaided`, `undecided`.
    #[serde(deserialize_with = "reason_from_word")]
    pub reason: Word,
    /// The sensor, stream or block; empty for the whole filter.
    pub of: String,
    /// The health state that it causes.
    #[serde(serialize_with = "word", deserialize_with = "from_word")]
    #[schemars(schema_with = "words")]
    pub state: State,
}

/// Every word that a reason can have.
const WORDS: [&str; 23] = [
    "",
    "no_input",
    "stopped",
    "gave_up",
    "refused",
    "unsound",
    "floor",
    "calibration",
    "pulled",
    "jumped",
    "innovations",
    "biased",
    "rejected",
    "reacquired",
    "silent",
    "ahead",
    "unaided",
    "undecided",
    State::Good.word(),
    State::Aligning.word(),
    State::Coasting.word(),
    State::Degraded.word(),
    State::Lost.word(),
];

impl Memory for NamedReason {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.choice(&mut self.reason, &WORDS);
        self.of.remember(tape);
        self.state.remember(tape);
    }
}

impl NamedReason {
    /// In a few words, with the sensor, stream or block.
    fn words(&self) -> &'static str {
        match (self.reason, self.state) {
            ("no_input", _) => "no input",
            ("stopped", _) => "stopped for want of input",
            ("gave_up", _) => "lost for long, and waits to start anew",
            ("refused", _) => "a step was refused",
            ("unsound", _) => "the belief is not sound",
            ("floor", _) => "σ below its floor",
            ("calibration", _) => "far from its initial value",
            ("pulled", _) => "moved too far while sensors disagreed",
            ("jumped", _) => "moved by far more than its 1σ",
            ("innovations", State::Lost) => "innovations beyond all σ",
            ("innovations", _) => "innovations too large",
            ("biased", _) => "innovations have a mean that chance does not explain",
            ("rejected", State::Lost) => "rejected for long, and so is another, or none measures the same motion",
            ("rejected", _) => "rejected",
            ("reacquired", _) => "re-acquired",
            ("ahead", _) => "stamped ahead of the process input",
            ("unaided", _) => "nothing measures position or velocity",
            ("undecided", _) => "several headings are still possible",
            ("silent", State::Good) => "silent, and others measure what it does",
            _ => "silent",
        }
    }
}

impl fmt::Display for NamedReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.of.as_str() {
            "" => f.write_str(self.words()),
            name => write!(f, "`{name}` {}", self.words()),
        }
    }
}

/// A state as its word.
pub fn word<S: Serializer>(state: &State, s: S) -> Result<S::Ok, S::Error> {
    s.serialize_str(state.word())
}

/// The words of states.
pub(super) fn words(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "string", "enum": State::ALL.map(State::word) })
}

/// A state from its word.
///
/// # Errors
/// An error if the word does not name a state.
pub fn from_word<'de, D: Deserializer<'de>>(d: D) -> Result<State, D::Error> {
    let word = String::deserialize(d)?;
    let named = State::ALL.into_iter().find(|state| state.word() == word);
    named.ok_or_else(|| D::Error::custom(format!("`{word}` is no state of health")))
}

fn reason_from_word<'de, D: Deserializer<'de>>(d: D) -> Result<&'static str, D::Error> {
    let word = String::deserialize(d)?;
    let known = WORDS.into_iter().find(|known| *known == word);
    known.ok_or_else(|| D::Error::custom(format!("`{word}` is no reason of a health")))
}

/// The names of a filter's sensors, blocks and streams, by number.
#[derive(Clone, Debug, Default)]
pub struct Names {
    sensors: Vec<String>,
    blocks: Vec<String>,
    streams: Vec<String>,
}

impl Names {
    /// The names of an observed filter; `assembly` has the streams of the outermost filter.
    #[must_use]
    pub fn new(filter: &Heard, assembly: &Assembly) -> Self {
        let streams = if filter.is_outermost() { &assembly.streams[..] } else { &[] };
        Self {
            sensors: filter.sensors.iter().map(|s| s.name.clone()).collect(),
            blocks: filter.layout.blocks().iter().map(|b| filter.named(&b.name)).collect(),
            streams: streams.iter().map(|s| s.name.clone()).collect(),
        }
    }

    /// A reason in these names.
    #[must_use]
    pub fn of(&self, reason: Reason) -> NamedReason {
        let (word, all, number) = match reason {
            Reason::InputGap => ("no_input", None, 0),
            Reason::Stopped => ("stopped", None, 0),
            Reason::GaveUp => ("gave_up", None, 0),
            Reason::Refused => ("refused", None, 0),
            Reason::Unsound => ("unsound", None, 0),
            Reason::Floor { block } => ("floor", Some(&self.blocks), block),
            Reason::Calibration { block } => ("calibration", Some(&self.blocks), block),
            Reason::Pulled { block } => ("pulled", Some(&self.blocks), block),
            Reason::Jumped { block } => ("jumped", Some(&self.blocks), block),
            Reason::Innovations { sensor, .. } => ("innovations", Some(&self.sensors), sensor),
            Reason::Biased { sensor } => ("biased", Some(&self.sensors), sensor),
            Reason::Rejected { sensor, .. } => ("rejected", Some(&self.sensors), sensor),
            Reason::Reacquired { sensor } => ("reacquired", Some(&self.sensors), sensor),
            Reason::Unaided => ("unaided", None, 0),
            Reason::Undecided => ("undecided", None, 0),
            Reason::Silent { sensor, .. } => ("silent", Some(&self.sensors), sensor),
            Reason::StreamSilent { stream } => ("silent", Some(&self.streams), stream),
            Reason::Ahead { stream } => ("ahead", Some(&self.streams), stream),
            other => (other.state().word(), None, 0),
        };
        NamedReason {
            reason: word,
            of: all.and_then(|names| names.get(number)).cloned().unwrap_or_default(),
            state: reason.state(),
        }
    }
}
