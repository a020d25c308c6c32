//! The units of fields, as `FMTU`, `UNIT` and `MULT` define them.

use super::format::Format;
use std::collections::HashMap;

/// The mark of a field that counts instances.
const INSTANCE: u8 = b'#';

/// Units and multipliers by their letters, and the letters of the fields of each type.
#[derive(Debug, Default)]
pub(super) struct Units {
    units: HashMap<u8, String>,
    multipliers: HashMap<u8, f64>,
    /// The letters of the units and of the multipliers.
    of_types: HashMap<u8, (String, String)>,
    /// The field of a type that counts instances.
    instances: HashMap<u8, usize>,
}

impl Units {
    /// Uses a message `FMTU`, `UNIT` or `MULT`. `None` if it lacks a field.
    pub(super) fn define(&mut self, format: &Format, content: &[u8]) -> Option<()> {
        let text = |name: &str| format.text(format.field(name)?, content);
        let bytes = |name: &str| format.bytes(format.field(name)?, content);
        match format.name.as_str() {
            "UNIT" => {
                self.units.insert(*bytes("Id")?.first()?, text("Label")?.to_owned());
            }
            "MULT" => {
                let multiplier = f64::from_le_bytes(bytes("Mult")?.try_into().ok()?);
                self.multipliers.insert(*bytes("Id")?.first()?, multiplier);
            }
            _ => {
                let (kind, units) = (*bytes("FmtType")?.first()?, text("UnitIds")?);
                if let Some(field) = units.bytes().position(|unit| unit == INSTANCE) {
                    self.instances.insert(kind, field);
                }
                let multipliers = text("MultIds")?.to_owned();
                self.of_types.insert(kind, (units.to_owned(), multipliers));
            }
        }
        Some(())
    }

    /// The field of a type that counts instances.
    pub(super) fn instance(&self, kind: u8) -> Option<usize> {
        self.instances.get(&kind).copied()
    }

    /// The unit of a field, as designs write it. A field with its own divisor is in the unit without a prefix.
    pub(super) fn of(&self, kind: u8, field: usize, has_divisor: bool) -> Option<String> {
        let (units, multipliers) = self.of_types.get(&kind)?;
        let unit = self.units.get(units.as_bytes().get(field)?)?;
        let unit = match unit.as_str() {
            "" | "UNKNOWN" | "instance" => return None,
            "deglatitude" | "deglongitude" | "degheading" => "deg",
            "m/s/s" => "m/s^2",
            "deg/s/s" => "deg/s^2",
            "rad/s/s" => "rad/s^2",
            "Gauss" => "gauss",
            unit => unit,
        };
        let multiplier = multipliers.as_bytes().get(field).and_then(|letter| self.multipliers.get(letter));
        let Some(multiplier) = multiplier.filter(|multiplier| !has_divisor && **multiplier != 0.0 && **multiplier != 1.0) else {
            return Some(unit.to_owned());
        };
        // Multipliers were numbers of 32 bits once: 7 digits are sure.
        let prefix = [("d", 1e-1), ("c", 1e-2), ("m", 1e-3), ("u", 1e-6), ("n", 1e-9)];
        let prefix = prefix.iter().find(|(_, size)| (multiplier / size - 1.0).abs() < 1e-6);
        Some(match prefix {
            Some((prefix, _)) => format!("{prefix}{unit}"),
            None => format!("{:e} {unit}", *multiplier as f32),
        })
    }
}
