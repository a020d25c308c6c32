//! Solutions of RTKLIB, `.pos`: rows of blank-separated text below comments, the last of which names the
//! columns. Its first name is the time system, and stands over two fields: the date and the time of day, or
//! the GPS week and the seconds of it.
//!
//! Source    RTKLIB 2.4.2 manual, appendix B.1
//! Not here  angles in degrees, minutes and seconds; fields separated by other than blanks

use super::csv::{CsvRows, Dialect, Head, Names};
use super::decode::{Cell, Malformed, Origin, Plan, RawRows, Scale, Stamp, decimal_nanos, format_spec, time_spec};
use super::table::LogTable;
use super::{DataFile, LogFormat, OpenContext, OwnClock, SourceSpec};
use crate::rows::{DataError, ProvidedChannel, RowStream, SourceError};
use fusion_models::block::BuildError;
use std::path::PathBuf;

fusion_models::register!(
    Source,
    "rtklib",
    RtklibSpec,
    r#"
path = "drive/gnss.pos"
time = { epoch = "2025-07-08T19:34:18Z" }
valid = { column = "Q", equals = [1, 2] }
[channels.position]
latitude = "latitude(deg)"
longitude = "longitude(deg)"
height = "height(m)"
[channels.position_sigma]
columns = ["sdn(m)", "sde(m)", "sdu(m)"]
"#
);

static FORMAT: LogFormat = LogFormat {
    name: "rtklib",
    clock: Some(OwnClock {
        unit: "ns",
        counts_from: Some(Origin::Gps),
    }),
    endings: &[".pos", ".pos.gz"],
    recognises: |first| first.starts_with(b"% program"),
    read: |path| {
        let context = OpenContext::default();
        let rows = PosRows::open(&DataFile::new(path, &context), &context)?;
        Ok(vec![LogTable::of_rows(path, &FORMAT, rows)?])
    },
};

crate::inventory::submit! { FORMAT }

time_spec! {
    /// The clock of a solution, which names its time system itself: a number as `epoch` is nanoseconds of GPS time.
    pub struct PosTimeSpec {}
}

impl PosTimeSpec {
    /// The reader makes nanoseconds of GPS time of every stamp.
    fn stamp(&self) -> Stamp<'static> {
        Stamp {
            columns: vec![("time", STAMP)],
            unit: Some("ns"),
            counts_from: Some(Origin::Gps),
            ..Stamp::default()
        }
    }
}

/// The column of the stamp.
const STAMP: &str = "time";

format_spec! {
    /// A solution of RTKLIB, `.pos`, plain or gzip-compressed. Its columns are called as in the file, such as
    /// `latitude(deg)`, `Q` and `sdn(m)`; their units are those in brackets.
    pub struct RtklibSpec {
        /// The file, relative to the data directory; gzip is recognised by its content.
        path: PathBuf,
        /// The clock; GPS time, UTC or JST is read from the file.
        #[serde(default)]
        time: PosTimeSpec,
    }
}

#[typetag::deserialize(name = "rtklib")]
impl SourceSpec for RtklibSpec {
    fn files(&self) -> Vec<PathBuf> {
        vec![self.path.clone()]
    }

    fn channels(&self) -> Result<Vec<ProvidedChannel>, Vec<BuildError>> {
        Ok(self.plan()?.provided())
    }

    fn time_zero(&self) -> Option<i64> {
        self.rows().time_zero()
    }

    fn open(&self, context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError> {
        let plan = self.plan()?;
        let file = DataFile::new(&self.path, context);
        let rows = PosRows::open(&file, context)?;
        plan.decode(rows, &file, context)
    }

    fn open_rows(&self, rows: Box<dyn RawRows>, context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError> {
        self.plan()?.decode(rows, &DataFile::new(&self.path, context), context)
    }
}

impl RtklibSpec {
    fn plan(&self) -> Result<Plan<'_>, Vec<BuildError>> {
        let mut errors = Vec::new();
        let plan = self.rows().plan(&mut errors);
        if errors.is_empty() { Ok(plan) } else { Err(errors) }
    }
}

/// The rows of a solution: those of the text, but that the two fields of a stamp are one column.
pub(super) struct PosRows {
    text: CsvRows,
    columns: Vec<String>,
    system: System,
    /// Nanoseconds of GPS time of the row at hand, or what is wrong with its stamp.
    stamp: Result<i64, String>,
}

/// A time system: its calendar, and how far its clocks are ahead of it.
#[derive(Clone, Copy, Debug)]
struct System {
    scale: Scale,
    ahead: i128,
}

const HOUR: i128 = 3_600_000_000_000;

impl System {
    fn new(name: &str) -> Option<Self> {
        let (scale, ahead) = match name {
            "GPST" => (Scale::Gps, 0),
            "UTC" => (Scale::Utc, 0),
            "JST" => (Scale::Utc, 9 * HOUR),
            _ => return None,
        };
        Some(Self { scale, ahead })
    }

    /// The instant of a date and a time of day, or of a week and its seconds.
    fn instant(self, first: &str, second: &str) -> Result<i64, String> {
        let instant = if first.contains(['/', '-']) {
            let instant = self.scale.of_day(first, second, None);
            instant.map_err(|what| format!("`{first} {second}` {what}"))? - self.ahead
        } else {
            let count = decimal_nanos(first, 168 * HOUR).zip(decimal_nanos(second, HOUR / 3600));
            let instant = count.and_then(|(week, seconds)| self.scale.of_count(week + seconds - self.ahead));
            instant.ok_or_else(|| format!("`{first} {second}` is neither a date and time nor a GPS week with its seconds"))?
        };
        i64::try_from(instant).map_err(|_| format!("`{first} {second}` lies beyond the 292 years that a log spans"))
    }
}

impl PosRows {
    pub(super) fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        let dialect = Dialect {
            delimiter: None,
            comment: Some("%"),
        };
        let mut text = CsvRows::open(dialect, Head::of(Names::Comment), file, context)?;
        let named = text.columns().to_vec();
        let (first, rest) = named.split_first().map_or(("", &[][..]), |(first, rest)| (first.as_str(), rest));
        let wrong = |message: String, help: &str| SourceError::from(DataError::new(file.name(), message).help(help.to_owned()));
        let Some(system) = System::new(first) else {
            let message = format!("the last comment before the rows begins with `{first}`, not with GPST, UTC or JST");
            return Err(wrong(message, "is this a solution of RTKLIB, written with `out-outhead = on`?"));
        };
        if let Some(column) = rest.iter().find(|column| column.contains("(d'")) {
            let message = format!("`{column}` is in degrees, minutes and seconds");
            return Err(wrong(message, "write it in degrees: `out-degform = deg`"));
        }
        let columns = |stamp: &[&str]| stamp.iter().map(|s| (*s).to_owned()).chain(rest.iter().cloned()).collect();
        text.rename(columns(&["date or week", "time of day or of week"]));
        Ok(Self {
            text,
            columns: columns(&[STAMP]),
            system,
            stamp: Ok(0),
        })
    }
}

impl RawRows for PosRows {
    fn columns(&self) -> &[String] {
        &self.columns
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        let is_there = self.text.advance()?;
        if is_there {
            let shown = |column| self.text.cell(column).shown().into_owned();
            self.stamp = self.system.instant(&shown(0), &shown(1));
        }
        Ok(is_there)
    }

    fn place(&self) -> usize {
        self.text.place()
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        match (column, &self.stamp) {
            (0, Ok(stamp)) => Cell::Integer(*stamp),
            (0, Err(_)) => Cell::Text(&[]),
            _ => self.text.cell(column + 1),
        }
    }

    fn malformed(&self) -> Option<Malformed> {
        let of_stamp = |message: &String| Malformed {
            message: message.clone(),
            help: "is this row damaged?",
            is_last: false,
        };
        self.text.malformed().or_else(|| self.stamp.as_ref().err().map(of_stamp))
    }
}

#[cfg(test)]
mod tests;
