//! `fusion compare`.

use super::montecarlo::quoted;
use super::part::{self, range, refused};
use super::progress::Runs;
use super::run::written;
use super::{DesignArgs, Failure, OutputArgs, as_warnings, report};
use clap::Args;
use core::ops::Range;
use fusion::BASE;
use fusion::design::{Design, differences};
use fusion::examine::{Missing, variants};
use fusion::output::FileSet;
use fusion::provenance::Provenance;
use fusion::run::{Keep, Options, Smoothing, Summary};
use fusion_judge::campaign::{Campaign, Runner, read};
use fusion_judge::likelihood::Terms;
use fusion_judge::part::{Head, Kind, Parts, Subject};
use fusion_present::Shown;
use fusion_present::campaign::{health, pooled};
use fusion_present::comparison;
use fusion_present::report::{Run, record, write};
use fusion_tables::Page;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct CompareArgs {
    /// The designs; without a file, the built-in design.
    configs: Vec<PathBuf>,
    /// Variants of each design to run, separated by commas. `base` is the design without a variant, `A+B` applies B
    /// after A.
    #[arg(long, value_name = "A,B,C", value_delimiter = ',', default_value = BASE, hide_default_value = true)]
    variant: Vec<String>,
    /// Backends to run each variant with, separated by commas, each in place of the table [filter]: `ekf`,
    /// `error_state`, `iekf`, `invariant`, `ukf`, or any chart, update and form, as in `invariant+iterated` or
    /// `left_invariant+unscented+joseph`.
    #[arg(long, value_name = "A,B,C", value_delimiter = ',')]
    backend: Vec<String>,
    /// Replaces one value in every run, after the variant.
    #[arg(long, value_name = "PATH=VALUE")]
    set: Vec<String>,
    /// Where relative source paths start, instead of at the design's `data_dir`.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Writes report.html with all runs here; creates the folder if necessary. Not with `-n`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of simulated data and random faults, the same for every run. With `-n`, the seed of the campaigns, 1 by
    /// default.
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Smooths every run by all its data, in memory, and shows smoothed estimates next to the others.
    #[arg(long)]
    smooth: bool,
    /// In place of `-n`: runs these numbers only, such as 50..100, of campaigns that start at 0; the last number is not included.
    #[arg(long, value_name = "A..B", conflicts_with_all = ["n", "out", "smooth"], value_parser = range)]
    runs: Option<Range<u64>>,
    /// Writes the runs of all designs to this file, for `fusion merge`.
    #[arg(long, value_name = "FILE", conflicts_with = "out", requires = "runs")]
    part: Option<PathBuf>,
    /// Runs each N times and compares the figures of all runs together. Each time has another seed, but the same seeds
    /// for all. Not with `--out` or `--smooth`: `fusion montecarlo --out` writes the page of one variant.
    #[arg(short, alias = "n", value_name = "N", conflicts_with_all = ["out", "smooth"], value_parser = clap::value_parser!(u64).range(1..))]
    n: Option<u64>,
    #[command(flatten)]
    output: OutputArgs,
}

/// Each variant with each backend, or with the design's backend if no backend is given.
fn pairs<'a>(variants: &'a [String], backends: &'a [String]) -> impl Iterator<Item = (&'a String, Option<&'a String>)> {
    let of = move |variant| {
        let own = backends.is_empty().then_some(None);
        own.into_iter()
            .chain(backends.iter().map(Some))
            .map(move |backend| (variant, backend))
    };
    variants.iter().flat_map(of)
}

pub(super) fn compare(args: &CompareArgs) -> Result<(), Failure> {
    let configs: Vec<Option<PathBuf>> = if args.configs.is_empty() {
        vec![None]
    } else {
        args.configs.iter().cloned().map(Some).collect()
    };
    // Reports files that cannot be written before the runs.
    let files = args.out.as_deref().map(FileSet::begin).transpose()?;
    let (mut results, mut recordings, mut title) = (Vec::<(String, Summary)>::new(), Vec::new(), String::new());
    let mut terms = Vec::new();
    let numbers = args.runs.clone().or(args.n.map(|n| 0..n));
    let (mut work, mut names) = (Vec::<(Design, Options)>::new(), Vec::new());
    let bar = Runs::new();
    let number = configs.len() * pairs(&args.variant, &args.backend).count();
    for config in &configs {
        let all = DesignArgs {
            config: config.clone(),
            variant: args.variant.clone(),
            set: args.set.clone(),
            backend: None,
            data: args.data.clone(),
        };
        let file = all.load()?;
        report(&as_warnings(&variants(&file, &all.selection().names())));
        for (variant, backend) in pairs(&args.variant, &args.backend) {
            let named = DesignArgs {
                variant: vec![variant.clone()],
                backend: backend.cloned(),
                ..all.clone()
            };
            let options = Options {
                data: args.data.clone(),
                base: named.base(),
                seed: args.seed,
                smooth: if args.smooth {
                    Smoothing::Whole(Keep::Memory)
                } else {
                    Smoothing::Declared
                },
                ..Options::default()
            };
            let design = named.design(&file, Missing::Told)?;
            let path = config.as_ref().filter(|_| configs.len() > 1).map(|p| p.display().to_string());
            let variant = Some(variant.clone()).filter(|v| backend.is_none() || v != BASE);
            let name: Vec<String> = path.into_iter().chain(variant).chain(backend.cloned()).collect();
            let name = name.join(" ");
            names.push(name.clone());
            work.push((design, options));
            if numbers.is_some() {
                continue;
            }
            let (design, options) = &work[work.len() - 1];
            bar.at(results.len() as u64, number as u64);
            let mut own = Terms::new(design);
            let (finished, recording) = record(design, options, &mut [&mut own], &mut |_| {})?;
            terms.push(own);
            title.clone_from(&design.run.description);
            recordings.push(recording);
            results.push((name, finished.summary));
        }
    }
    if let Some(numbers) = numbers {
        let references = other_references(&names, &work);
        let seed = args.seed.unwrap_or(1);
        let subjects = names.iter().zip(&work).map(|(name, (design, _))| Subject::new(name, design, seed));
        let total = (numbers.end - numbers.start) * number as u64;
        let head = Head {
            again: format!("{} --seed {seed}", args.typed()),
            ..Head::new(Kind::Compare, subjects.collect(), numbers, None)
        };
        let head = head.sharing(&references)?;
        let told = |done| bar.at(done as u64, total);
        let runner = Runner::new(seed, 0, false, &told)?;
        let mut failed = None;
        let part = part::work(args.part.as_deref(), |file| {
            failed = runner.write(&work, &head, file)?;
            Ok(())
        })?;
        drop(bar);
        if let Some(mistakes) = failed.filter(|_| args.part.is_none()) {
            return Err(mistakes.into());
        }
        let parts = part.into();
        let mut page = together(&parts, &read(&parts).map_err(refused)?)?;
        page.sections.extend(args.part.clone().map(|path| written([path])));
        return args.output.print(&page);
    }
    drop(bar);
    let named: Vec<(&str, &Summary)> = results.iter().map(|(name, summary)| (name.as_str(), summary)).collect();
    let told = named
        .iter()
        .flat_map(|(name, s)| Shown(*s).warnings().into_iter().map(move |w| format!("{name}: {w}")));
    let mut page = Page {
        title: title.clone(),
        provenance: Provenance::common(named.iter().map(|(_, summary)| &summary.identity().provenance)),
        warnings: told.chain(other_references(&names, &work)).collect(),
        sections: comparison::sections(&named),
    };
    let likelihoods: Vec<(&str, &Terms)> = results
        .iter()
        .zip(&terms)
        .map(|((name, _), terms)| (name.as_str(), terms))
        .collect();
    page.sections.push(comparison::likelihood(&likelihoods));
    if let (Some(out), Some(mut files)) = (&args.out, files) {
        let runs = named.iter().zip(&recordings);
        let runs: Vec<Run<'_>> = runs.map(|(&(name, summary), recording)| Run { name, recording, summary }).collect();
        write(&mut files, &title, &runs)?;
        files.commit()?;
        page.sections.push(written([out.join("report.html")]));
    }
    args.output.print(&page)
}

impl CompareArgs {
    /// The command, without its numbers and files, as a user types it.
    fn typed(&self) -> String {
        let first = DesignArgs {
            config: None,
            variant: Vec::new(),
            set: self.set.clone(),
            backend: None,
            data: self.data.clone(),
        };
        let files = self.configs.iter().map(|path| quoted(&path.display().to_string()));
        let mut words: Vec<String> = ["fusion compare".to_owned()].into_iter().chain(files).collect();
        for (option, names) in [("variant", &self.variant), ("backend", &self.backend)] {
            words.extend((!names.is_empty()).then(|| format!("--{option} {}", names.join(","))));
        }
        first.typed(&words.join(" ").replacen("fusion ", "", 1))
    }
}

/// A sentence for each run that is judged by another reference than the first run.
fn other_references(names: &[String], work: &[(Design, Options)]) -> Vec<String> {
    let of = |(name, (design, _)): (&String, &(Design, Options))| {
        let differ = differences(&work.first()?.0, design);
        (!differ.is_empty()).then(|| {
            let differ = differ.join("; ");
            format!("{name}: judged by another [reference] than the first, so that their errors do not compare: {differ}")
        })
    };
    names.iter().zip(work).filter_map(of).collect()
}

/// The figures of campaigns over the same seeds.
pub(super) fn together(parts: &Parts, campaigns: &[Campaign]) -> Result<Page, Failure> {
    let named: Vec<(&str, &Campaign)> = campaigns.iter().map(|c| (c.subject.name.as_str(), c)).collect();
    let told = named
        .iter()
        .flat_map(|(name, c)| Shown(*c).warnings().into_iter().map(move |w| format!("{name}: {w}")));
    let references: Vec<String> = parts.shared().map_err(refused)?;
    Ok(Page {
        title: format!("{} runs each", campaigns.first().map_or(0, |c| c.runs + c.failed)),
        provenance: Provenance::common(named.iter().map(|(_, campaign)| &campaign.subject.provenance)),
        warnings: told.chain(references).collect(),
        sections: vec![pooled(&named), health(&named)],
    })
}
