//! Lines of JSON.

use super::line::Line;
use super::{About, Outgoing, Output, OutputSpec, opened};
use crate::link::Sender;
use fusion::models::register;
use fusion::output::EstimateClock;
use schemars::JsonSchema;
use serde::Deserialize;
use std::io;

/// One line of JSON for each estimate: time, position, velocity, attitude, their 1σ, age and health. Angles are in
/// degrees, everything else in SI.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JsonSpec {
    /// The link by which it is sent.
    link: String,
}

register! { Output, "json", JsonSpec, r#"link = "console""# }

#[typetag::deserialize(name = "json")]
impl OutputSpec for JsonSpec {
    fn link(&self) -> Option<&str> {
        Some(&self.link)
    }

    fn open(&self, about: &About) -> io::Result<Box<dyn Output>> {
        Ok(Box::new(Lines {
            clock: about.clock,
            line: Vec::new(),
        }))
    }
}

struct Lines {
    clock: EstimateClock,
    line: Vec<u8>,
}

impl Output for Lines {
    fn send(&mut self, estimate: &Outgoing, to: Option<&mut dyn Sender>) -> io::Result<()> {
        self.line.clear();
        serde_json::to_writer(&mut self.line, &Line::of(estimate, self.clock))?;
        self.line.push(b'\n');
        opened(to)?.send(&self.line)
    }
}
