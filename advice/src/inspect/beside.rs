//! Several inertial units in the columns of one file.

use super::log::Log;
use super::names::signals;
use super::signal::{Kind, Signal};
use fusion::source::table::LogTable;

/// An inertial unit of a file that has several.
#[derive(Clone, Debug)]
pub struct Unit {
    /// The columns of the specific force.
    pub force: Vec<usize>,
    /// The columns of the angular rate.
    pub rate: Vec<usize>,
}

impl Unit {
    /// The units of a table, except the unit with these quantities, by the names of their columns.
    pub(super) fn beside(table: &mut LogTable, of: &[Signal], rate: f64) -> Vec<Self> {
        /// No vehicle has more units.
        const MOST: usize = 8;
        let columns = |of: &[Signal], kind: Kind| {
            let signal = of
                .iter()
                .find(|s| s.kind == kind && s.columns.len() == 3 && !s.why.starts_with("by its values"))?;
            Some(signal.columns.iter().map(|c| c.0).collect::<Vec<usize>>())
        };
        let unit = |of: &[Signal]| {
            Some(Self {
                force: columns(of, Kind::SpecificForce)?,
                rate: columns(of, Kind::AngularRate)?,
            })
        };
        let (mut all, mut hidden, mut last) = (Vec::new(), Vec::new(), unit(of));
        while let Some(found) = last.take().filter(|_| all.len() < MOST) {
            // Without a name a column is not found again.
            for k in found.force.iter().chain(&found.rate) {
                let of = &mut table.columns[*k];
                hidden.push((*k, core::mem::take(&mut of.name), of.label.take()));
            }
            all.push(found);
            last = unit(&signals(table, rate));
        }
        for (k, name, label) in hidden {
            (table.columns[k].name, table.columns[k].label) = (name, label);
        }
        all.into_iter().skip(1).collect()
    }
}

impl Log {
    /// A note about several units in one file.
    pub(super) fn side_by_side(&self) -> Option<String> {
        if self.others.is_empty() {
            return None;
        }
        let names = |columns: &[usize]| {
            let names = columns.iter().map(|k| format!("`{}`", self.table.columns[*k].name));
            names.collect::<Vec<_>>().join(" ")
        };
        let others = self
            .others
            .iter()
            .map(|unit| format!("{} with {}", names(&unit.force), names(&unit.rate)));
        Some(format!(
            "`{}` holds {} inertial units in columns side by side. The first one is used; for another write its columns instead: {}",
            self.name(),
            self.others.len() + 1,
            others.collect::<Vec<_>>().join(", or ")
        ))
    }
}
