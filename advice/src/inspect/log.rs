//! A file with the quantities found in it.

use super::beside::Unit;
use super::clock::{Clock, Form};
use super::day::read_times_of_day;
use super::names::{is_derived, signals};
use super::numbers::{Vec3, median};
use super::signal::{Kind, Signal};
use super::track::{Odometer, Track};
use super::words::Words;
use fusion::source::table::{LogTable, Role};
use fusion_core::math;

/// A file with the quantities found in it.
#[derive(Clone, Debug)]
pub struct Log {
    /// The rows.
    pub table: LogTable,
    /// The stamps; `None` if no column looks like time.
    pub clock: Option<Clock>,
    /// The instruments in the file, if there are several; the rows are those of the first one.
    pub instances: Option<Instances>,
    /// The quantities.
    pub signals: Vec<Signal>,
    /// The inertial units in other columns of the file, in addition to the unit that is used.
    pub others: Vec<Unit>,
}

/// Several instruments of one kind that write to one file in turn; each row has the number of its instrument.
#[derive(Clone, Debug, PartialEq)]
pub struct Instances {
    /// The column with the numbers.
    pub column: usize,
    /// The numbers, in order. The log holds only the rows of the first one.
    pub numbers: Vec<f64>,
}

impl Instances {
    /// Finds the instruments of a table in which time often does not increase from row to row, but does so for each
    /// instrument.
    fn of(table: &LogTable, clock: &Clock) -> Option<Self> {
        /// Time does not increase in more rows than this share.
        const OFTEN: f64 = 0.1;
        /// A condition may fail in this share of the rows.
        const FEW: f64 = 0.01;
        /// No vehicle has more instruments of one kind.
        const MOST: usize = 8;
        let t = &clock.stamps;
        let still: Vec<usize> = (1..t.len()).filter(|k| t[*k] <= t[*k - 1]).collect();
        if (still.len() as f64) < OFTEN * t.len() as f64 {
            return None;
        }
        let tells = |column: &usize| {
            let values = &table.columns[*column].values;
            let mut numbers: Vec<f64> = Vec::new();
            for v in values {
                if !(math::fract(*v) == 0.0 && (0.0..16.0).contains(v)) || numbers.len() > MOST {
                    return None;
                }
                if !numbers.contains(v) {
                    numbers.push(*v);
                }
            }
            numbers.sort_by(f64::total_cmp);
            let alike = still.iter().filter(|k| values[**k] == values[**k - 1]).count() as f64;
            let is_sound = |number: &f64| {
                let own: Vec<f64> = t.iter().zip(values).filter(|(_, v)| *v == number).map(|(t, _)| *t).collect();
                let still = own.windows(2).filter(|w| w[1] <= w[0]).count() as f64;
                own.len() * MOST > t.len() && still <= FEW * own.len() as f64
            };
            let is_told = (2..=MOST).contains(&numbers.len()) && alike <= FEW * still.len() as f64;
            (is_told && numbers.iter().all(is_sound)).then_some(numbers)
        };
        (0..table.columns.len()).find_map(|column| {
            Some(Self {
                column,
                numbers: tells(&column)?,
            })
        })
    }
}

/// Rows in which a quantity does not change.
#[derive(Clone, Copy, Debug, Default)]
pub struct Repeats {
    /// The share of rows that repeat the one before.
    pub share: f64,
    /// The longest time without a change \[s\].
    pub longest: f64,
}

impl Log {
    /// Looks at a table.
    #[must_use]
    pub fn of(mut table: LogTable) -> Self {
        read_times_of_day(&mut table);
        let mut clock = Clock::of(&table);
        let instances = clock.as_ref().and_then(|clock| Instances::of(&table, clock));
        if let Some(Instances { column, numbers }) = &instances {
            let is_own: Vec<bool> = table.columns[*column].values.iter().map(|v| *v == numbers[0]).collect();
            for column in &mut table.columns {
                let mut own = is_own.iter();
                column.values.retain(|_| own.next() == Some(&true));
            }
            clock = Clock::of(&table);
        }
        let rate = clock.as_ref().map_or(f64::NAN, |c| c.rate);
        let signals = match table.role {
            Role::Other => Vec::new(),
            _ => signals(&table, rate),
        };
        let mut log = Self {
            instances,
            others: Unit::beside(&mut table, &signals, rate),
            table,
            clock,
            signals,
        };
        log.settle_velocity();
        log
    }

    /// Finds the unit of a velocity, or of the receiver's own speed, from the positions in the same file, if no name
    /// gives it.
    fn settle_velocity(&mut self) {
        let is_own = |s: &Signal| matches!(s.kind, Kind::Velocity | Kind::GroundSpeed);
        let Some(k) = self.signals.iter().position(is_own) else { return };
        let mut bare = self.clone();
        bare.signals.retain(|s| !is_own(s));
        let Some(track) = Track::of(&bare, None) else { return };
        let (signal, t) = (&self.signals[k], self.stamps().to_vec());
        let said = signal.values(&self.table).iter().map(|v| math::hypot(v[0], v[1])).collect();
        let speed = Odometer::new(t, said);
        if let Some((unit, ratio)) = speed.unit(&track) {
            self.signals[k].take_unit(unit, &format!("{ratio:.2} times the speed between the positions in m/s"));
        }
    }

    /// The name of its file, with the topic if the file has several streams.
    #[must_use]
    pub fn name(&self) -> String {
        self.table.name()
    }

    /// A note about several instruments in the file.
    pub(super) fn several(&self) -> Option<String> {
        let Instances { column, numbers } = self.instances.as_ref()?;
        let (all, first) = (numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(", "), numbers[0]);
        let (file, column) = (self.name(), &self.table.columns[*column].name);
        Some(format!(
            "`{file}` holds {} instruments in turn, with the numbers {all} in `{column}`. Only the rows of number {first} are looked at: `valid = {{ \
             column = \"{column}\", equals = {first} }}`",
            numbers.len()
        ))
    }

    /// Notes about the file itself: its damage, and what it says about itself.
    pub(super) fn of_file(&self) -> Vec<String> {
        let file = self.table.path.file_name().unwrap_or_default().to_string_lossy();
        let broken = self.table.broken.iter().map(|broken| format!("is damaged: {broken}"));
        broken
            .chain(self.table.remarks.iter().cloned())
            .map(|note| format!("`{file}`: {note}"))
            .collect()
    }

    /// A note about stamps of messages that cannot be used.
    pub(super) fn of_stamps(&self) -> Option<String> {
        self.clock.as_ref()?.instead(&self.table)
    }

    /// A note about several recordings in the file.
    pub(super) fn recordings(&self) -> Option<String> {
        let Form::Recordings { second, each } = self.clock.as_ref()?.form else {
            return None;
        };
        let numbers = &self.table.columns[second].values;
        Some(format!(
            "`{}` holds {} recordings, whose clocks begin anew with each `{}`: they are put one after the other, {each} s for each number",
            self.name(),
            numbers.chunk_by(|a, b| a == b).count(),
            self.table.columns[second].name
        ))
    }

    /// Whether another filter wrote it, or a simulation: by the type of its messages, or else by its name, such as `NKF1`
    /// or `ATT` of an autopilot.
    #[must_use]
    pub fn is_estimate(&self) -> bool {
        match self.table.role {
            Role::Unknown => {}
            role => return matches!(role, Role::Estimate | Role::Truth),
        }
        const WHOLE: [&str; 3] = ["pos", "att", "ahr"];
        const WORDS: [&str; 6] = ["nkf", "xkf", "ekf", "kf", "estimate", "estimated"];
        let name = self.name().to_lowercase();
        let stem = name.split('.').next().unwrap_or_default();
        let of_file = stem.trim_end_matches(|c: char| c.is_ascii_digit());
        let mut words = stem
            .split(|c: char| !c.is_alphanumeric())
            .map(|w| w.trim_end_matches(|c: char| c.is_ascii_digit()));
        WHOLE.contains(&of_file) || words.any(|word| WORDS.contains(&word))
    }

    /// Whether a receiver wrote these positions: by the name of the file, or by columns that only a receiver reports.
    pub(super) fn is_of_receiver(&self) -> bool {
        const FILES: [&str; 4] = ["gps", "gnss", "receiver", "nmea"];
        const COLUMNS: [&str; 9] = ["status", "nsats", "nsat", "satellites", "numsv", "sats", "hdop", "pdop", "fixtype"];
        let name = self.name().to_lowercase();
        let has_positions = self.has(Kind::Geodetic) || self.has(Kind::Local);
        let is_named = FILES.iter().any(|word| name.contains(word));
        let reports = || self.table.columns.iter().any(|c| Words::of(c.called()).ends_with(&COLUMNS));
        let is_measured = self.table.role == Role::Measurement;
        has_positions && !self.is_estimate() && (is_measured || is_named || reports())
    }

    /// The signal of a kind.
    #[must_use]
    pub fn signal(&self, kind: Kind) -> Option<&Signal> {
        self.signals.iter().find(|s| s.kind == kind)
    }

    /// Whether it has a signal of this kind.
    #[must_use]
    pub fn has(&self, kind: Kind) -> bool {
        self.signal(kind).is_some()
    }

    /// Whether its velocity over ground has no vertical part.
    pub(super) fn has_flat_velocity(&self) -> bool {
        self.signal(Kind::Velocity).is_some_and(|s| s.columns.len() < 3)
    }

    /// The stamps \[s\].
    pub(super) fn stamps(&self) -> &[f64] {
        self.clock.as_ref().map_or(&[], |c| c.stamps.as_slice())
    }

    /// Rows a second; NaN without time.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.clock.as_ref().map_or(f64::NAN, |c| c.rate)
    }

    /// Its duration \[s\].
    pub(super) fn duration(&self) -> f64 {
        self.clock.as_ref().map_or(0.0, |c| c.span().1 - c.span().0)
    }

    /// The values of a kind in SI units, increments as rates.
    pub(super) fn values(&self, kind: Kind) -> Option<Vec<Vec3>> {
        let signal = self.signal(kind)?;
        let mut values = signal.values(&self.table);
        if signal.increment {
            values.iter_mut().for_each(|v| *v = v.map(|x| x * self.rate()));
        }
        Some(values)
    }

    /// Rows in which all columns of a signal repeat the row before.
    #[must_use]
    pub fn repeats(&self, signal: &Signal) -> Repeats {
        let (mut same, mut all, mut longest, mut since) = (0.0, 0.0_f64, 0.0_f64, 0);
        let t = self.stamps();
        for row in 1..self.table.rows() {
            let is_same = signal.columns.iter().all(|(k, _)| {
                let v = &self.table.columns[*k].values;
                v[row] == v[row - 1]
            });
            all += 1.0;
            if is_same {
                same += 1.0;
                if let (Some(a), Some(b)) = (t.get(since), t.get(row)) {
                    longest = longest.max(b - a);
                }
            } else {
                since = row;
            }
        }
        Repeats {
            share: same / all.max(1.0),
            longest,
        }
    }

    /// Whether rows that repeat these quantities are copies of a measurement. Several measured numbers do not stay the
    /// same to the last digit. A single number does so at rest or at a steady speed. It counts as measured, unless its
    /// new values usually last for more than a row.
    pub(super) fn repeats_are_copies(&self, signals: &[&Signal]) -> bool {
        let column = |k: usize| &self.table.columns[k].values;
        let moves = |k: &usize| column(*k).windows(2).any(|w| w[0] < w[1]);
        let mut columns: Vec<usize> = signals.iter().flat_map(|s| s.columns.iter().map(|c| c.0)).filter(moves).collect();
        columns.sort_unstable();
        columns.dedup();
        let [only] = columns[..] else { return true };
        median(column(only).chunk_by(|a, b| a == b).map(|run| run.len() as f64)) > 1.0
    }

    /// The share of rows in which a signal has a column without a number.
    pub(super) fn missing(&self, signal: &Signal) -> f64 {
        let rows = self.table.rows();
        let lost = (0..rows).filter(|row| !signal.raw(&self.table, *row).iter().all(|v| v.is_finite()));
        lost.count() as f64 / rows.max(1) as f64
    }

    /// The share of rows in which the first two columns of a position are exactly zero: some loggers write zeros for a
    /// missing position.
    pub(super) fn zeros(&self, signal: &Signal) -> f64 {
        let rows = self.table.rows();
        let is_zero = |row: &usize| signal.raw(&self.table, *row)[..2].iter().all(|v| *v == 0.0);
        (0..rows).filter(is_zero).count() as f64 / rows.max(1) as f64
    }

    /// Why a design does not read a column; `None` for a quantity without a design.
    pub(super) fn why_unused(&self, column: usize, is_designed: bool) -> Option<String> {
        let signal = self.signals.iter().find(|s| s.columns.iter().any(|c| c.0 == column));
        if self.instances.as_ref().is_some_and(|i| i.column == column) {
            return Some("distinguishes the instruments of this file".to_owned());
        }
        if self
            .others
            .iter()
            .any(|unit| unit.force.contains(&column) || unit.rate.contains(&column))
        {
            return Some("another inertial unit in this file".to_owned());
        }
        if let Some(signal) = signal.filter(|_| self.is_estimate()) {
            let said = format!(
                "{}: by the name of the file the estimate of another filter, no measurement",
                signal.kind.name()
            );
            return is_designed.then_some(said);
        }
        if let Some(signal) = signal {
            return is_designed.then(|| format!("{}: {}", signal.kind.name(), signal.kind.why_unused()));
        }
        let values = || self.table.columns[column].values.iter().copied().filter(|v| v.is_finite());
        let first = values().next();
        Some(match first {
            None => "no numbers".to_owned(),
            Some(first) if values().all(|v| v == first) => format!("always {first}"),
            Some(_) if is_derived(&self.table.columns[column].name) => "what another filter made of other columns".to_owned(),
            Some(_) => "no quantity is known by this name".to_owned(),
        })
    }

    /// The median of a column.
    pub(super) fn typical(&self, column: usize) -> f64 {
        median(self.table.columns[column].values.iter().copied())
    }
}
