//! The rules of advice: each finding and each warning of a comparison of channels belongs to one of them.
//!
//! A rule has an id, which `--ignore` takes and which has its heading in the book (`book/src/rules.md`). If a
//! rule is certain of a correction, it has an [`Edit`](fusion::config::Edit). [`fix`] writes edits into a copy of the
//! design.

mod fix;

pub(crate) use fix::set;
pub use fix::{Fixed, fix};

use fusion::run::Rule;

macro_rules! rules {
    ($($id:literal: $says:literal,)*) => {
        &[$(Rule { id: $id, says: $says }),*]
    };
}

/// All rules, those of a run first.
pub const ALL: &[Rule] = rules! {
    // A run.
    "log-damaged": "A log is damaged or cut off.",
    "never-started": "All sources have rows, but the filter never started.",
    "lost": "The filter was lost outside declared outages.",
    "late-start": "The filter started after a quarter of the log.",
    "input-range": "Samples of the input are outside the declared range.",
    "fault-used": "Rows that a declared fault disturbed were used, and the errors are too large.",
    "wrong-input": "All sensors disagree with the estimate: the input of the process drives it.",
    "poor-start": "The initial 1σ of an angle is too large for one linearisation.",
    "input-spikes": "Input samples were treated as spikes.",
    "parameter-far": "A parameter ended far from its initial value.",
    "first-to-disagree": "A sensor disagreed before the sensors whose measurements were rejected.",
    "reacquired": "A sensor was re-acquired against the estimate.",
    "gate-rejects": "A gate rejected more than outliers.",
    "never-held": "A detector never held in a run that failed.",
    "nis-large": "Innovations of a sensor are larger than the filter expects.",
    "parameter-moved": "A sensor with large innovations moved a calibration by many of its 1σ.",
    "innovations-repeat": "Each innovation repeats the one before, so the measurements are overweighted.",
    "heading-undecided": "Several headings are still possible at the end.",
    "heading-changed": "The bank showed one heading for long and then another one.",
    "heading-constant": "The heading error is nearly constant.",
    "reference-heading": "Most of the heading error is an error of the reference.",
    "heading-wrong": "The heading is wrong by far, although its 1σ is small.",
    "reference-latency": "A latency of the reference explains most of the position error.",
    "reference-late": "The reference reads an instrument that the filter knows to be late.",
    "reference-arm": "An offset of the reference point explains most of the position error.",
    "nees-large": "Errors are larger than the 1σ of the filter.",
    "nees-small": "Errors are much smaller than the 1σ of the filter.",
    "attitude-outside": "Too many attitude errors are outside 3σ.",
    "outages-outside": "Too many outages end with an error above 3σ.",
    "outage-far": "One outage ends with an error that no chance explains.",
    "uncertain-start": "The initial 1σ of the heading is large, and the attitude is overconfident.",
    "nis-small": "Innovations of a sensor are smaller than its noise explains.",
    "innovations-last": "Innovations have the expected size but are correlated.",
    "nis-beyond-chance": "Innovations are slightly too large, by more than chance allows.",
    "parameter-unlearnt": "The data told nothing of an estimated parameter.",
    "input-gap": "The input had no usable sample for some time, and the filter coasted.",
    "row-gap": "A source of a sensor has a long gap.",
    // A comparison of channels.
    "axes": "The axes of a channel differ from the declared ones.",
    "unit": "The numbers of a channel are in another unit.",
    "named-unit": "The name of a column states another unit than declared.",
    "attitude-form": "An attitude is in another form than declared.",
    "heading-form": "A heading is in another form than declared.",
    "position-far": "Positions are far from where they should be.",
    "position-form": "Positions are in another form than declared.",
    "clock": "The stamps of a source are late or early.",
    "clock-unit": "The stamps of a source are in another unit.",
    "sensor-axes": "The axes of a sensor that the filter does not follow are turned.",
    "sensor-sign": "The numbers of a sensor that the filter does not follow have another sign or unit.",
    "sensor-columns": "The columns of a sensor that the filter does not follow are exchanged.",
    "arm-sign": "A lever arm has the wrong sign.",
    "fixed-parameter": "A fixed parameter of a sensor has another value.",
};
