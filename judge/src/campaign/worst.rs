//! The runs with the largest errors.

use super::RunRow;

/// The longest list of runs.
pub(super) const WORST: usize = 200;

/// Lists by position error and by attitude error, the largest first; NaN last, equal ones in order of the runs.
#[derive(Clone, Debug, Default)]
pub(super) struct Worst {
    by: [Vec<RunRow>; 2],
    has_positions: bool,
}

/// The error that ranks a run: the position error, or the attitude error.
fn key(row: &RunRow, by: usize) -> f64 {
    let error = [row.position_rmse, row.rotation_rmse][by];
    if error.is_nan() { f64::NEG_INFINITY } else { error }
}

impl Worst {
    pub(super) fn add(&mut self, row: &RunRow) {
        self.has_positions = self.has_positions || row.position_rmse.is_finite();
        for (by, list) in self.by.iter_mut().enumerate() {
            let at = list.partition_point(|known| key(known, by).total_cmp(&key(row, by)).is_ge());
            if at < WORST {
                list.insert(at, brief(row));
                list.truncate(WORST);
            }
        }
    }

    /// Without positions the attitude judges.
    pub(super) fn first(&self) -> &[RunRow] {
        &self.by[usize::from(!self.has_positions)]
    }
}

/// The run without its vectors.
fn brief(row: &RunRow) -> RunRow {
    RunRow {
        blocks: Vec::new(),
        sensors: Vec::new(),
        control: None,
        drift: Vec::new(),
        findings: Vec::new(),
        history: None,
        ..row.clone()
    }
}
