//! Arrays of a MATLAB file, `.mat`: one sample in each row or column, read at once.
//!
//! Memory   all of the file, eight bytes for each number
//! Not here files of version 7.3 (HDF5), tables and other objects: see `format.rs`

mod format;
#[cfg(test)]
mod tests;

use self::format::{Content, Variable};
use super::decode::{Cell, Origin, Plan, RawRows, Stamp, format_spec, time_spec};
use super::table::LogTable;
use super::{DataFile, LogFormat, OpenContext, SourceSpec};
use crate::rows::{DataError, ProvidedChannel, RowStream, SourceError};
use fusion_core::math;
use fusion_models::block::BuildError;
use fusion_models::units::{Positive, dim};
use std::io::Read;
use std::path::{Path, PathBuf};

fusion_models::register!(
    Source,
    "mat",
    MatSpec,
    r#"
path = "trial.mat"
time = { rate = "100 Hz" }
[channels]
angular_rate = { columns = ["imu.gyro(:,1)", "imu.gyro(:,2)", "imu.gyro(:,3)"], unit = "deg/s" }
specific_force = { columns = ["imu.acc(:,1)", "imu.acc(:,2)", "imu.acc(:,3)"], unit = "m/s^2" }
"#
);

time_spec! {
    /// The stamp of a sample: log time = about + scale · (stamp − epoch − about) + offset.
    pub struct MatTimeSpec {
        /// Its array.
        column: Option<String>,
        /// Its unit; seconds by default.
        unit: Option<String>,
        /// The zero point of the stamps, if the design has sources with other clocks: all are converted to GPS
        /// time, which has no leap seconds.
        counts_from: Option<Origin>,
        /// The rate of a recording without stamps; its first sample is at zero.
        rate: Option<Positive<dim::Frequency>>,
    }
}

impl MatTimeSpec {
    fn stamp(&self) -> Stamp<'_> {
        Stamp {
            columns: vec![("time.column", self.column.as_deref().unwrap_or(NUMBER))],
            unit: if self.column.is_some() { self.unit.as_deref() } else { Some("ns") },
            counts_from: self.counts_from,
            ..Stamp::default()
        }
    }
}

/// The name of the column of counted stamps.
const NUMBER: &str = "the number of the sample";

static FORMAT: LogFormat = LogFormat {
    name: "mat",
    clock: None,
    endings: &[".mat"],
    recognises: |first| first.starts_with(b"MATLAB 5.0 MAT-file"),
    read: tables,
};

crate::inventory::submit! { FORMAT }

/// Makes a table of the arrays for each number of samples.
fn tables(path: &Path) -> Result<Vec<LogTable>, SourceError> {
    let context = OpenContext::default();
    let file = Undeclared::open(&DataFile::new(path, &context), &context)?;
    let table = |rows| {
        let mut table = LogTable::of_rows(path, &FORMAT, rows)?;
        table.rate.clone_from(&file.rate);
        let names: Vec<String> = table.columns.iter().map(|c| c.name.clone()).collect();
        table.columns.iter_mut().for_each(|c| c.label = label(&names, &c.name));
        Ok(table)
    };
    let mut tables = file.samples().into_iter().map(table).collect::<Result<Vec<_>, SourceError>>()?;
    match tables.first_mut() {
        Some(first) => first.arrays = file.arrays(),
        None => return Err(DataError::new(path.display().to_string(), "no array has ten samples or more").into()),
    }
    Ok(tables)
}

/// `imu_acc_y` for `imu.acc(:,2)`, an array of three columns; four columns are a quaternion. `None` for other counts.
fn label(columns: &[String], name: &str) -> Option<String> {
    let base = name.split_once('(')?.0;
    let same: Vec<&String> = columns.iter().filter(|c| c.split('(').next() == Some(base)).collect();
    let axes = match same.len() {
        3 => ["x", "y", "z"].as_slice(),
        4 => ["w", "x", "y", "z"].as_slice(),
        _ => return None,
    };
    let axis = same.iter().position(|c| *c == name)?;
    Some(format!("{}_{}", base.replace('.', "_"), axes[axis]))
}

format_spec! {
    /// Arrays of a MATLAB file of version 5, as `save` writes it with `-v6` or `-v7`. The columns are named as in
    /// MATLAB: `t`, `acc(:,2)`, `acc(2,:)`, `R(1,3,:)`, or `imu.acc(:,2)` for a field of a structure. Only arrays as
    /// long as the array of the stamps are columns; without stamps, the array of the first channel decides.
    pub struct MatSpec {
        /// The file, relative to the data directory.
        path: PathBuf,
        /// The clock: the array of the stamps, or their rate.
        time: MatTimeSpec,
    }
}

#[typetag::deserialize(name = "mat")]
impl SourceSpec for MatSpec {
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
        let variables = variables(&file, context)?;
        let guide = self.time.column.as_deref().or_else(|| plan.columns().next());
        let rows = Samples::new(variables, guide.unwrap_or_default(), self.time.rate.map(|rate| rate.si()));
        plan.decode(rows, &file, context)
    }

    fn open_rows(&self, rows: Box<dyn RawRows>, context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError> {
        self.plan()?.decode(rows, &DataFile::new(&self.path, context), context)
    }
}

impl MatSpec {
    fn plan(&self) -> Result<Plan<'_>, Vec<BuildError>> {
        let mut errors = Vec::new();
        let plan = self.rows().plan(&mut errors);
        if self.time.column.is_some() == self.time.rate.is_some() {
            let message = "a sample has its stamp in an array, or samples are evenly spaced";
            let help = "write `time = { column = \"t\" }` or `time = { rate = \"100 Hz\" }`";
            errors.push(BuildError::at("time", message).help(help));
        }
        if errors.is_empty() { Ok(plan) } else { Err(errors) }
    }
}

/// All arrays of a file.
fn variables(file: &DataFile, context: &OpenContext) -> Result<Vec<Variable>, SourceError> {
    let mut bytes = Vec::new();
    let wrong = |what: String| DataError::new(file.name(), what);
    let read = file.bytes(context)?.take(format::MOST + 1).read_to_end(&mut bytes);
    read.map_err(|error| wrong(format!("this file cannot be read: {error}")))?;
    if bytes.len() as u64 > format::MOST {
        return Err(wrong(format::too_large()).into());
    }
    Ok(format::variables(&bytes).map_err(wrong)?)
}

/// A file without a declaration.
pub(super) struct Undeclared {
    variables: Vec<Variable>,
    /// The name of the number that gives the rate, and the rate in samples per second.
    pub(super) rate: Option<(String, f64)>,
}

impl Undeclared {
    pub(super) fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        let variables = variables(file, context)?;
        let rate = variables.iter().find_map(|v| Some((v.name.clone(), rate_of(v)?)));
        Ok(Self { variables, rate })
    }

    /// The name of every array, and its shape or its kind if it has no numbers.
    pub(super) fn arrays(&self) -> Vec<(String, String)> {
        let shown = |v: &Variable| match v.content {
            Content::Other(what) => what.to_owned(),
            _ => v.shape(),
        };
        self.variables.iter().map(|v| (v.name.clone(), shown(v))).collect()
    }

    /// The samples of the arrays, grouped by length, the longest first.
    pub(super) fn samples(&self) -> Vec<Samples> {
        /// Shorter arrays are parameters.
        const FEWEST: usize = 10;
        let arrays = self.variables.iter().filter(|v| !matches!(v.content, Content::Other(_)));
        let mut guides: Vec<(usize, &str)> = arrays.filter_map(|v| Some((*v.shape.iter().max()?, v.name.as_str()))).collect();
        guides.retain(|(count, _)| *count >= FEWEST);
        guides.sort_by_key(|(count, _)| core::cmp::Reverse(*count));
        guides.dedup_by_key(|(count, _)| *count);
        let rate = self.rate.as_ref().map(|(_, rate)| *rate);
        let samples = guides.iter().map(|(_, guide)| Samples::new(self.variables.clone(), guide, rate));
        samples.collect()
    }
}

/// The rate given by a single number with a suitable name.
fn rate_of(variable: &Variable) -> Option<f64> {
    let number = match &variable.content {
        Content::Numbers(numbers) => *numbers.first()?,
        Content::Integers(numbers) => *numbers.first()? as f64,
        Content::Other(_) => return None,
    };
    let name = variable.name.to_lowercase();
    let last = name.rsplit(['.', '_']).next()?;
    let is_single = variable.shape.iter().all(|n| *n == 1);
    let rate = match last {
        "rate" | "fs" | "freq" | "frequency" | "hz" => number,
        "dt" | "ts" => number.recip(),
        _ => return None,
    };
    (is_single && rate > 0.0 && rate.is_finite()).then_some(rate)
}

/// The samples of some arrays.
#[derive(Debug)]
pub(super) struct Samples {
    variables: Vec<Variable>,
    columns: Vec<String>,
    /// Where the cells of each column are.
    places: Vec<Place>,
    /// Seconds between samples without stamps.
    interval: f64,
    count: usize,
    /// The number of the sample at hand, from 1.
    number: usize,
}

/// Where the cells of a column are: in an array, from element `first` on, every `step` elements.
#[derive(Clone, Copy, Debug)]
enum Place {
    Counted,
    Array { variable: usize, first: usize, step: usize },
}

impl Samples {
    /// The columns as long as the column `guide`.
    fn new(variables: Vec<Variable>, guide: &str, rate: Option<f64>) -> Self {
        let named = |guide: &str| variables.iter().find(|v| base(guide) == v.name);
        let guide = named(guide).or_else(|| named(guide.trim_start_matches('-')));
        let longest = |v: &Variable| v.shape.iter().copied().max();
        let count = guide.and_then(longest).or_else(|| variables.iter().filter_map(longest).max());
        let mut samples = Self {
            variables: Vec::new(),
            columns: Vec::new(),
            places: Vec::new(),
            interval: rate.map_or(0.0, f64::recip),
            count: count.unwrap_or(0),
            number: 0,
        };
        if rate.is_some() {
            samples.columns.push(NUMBER.to_owned());
            samples.places.push(Place::Counted);
        }
        for (k, variable) in variables.iter().enumerate() {
            samples.add(k, variable);
        }
        samples.variables = variables;
        samples
    }

    /// Makes columns of an array, if one of its dimensions has the number of samples.
    fn add(&mut self, number: usize, variable: &Variable) {
        let shape = &variable.shape;
        let Some(along) = shape.iter().position(|k| *k == self.count && *k > 0) else {
            return;
        };
        if matches!(variable.content, Content::Other(_)) {
            return;
        }
        let step: usize = shape[..along].iter().product();
        let others: usize = shape.iter().product::<usize>() / self.count;
        for other in 0..others {
            // The first cell of this column: `other` counts through all dimensions except the dimension of the samples.
            let (inner, outer) = (other % step, other / step);
            let index = |axis: usize| {
                let slower: usize = shape[..axis]
                    .iter()
                    .enumerate()
                    .filter(|(k, _)| *k != along)
                    .map(|(_, n)| n)
                    .product();
                other / slower % shape[axis] + 1
            };
            let indices = (0..shape.len()).map(|axis| if axis == along { ":".to_owned() } else { index(axis).to_string() });
            let is_vector = others == 1;
            let suffix = if is_vector {
                String::new()
            } else {
                format!("({})", indices.collect::<Vec<_>>().join(","))
            };
            self.columns.push(format!("{}{suffix}", variable.name));
            self.places.push(Place::Array {
                variable: number,
                first: inner + outer * step * self.count,
                step,
            });
        }
    }
}

/// The array of a column.
fn base(column: &str) -> &str {
    column.split('(').next().unwrap_or(column)
}

impl RawRows for Samples {
    fn columns(&self) -> &[String] {
        &self.columns
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        self.number += 1;
        Ok(self.number <= self.count)
    }

    fn place(&self) -> usize {
        self.number
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        let sample = self.number - 1;
        match self.places[column] {
            Place::Counted => Cell::Integer(math::round(sample as f64 * self.interval * 1e9) as i64),
            Place::Array { variable, first, step } => match &self.variables[variable].content {
                Content::Numbers(numbers) => Cell::Number(numbers[first + sample * step]),
                Content::Integers(numbers) => Cell::Integer(numbers[first + sample * step]),
                Content::Other(_) => Cell::Text(&[]),
            },
        }
    }

    fn absent(&self, column: &str) -> Option<String> {
        let variable = self.variables.iter().find(|v| v.name == base(column))?;
        let name = &variable.name;
        Some(match variable.content {
            Content::Other(what) => format!("`{name}` is {what}, not an array of numbers"),
            _ if !variable.shape.contains(&self.count) => {
                let count = self.count;
                format!(
                    "`{name}` is {}, which is not a column of {count} samples: give it its own source",
                    variable.shape()
                )
            }
            _ => format!("`{name}` is {}", variable.shape()),
        })
    }
}
