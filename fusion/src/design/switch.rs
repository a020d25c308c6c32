//! `switch`: rows that set a sensor while the filter runs.

use fusion_models::block::{Channel, Listen};
use fusion_models::units::Dimension;
use schemars::JsonSchema;
use serde::Deserialize;

/// The rows that switch a sensor: from an operator, from another program, or from a stage. A row holds from its time on,
/// until the next one.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, try_from = "Table")]
#[schemars(with = "Table")]
pub struct SwitchSpec {
    /// The source or stage of the rows.
    pub source: String,
    /// The channel of the use.
    pub used: Option<String>,
    /// The channel of the factor on the noise.
    pub noise: Option<String>,
}

/// The table.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Switch")]
struct Table {
    /// The source or stage of the rows.
    source: String,
    /// Its channel with one number: the sensor is not used while it is 0.
    used: Option<String>,
    /// Its channel with one positive number, a factor on the 1σ of the noise.
    noise: Option<String>,
}

impl TryFrom<Table> for SwitchSpec {
    type Error = &'static str;

    fn try_from(Table { source, used, noise }: Table) -> Result<Self, Self::Error> {
        if used.is_none() && noise.is_none() {
            return Err("`switch` names no channel: add `used`, `noise` or both");
        }
        Ok(Self { source, used, noise })
    }
}

impl SwitchSpec {
    /// The channels that it reads, that of the use first.
    pub(crate) fn listen(&self) -> Listen {
        let number = |name: &String| Channel {
            name: name.clone().into(),
            ..Channel::vector("", 1, Dimension::NONE)
        };
        Listen {
            source: self.source.clone(),
            channels: self.used.iter().chain(&self.noise).map(number).collect(),
        }
    }
}
