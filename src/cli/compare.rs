//! `fusion compare`.

use super::{DesignArgs, Failure, print, report};
use clap::Args;
use fusion::campaign::Comparison;
use fusion::config::{Diagnostic, Diagnostics};
use fusion::run::{Options, run};
use std::path::PathBuf;

/// The design without a variant.
const BASE: &str = "base";

#[derive(Debug, Args)]
pub(super) struct CompareArgs {
    /// The designs; without one, the built-in one.
    configs: Vec<PathBuf>,
    /// Variants of each design to run, by commas; `base` is the design as it stands.
    #[arg(long, value_name = "A,B,C", value_delimiter = ',', default_value = BASE)]
    variant: Vec<String>,
    /// Replaces one value in every run, after the variant.
    #[arg(long, value_name = "PATH=VALUE")]
    set: Vec<String>,
    /// Where relative source paths start, instead of at the design's `data_dir`.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Seed of simulated data and random faults, the same for every run.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

pub(super) fn compare(args: &CompareArgs) -> Result<(), Failure> {
    let configs: Vec<Option<PathBuf>> =
        if args.configs.is_empty() { vec![None] } else { args.configs.iter().cloned().map(Some).collect() };
    let mut comparison = Comparison::default();
    let mut warnings = Diagnostics::new();
    for config in &configs {
        for variant in &args.variant {
            let named = DesignArgs {
                config: config.clone(),
                variant: if variant == BASE { Vec::new() } else { vec![variant.clone()] },
                set: args.set.clone(),
                data: args.data.clone(),
            };
            let options = Options { data: args.data.clone(), base: named.base(), out: None, seed: args.seed };
            let summary = run(&named.read()?, &options, &mut |_| {})?;
            let name = match config {
                Some(path) if configs.len() > 1 => format!("{} {variant}", path.display()),
                _ => variant.clone(),
            };
            warnings.extend(summary.warnings().into_iter().map(|w| Diagnostic::warning(format!("{name}: {w}"))));
            comparison.runs.push((name, summary));
        }
    }
    print(&comparison.to_string())?;
    report(&warnings);
    Ok(())
}
