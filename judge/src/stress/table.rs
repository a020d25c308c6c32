//! stress.csv and draw.csv.

use super::draw::Drawn;
use super::{CaseOutcome, CaseVerdict, Stress};
use fusion::output::Cells;
use std::io::{self, Write};

impl Stress {
    /// Writes stress.csv: one row per case, with the settings for `--set` that repeat it. A cell without a
    /// value is empty.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn write(&self, out: impl Write) -> io::Result<()> {
        let mut cells = Cells::new(out);
        cells.texts([
            "fault",
            "on",
            "size",
            "from_s",
            "to_s",
            "survived",
            "worst_sigma",
            "worst_of",
            "position_m",
        ])?;
        cells.texts([
            "attitude_rad",
            "recovered_s",
            "missing_s",
            "unsaid_s",
            "health",
            "reason",
            "health_after_s",
        ])?;
        cells.texts(["verdict", "stopped", "set"])?;
        cells.end()?;
        for row in core::iter::once(&self.undisturbed).chain(&self.rows) {
            let (case, outcome) = (&row.case, &row.outcome);
            cells.texts([case.fault.as_str(), &case.on, &case.size])?;
            // To a microsecond: rows are further apart.
            cells.put(format_args!("{:.6}", case.from.seconds()))?;
            cells.put(format_args!("{:.6}", case.to.seconds()))?;
            outcome.write(&mut cells)?;
            cells.text(row.verdict().map_or("", CaseVerdict::word))?;
            cells.text(outcome.stopped.as_deref().unwrap_or_default())?;
            cells.text(&case.sets.join("\n"))?;
            cells.end()?;
        }
        cells.flush()
    }
}

impl Drawn {
    /// Writes draw.csv: one row per case, with the settings for `--set` that repeat it.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn write(&self, out: impl Write) -> io::Result<()> {
        let mut cells = Cells::new(out);
        cells.texts(["case", "fault", "on", "size", "from_s", "to_s"])?;
        cells.texts(["recovered", "false_good", "false_alarm", "late_good"])?;
        cells.texts([
            "worst_sigma",
            "worst_rms",
            "end_sigma",
            "end_rms",
            "false_s",
            "large_s",
            "alarm_s",
            "alarm_after_s",
        ])?;
        cells.texts(["stopped", "set"])?;
        cells.end()?;
        for row in &self.rows {
            let (case, judged) = (&row.case, &row.judged);
            cells.put(row.number)?;
            cells.texts([case.fault.as_str(), &case.on, &case.size])?;
            cells.put(format_args!("{:.3}", case.from.seconds()))?;
            cells.put(format_args!("{:.3}", case.to.seconds()))?;
            for is_so in [judged.recovered, judged.false_good, judged.false_alarm, judged.late_good] {
                cells.put(is_so)?;
            }
            for (sigma, rms) in [judged.worst, judged.end].map(Option::unzip) {
                cells.maybe(sigma)?;
                cells.maybe(rms)?;
            }
            for seconds in [judged.unsaid, judged.large, judged.alarm[0], judged.alarm[1]] {
                cells.put(seconds)?;
            }
            cells.text(judged.stopped.as_deref().unwrap_or_default())?;
            cells.text(&case.sets.join("\n"))?;
            cells.end()?;
        }
        cells.flush()
    }
}

impl CaseOutcome {
    fn write(&self, cells: &mut Cells<impl Write>) -> io::Result<()> {
        cells.put(self.survived)?;
        cells.maybe(self.worst.as_ref().map(|(ratio, _)| ratio))?;
        cells.text(self.worst.as_ref().map_or("", |(_, group)| group))?;
        cells.maybe(self.metres)?;
        cells.maybe(self.angle)?;
        cells.maybe(self.recovered)?;
        cells.put(self.missing)?;
        cells.put(self.unsaid)?;
        cells.text(self.health.as_ref().map_or("", |said| said.state.word()))?;
        cells.maybe(self.health.as_ref().and_then(|said| said.reason.as_ref()))?;
        cells.maybe(self.health.as_ref().map(|said| said.after))
    }
}
