//! Rows of a stream at the epochs of another stream.
//!
//! Rule       after each row of `each`, the first row of `source` that is finite passes, with its own stamp; all others
//!            do not. So a filter uses an instrument only when another instrument has a row, like a published
//!            filter that is updated by all its rows at once
//! Valid      a source much faster than the other stream: its row comes up to one of its intervals later
//! Not here   interpolation to the exact time

use fusion_core::literal;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::{Emitter, Stage};
use fusion_core::state::View;
use fusion_core::time::Time;

/// The input whose rows pass.
const SOURCE: usize = 0;

/// The runtime stage.
#[derive(Clone, Debug, Literal)]
pub struct OncePer {
    /// True if the next row passes.
    is_due: bool,
}
memory!(OncePer { is_due });

impl Stage for OncePer {
    fn row(&mut self, input: usize, time: Time, row: &[f64], _: Option<&View<'_>>, out: &mut Emitter<'_>) {
        if input != SOURCE {
            self.is_due = true;
        } else if self.is_due && row.iter().all(|v| v.is_finite()) {
            self.is_due = false;
            out.emit(time, row);
        }
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, Listen, StageSpec};
    use crate::de::DeserializeSpec;
    use crate::units::{Dimensional, dim};
    use crate::vocabulary::channel;
    use schemars::JsonSchema;
    use serde::Deserialize;

    /// Passes one row of a stream for each row of another.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct OncePerSpec {
        /// The stream whose rows pass.
        source: String,
        /// The stream whose rows trigger them.
        each: String,
        /// The channel of a row that passes.
        channel: Passed,
    }

    /// A channel by its name.
    #[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    enum Passed {
        /// `attitude`, a quaternion.
        Attitude,
        /// `heading`.
        Heading,
        /// `velocity`, north, east, down.
        Velocity,
        /// `body_velocity`, forward, right, down.
        BodyVelocity,
        /// `depth`, down positive.
        Depth,
    }

    impl Passed {
        const fn channel(self) -> Channel {
            match self {
                Self::Attitude => channel::ATTITUDE,
                Self::Heading => channel::HEADING,
                Self::Velocity => channel::VELOCITY,
                Self::BodyVelocity => channel::BODY_VELOCITY,
                Self::Depth => Channel::vector("depth", 1, dim::Length::KIND.dimension),
            }
        }
    }

    crate::register!(
        Stage,
        "once_per",
        OncePerSpec,
        r#"
source = "reference_unit"
each = "usbl"
channel = "attitude"
"#
    );

    #[typetag::deserialize(name = "once_per")]
    impl StageSpec for OncePerSpec {
        fn inputs(&self) -> Vec<Listen> {
            let listen = |source: &str, channels| Listen {
                source: source.to_owned(),
                channels,
            };
            vec![listen(&self.source, vec![self.channel.channel()]), listen(&self.each, Vec::new())]
        }

        fn output(&self) -> Vec<Channel> {
            vec![self.channel.channel()]
        }

        fn build(&self, _: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError> {
            Ok(Box::new(OncePer { is_due: false }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, StageSpec};
    use crate::earth::Gravity;
    use fusion_core::state::LayoutBuilder;

    #[test]
    fn one_row_passes_after_each_of_the_other_stream() {
        let spec: OncePerSpec = toml::from_str("source = 'a'\neach = 'b'\nchannel = 'depth'").unwrap();
        let mut layout = LayoutBuilder::new();
        let mut build = Build {
            name: "stage",
            layout: &mut layout,
            origin: None,
            gravity: Gravity::default(),
        };
        let mut stage = spec.build(&mut build).unwrap();
        let mut out = Emitter::default();
        for k in 0..50 {
            // The other stream at 0.95 s, 1.95 s and so on, the last of them twice.
            let other = [9, 19, 29, 39].iter().filter(|t| **t == k - 1).count() + usize::from(k == 40);
            (0..other).for_each(|_| stage.row(1, Time::from_nanos(k * 100_000_000 - 50_000_000), &[], None, &mut out));
            stage.row(SOURCE, Time::from_nanos(k * 100_000_000), &[k as f64], None, &mut out);
        }
        let passed: Vec<(f64, f64)> = out.rows().map(|(t, row)| (t.seconds(), row[0])).collect();
        assert_eq!(passed, [(1.0, 10.0), (2.0, 20.0), (3.0, 30.0), (4.0, 40.0)]);
    }
}
