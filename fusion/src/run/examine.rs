//! Reports all mistakes of a design in one pass: of reading, assembling and opening, and those of the
//! variants that are not selected.

use crate::config::{Diagnostic, Diagnostics, Document, Node, Value};
use crate::design::{Design, Named, SensorDesign, truth};
pub use crate::load::build;
use crate::load::draft;
use crate::rows::FaultChain;
use crate::run::{Options, data_dir, open_one};
use crate::source::OpenContext;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use fusion_models::block::{Channel, InitialiserSpec, Taken};
use fusion_models::units::{Axes, dim, range};
use std::path::{Path, PathBuf};

/// How a missing data file is reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// It is a mistake.
    Told,
    /// It is accepted: the design may be checked without its data.
    Excused,
}

/// The design of `document`. If it has a mistake, its data files are opened too, so that their mistakes
/// are reported in the same run.
///
/// # Errors
/// Every mistake of reading, of the declared sources, of assembling, and of the data files.
pub fn examine(document: Document, options: &Options, missing: Missing) -> Result<Design, Diagnostics> {
    let (draft, mut d) = draft(document);
    if d.has_errors() {
        d.extend(opening(&draft, options, missing).iter().cloned());
        return Err(d);
    }
    draft.whole().map_err(|_| d)
}

/// Warnings about a design that is valid but may not do what its author expects.
#[must_use]
pub fn surprises(design: &Design) -> Diagnostics {
    let mut d = Diagnostics::new();
    d.extend(design.initialisers.iter().filter_map(|start| counted_twice(design, start)));
    // A library part declares simulated instruments that a recorded log does not need.
    if design.simulation.is_some() {
        d.extend(truth::shared(&design.document).iter().cloned());
        d.extend(idle_preset(&design.document));
    }
    d
}

/// A first fix with a declared 1σ, if a sensor of the same rows already estimates its slow error.
fn counted_twice(design: &Design, start: &Named<Box<dyn InitialiserSpec>>) -> Option<Diagnostic> {
    /// A 1σ may be too small by this factor: the 1σ of a slow error is hardly known better than to a fifth.
    const TOO_SMALL: f64 = 1.2;
    let Taken::Position(sigma) = start.block.takes() else { return None };
    let inputs = start.block.inputs();
    let taken = inputs.first()?;
    let reads = |sensor: &&Named<SensorDesign>| {
        let reading = sensor.block.model.reading();
        let is_taken = |channel: &Channel| taken.channels.iter().any(|c| c.name == channel.name);
        sensor.block.common.source == taken.source && reading.channels().iter().any(is_taken)
    };
    let factor = |sensor: &Named<SensorDesign>| {
        let bias = sensor
            .node
            .get("bias")
            .filter(|bias| bias.get("estimate").is_some_and(|e| matches!(e.value(), Value::Boolean(true))))?;
        let slow: Axes<dim::Length, range::NonNegative> = bias.get("sigma")?.read(&mut Diagnostics::new())?;
        // A horizontal sensor does not measure the height.
        let rows = sensor.block.model.noise().len();
        let ratios = slow.si().into_iter().zip(sigma).take(rows).map(|(slow, sigma)| slow / sigma);
        Some(math::hypot(1.0_f64, ratios.filter(|ratio| ratio.is_finite()).fold(0.0, f64::max)))
    };
    let found = design
        .sensors
        .iter()
        .filter(reads)
        .filter_map(|sensor| Some((&sensor.name, factor(sensor)?)));
    let (name, factor) = found.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, factor)| *factor > TOO_SMALL)?;
    let message = format!(
        "the first fix has the slow error of `{name}` too, its `bias`, and counts as if it had not: the 1σ of the position will be too \
         small, down to 1/{factor:.2} of the errors"
    );
    let help = "leave out `position_sigma`: then the next fixes give the position, with the error that lasts";
    Some(Diagnostic::warning(message).at(start.node.place_of("position_sigma")).help(help))
}

/// A preset of the simulated inertial unit that explicit figures override completely, as those of an included part.
fn idle_preset(document: &Document) -> Option<Diagnostic> {
    let imu = document.root().get("simulation")?.get("imu")?;
    let preset = imu.get("preset")?;
    let is_given = |triad: &str| {
        let figures = ["bias", "markov", "noise"];
        imu.get(triad)
            .is_some_and(|triad| figures.iter().all(|figure| triad.get(figure).is_some()))
    };
    ["gyro", "accelerometer"].iter().all(|triad| is_given(triad)).then(|| {
        let message = format!(
            "the preset {} changes nothing: `gyro` and `accelerometer` have their own figures, which take precedence",
            preset.inline()
        );
        let help = "set what is to differ, such as `simulation.imu.gyro.noise = 0`, or leave out the included part";
        Diagnostic::warning(message).at(preset.place()).help(help)
    })
}

/// Opens the data files of a design: mistakes in their headers, and in the faults declared on them.
/// A pipe is left to the run.
#[must_use]
pub fn opening<P>(design: &Design<P>, options: &Options, missing: Missing) -> Diagnostics {
    let mut d = Diagnostics::new();
    let sources = if design.simulation.is_some() { &[][..] } else { &design.sources };
    // If [run] has a mistake, a missing origin is not certain.
    let elsewhere = || {
        design.unread.run.then_some(Geodetic {
            lat: 0.0,
            lon: 0.0,
            height: 0.0,
        })
    };
    for named in sources {
        let context = OpenContext {
            data_dir: data_dir(design, options),
            name: named.name.clone(),
            origin: design.run.origin.map(Into::into).or_else(elsewhere),
            seed: design.run.seed,
            rows: options.rows.get(&named.name).cloned(),
            ..OpenContext::default()
        };
        // A wrong declaration was reported before.
        let Ok(channels) = named.block.source.channels() else { continue };
        let files = named.block.source.files();
        let mut files = files.iter().map(|f| context.resolve(f));
        let is_left = |file: PathBuf| {
            if file.exists() {
                is_pipe(&file)
            } else {
                missing == Missing::Excused
            }
        };
        if context.rows.is_none() && files.any(is_left) {
            // Checks the faults as far as possible without the file.
            let faults = FaultChain::new(&named.block.faults, &channels, |fault| context.fault_seed(fault));
            let mistakes = faults.err().unwrap_or_default();
            d.extend(mistakes.iter().map(|e| named.node.locate(e)));
            continue;
        }
        if let Err(e) = open_one(&named.block, &context) {
            d.extend(e.diagnostics(&named.node));
        }
    }
    let is_simulated = design.simulation.is_some() || design.unread.simulation;
    let recorded = design.reference.as_ref().filter(|_| !is_simulated);
    // A reference to a source that could not be read is not reported as a second mistake.
    let is_unread = |name: &str| design.unread.streams.iter().any(|unread| unread == name);
    if let Some(r) = recorded.filter(|r| !r.block.source.names().any(is_unread)) {
        let mistakes = super::reference::check(r, &design.sources).err().unwrap_or_default();
        d.extend(mistakes.iter().cloned());
    }
    d
}

/// Whether a file can be read only once, by the run itself: neither a regular file nor a folder.
#[must_use]
pub fn is_pipe(file: &Path) -> bool {
    std::fs::metadata(file).is_ok_and(|m| !m.is_file() && !m.is_dir())
}

/// The mistakes of the variants of `file` that are not in `selected`. Each variant is laid over the base
/// alone, and mistakes of the base itself are not repeated. A variant that is only valid on top of
/// another variant, as in `bank+late`, is not reported.
#[must_use]
pub fn variants(file: &Document, selected: &[&str]) -> Diagnostics {
    let mut all = Diagnostics::new();
    let entries = file.root().get("variant").map_or(&[][..], Node::entries);
    let names: Vec<&str> = entries.iter().map(|e| e.key.as_str()).collect();
    let with = |layers: &[&str]| {
        let mut document = file.clone();
        let mut laid = layers.iter().map(|name| document.overlay(&format!("variant.{name}")));
        match laid.find_map(Result::err) {
            None => draft(document).1,
            Some(mistake) => mistake.into(),
        }
    };
    let mut base: Option<Diagnostics> = None;
    for name in names.iter().filter(|name| !selected.contains(name)) {
        let mistakes = with(&[name]);
        if mistakes.is_empty() {
            continue;
        }
        let base = base.get_or_insert_with(|| with(&[]));
        let is_new = |mistakes: &Diagnostics| mistakes.iter().any(|m| !is_among(m, base));
        let others = || names.iter().filter(|other| *other != name);
        if is_new(&mistakes) && others().any(|other| !is_new(&with(&[other, name]))) {
            continue;
        }
        for mistake in mistakes.iter().filter(|m| !is_among(m, base)) {
            let message = format!("variant `{name}`: {}", mistake.message);
            let named = Diagnostic {
                message,
                ..mistake.clone()
            };
            all.push(named);
        }
    }
    all
}

fn is_among(mistake: &Diagnostic, known: &Diagnostics) -> bool {
    known.iter().any(|k| k.message == mistake.message && k.place == mistake.place)
}
