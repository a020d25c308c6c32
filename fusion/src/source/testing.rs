//! The laws of sources, for every registered one: of this crate or of another.

use super::{OpenContext, SourceSpec};
use crate::config::{Diagnostics, Document};
use crate::rows::width;
use fusion_core::time::Time;
use fusion_models::registry::Registration;

/// Checks a source's example, opened over existing files with `rows` rows. Its rows must be as wide as its
/// channels, finite and numbered upwards, and their stamps must never go back. The open stream must have the
/// declared channels. The report must count the delivered and the left-out rows, and their sum must be the
/// rows of the files.
///
/// # Errors
/// A sentence that names the source and its mistake.
pub fn check(r: &Registration, context: &OpenContext, rows: u64) -> Result<(), String> {
    law(r, context, rows).map_err(|e| format!("source `{}`: {e}", r.name))
}

/// The declaration in a registration's example.
///
/// # Errors
/// The mistake in the example.
pub fn example(r: &Registration) -> Result<Box<dyn SourceSpec>, String> {
    let (document, mistakes) = Document::parse("example.toml", &format!("type = {:?}\n{}", r.name, r.example));
    let mut d = Diagnostics::new();
    d.extend(mistakes);
    let spec = document.root().read_block::<dyn SourceSpec>("source", &[r.name], &mut d);
    spec.ok_or_else(|| format!("its example is not its spec: {d}"))
}

fn law(r: &Registration, context: &OpenContext, rows: u64) -> Result<(), String> {
    let spec = example(r)?;
    let channels = spec.channels().map_err(|e| format!("its example declares no channels: {}", e[0]))?;
    let mut stream = spec.open(context).map_err(|e| e.to_string())?;
    if stream.channels() != channels {
        return Err(format!("it declares {channels:?} and opens as {:?}", stream.channels()));
    }
    let (mut values, mut delivered) = (Vec::new(), 0);
    let (mut first, mut last): (Option<Time>, Option<(Time, u64)>) = (None, None);
    while let Some(stamp) = stream.next(&mut values).map_err(|e| e.to_string())? {
        let at = format!("row {delivered}, number {} of {}", stamp.number, stamp.time);
        if values.len() != width(&channels) {
            return Err(format!("{at}: it has {} numbers, its channels {}", values.len(), width(&channels)));
        }
        if !values.iter().all(|v| v.is_finite()) {
            return Err(format!("{at}: {values:?} are not all numbers"));
        }
        if last.is_some_and(|(time, number)| stamp.time < time || stamp.number <= number) {
            return Err(format!("{at}: it comes after {last:?}"));
        }
        first = first.or(Some(stamp.time));
        last = Some((stamp.time, stamp.number));
        delivered += 1;
    }
    let report = stream.report();
    if (report.rows, report.used, report.left_out()) != (rows, delivered, rows - delivered.min(rows)) {
        return Err(format!("of {rows} rows it has delivered {delivered}, and reports: {report}"));
    }
    if (report.first, report.last) != (first, last.map(|(time, _)| time)) {
        return Err(format!("it has delivered rows from {first:?} to {last:?}, and reports: {report}"));
    }
    if delivered == 0 {
        return Err("it delivers nothing".to_owned());
    }
    Ok(())
}

/// The rows that a declared source reads.
#[cfg(test)]
pub(super) mod recorded {
    use super::*;
    use crate::rows::SourceError;
    use serde::de::DeserializeOwned;
    use std::path::Path;

    /// The time of the log in nanoseconds and the numbers, for each row.
    pub(in super::super) type Rows = Vec<(i64, Vec<f64>)>;

    /// A source as declared.
    pub(in super::super) fn spec<S: DeserializeOwned>(toml: &str) -> S {
        let (document, _) = Document::parse("filter.toml", toml);
        let mut diagnostics = Diagnostics::new();
        document.root().read(&mut diagnostics).unwrap_or_else(|| panic!("{diagnostics}"))
    }

    /// All rows, or the error.
    pub(in super::super) fn rows(spec: &dyn SourceSpec, data_dir: &Path) -> Result<Rows, String> {
        let context = OpenContext {
            data_dir: data_dir.to_owned(),
            ..OpenContext::default()
        };
        let shown = |error: SourceError| error.to_string();
        let mut stream = spec.open(&context).map_err(shown)?;
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        while let Some(stamp) = stream.next(&mut values).map_err(shown)? {
            rows.push((stamp.time.nanos(), values.clone()));
        }
        Ok(rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_models::registry::{self, Role};
    use std::fmt::Write;

    /// Rows of a generated file.
    const ROWS: u64 = 60;

    /// The content of the file that a source's example reads: [`ROWS`] rows, some of them not valid.
    fn fixture(name: &str) -> Option<Vec<u8>> {
        match name {
            "csv" => {
                let mut text = "t_s,q,lat_deg,lon_deg,h_m,vn_mps,ve_mps,vd_mps\n".to_owned();
                for k in 0..ROWS {
                    let (quality, t) = (if k % 7 == 3 { 5 } else { 1 }, 100.0 + 0.2 * k as f64);
                    let _ = writeln!(text, "{t:.3},{quality},47.{k:02},8.5,{k},1.5,-0.{k:02},0");
                }
                Some(text.into_bytes())
            }
            "mat" => Some(include_bytes!("mat/tests/sixty.mat").to_vec()),
            "rtklib" => {
                let mut text = "% program : RTKLIB\n%  GPST  latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m)\n".to_owned();
                for k in 0..ROWS {
                    let quality = if k % 7 == 3 { 5 } else { 1 };
                    let _ = writeln!(text, "2025/07/08 19:34:{k:02}.250  47.{k:02}   8.5 {k} {quality} 21 0.01 0.01 0.02");
                }
                Some(text.into_bytes())
            }
            _ => None,
        }
    }

    #[test]
    fn every_source_obeys_the_laws_of_sources() {
        fusion_models::link();
        let dir = std::env::temp_dir().join(format!("fusion-sources-{}", std::process::id()));
        let context = OpenContext {
            data_dir: dir.clone(),
            name: "example".to_owned(),
            ..OpenContext::default()
        };
        let mut tried = 0;
        for r in registry::all().into_iter().filter(|r| r.role == Role::Source) {
            let text = fixture(r.name).unwrap_or_else(|| panic!("there is no file to try source `{}` on: add one", r.name));
            for file in example(r).unwrap().files() {
                let path = context.resolve(&file);
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                std::fs::write(path, &text).unwrap();
            }
            check(r, &context, ROWS).unwrap_or_else(|e| panic!("{e}"));
            let wrong = check(r, &context, ROWS + 1).unwrap_err();
            assert!(wrong.contains("reports"), "a row that is lost is not noticed: {wrong}");
            tried += 1;
        }
        std::fs::remove_dir_all(dir).unwrap();
        assert!(tried > 0, "no source is registered");
    }
}
