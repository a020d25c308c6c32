//! `fusion montecarlo`.

use super::progress::Runs;
use super::run::written;
use super::{DesignArgs, Failure, OutputArgs};
use clap::Args;
use core::ops::Range;
use fusion::config::Diagnostic;
use fusion::design::Design;
use fusion::output::FileSet;
use fusion::run::Options;
use fusion_judge::campaign::{Campaign, History, RunRow, monte_carlo, monte_carlo_over_time};
use fusion_present::Shown;
use fusion_present::report::{Look, Run, record, render, render_campaign, worst_first};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// The number of runs with the largest errors whose reports are written.
const WORST: usize = 3;

#[derive(Debug, Args)]
pub(super) struct MonteCarloArgs {
    #[command(flatten)]
    design: DesignArgs,
    /// The number of runs; 100 by default.
    #[arg(short, alias = "n", value_name = "N", default_value_t = 100, hide_default_value = true, value_parser = clap::value_parser!(u64).range(1..))]
    n: u64,
    /// Runs these numbers only, such as 50..100, of a campaign that starts at 0; the last number is not included.
    #[arg(long, value_name = "A..B", conflicts_with = "n", value_parser = range)]
    runs: Option<Range<u64>>,
    /// Seed of the campaign, 1 by default; the seed of each run depends on it and on the number of the run.
    #[arg(long, value_name = "S", default_value_t = 1, hide_default_value = true)]
    seed: u64,
    /// The number of threads; by default the number of cores. The results do not depend on it.
    #[arg(long, value_name = "T", default_value_t = 0, hide_default_value = true)]
    threads: usize,
    /// Writes runs.csv, montecarlo.html and the reports of the three worst runs here; creates the folder if necessary.
    /// runs.csv has one row per run, montecarlo.html the errors of all runs over time; the reports are worst-1.html and
    /// so on.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Writes the runs to this file, for `fusion merge`.
    #[arg(long, value_name = "FILE", conflicts_with = "out")]
    part: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

/// Numbers of runs, from the command line.
fn range(text: &str) -> Result<Range<u64>, String> {
    let ends = text
        .split_once("..")
        .and_then(|(from, to)| Some(from.parse().ok()?..to.parse().ok()?));
    ends.filter(|runs: &Range<u64>| !runs.is_empty())
        .ok_or_else(|| "write two numbers such as 50..100, the first one smaller".to_owned())
}

pub(super) fn montecarlo(args: &MonteCarloArgs) -> Result<(), Failure> {
    let design = args.design.read()?;
    let options = Options {
        data: args.design.data.clone(),
        base: args.design.base(),
        ..Options::default()
    };
    // Reports files that cannot be written before the runs.
    let files = args.out.as_deref().map(FileSet::begin).transpose()?;
    let bar = Runs::new();
    let runs = args.runs.clone().unwrap_or(0..args.n);
    let total = runs.end - runs.start;
    let told = |done| bar.at(done as u64, total);
    let (campaign, histories) = match args.out {
        Some(_) => monte_carlo_over_time(&design, &options, runs, args.seed, args.threads, &told)?,
        None => (monte_carlo(&design, &options, runs, args.seed, args.threads, &told)?, Vec::new()),
    };
    drop(bar);
    let mut page = Shown(&campaign).page();
    if let Some(path) = &args.part {
        write_part(&campaign, path)?;
        page.sections.push(written([path.clone()]));
    }
    if let (Some(out), Some(mut files)) = (&args.out, files) {
        files.write("runs.csv", |file| campaign.write(file))?;
        let reports = args.pages(&mut files, &design, &options, (&campaign, &histories))?;
        files.commit()?;
        let names = ["runs.csv", "montecarlo.html"].into_iter();
        page.sections.push(written(
            names
                .chain(reports.iter().map(|(_, name)| name.as_str()))
                .map(|name| out.join(name)),
        ));
    }
    args.output.print(&page)
}

/// Writes the campaign to a file: complete, or not at all.
fn write_part(campaign: &Campaign, path: &Path) -> Result<(), Failure> {
    let mut partial = path.as_os_str().to_owned();
    partial.push(".partial");
    let write = || -> std::io::Result<()> {
        let mut file = BufWriter::new(File::create(&partial)?);
        campaign.write_part(&mut file)?;
        file.into_inner()?.sync_all()?;
        std::fs::rename(&partial, path)
    };
    write().map_err(|e| Failure::Mistakes(Diagnostic::error(format!("`{}` cannot be written: {e}", path.display())).into()))
}

impl MonteCarloArgs {
    /// Writes montecarlo.html, and the reports of the worst runs: their numbers and files.
    fn pages(
        &self,
        files: &mut FileSet,
        design: &Design,
        options: &Options,
        (campaign, histories): (&Campaign, &[History]),
    ) -> Result<Vec<(u64, String)>, Failure> {
        let mut reports = Vec::new();
        for row in worst_first(campaign).into_iter().take(WORST) {
            let again = Options {
                seed: Some(row.seed),
                data: options.data.clone(),
                base: options.base.clone(),
                ..Options::default()
            };
            let (finished, recording) = record(design, &again, &mut [], &mut |_| {})?;
            let run = Run {
                name: "estimate",
                recording: &recording,
                summary: &finished.summary,
            };
            let title = format!("{} · run {}, seed {}", design.run.description, row.run, row.seed);
            let name = format!("worst-{}.html", reports.len() + 1);
            let text = render(title.trim_start_matches(" · "), &[run]);
            files.write(&name, |file| file.write_all(text.as_bytes()))?;
            reports.push((row.run, name));
        }
        let look = |row: &RunRow| Look {
            command: self.command(row),
            report: reports.iter().find(|(run, _)| *run == row.run).map(|(_, name)| name.clone()),
        };
        let text = render_campaign(&design.run.description, campaign, histories, &look);
        files.write("montecarlo.html", |file| file.write_all(text.as_bytes()))?;
        Ok(reports)
    }

    /// The command that writes the report of a run.
    fn command(&self, row: &RunRow) -> String {
        let path = |path: &Path| quoted(&path.display().to_string());
        let mut words = vec!["fusion run".to_owned()];
        words.extend(self.design.config.iter().map(|file| path(file)));
        words.extend(self.design.variant.iter().map(|name| format!("--variant {}", quoted(name))));
        words.extend(self.design.backend.iter().map(|words| format!("--backend {}", quoted(words))));
        words.extend(self.design.set.iter().map(|set| format!("--set {}", quoted(set))));
        words.extend(self.design.data.iter().map(|data| format!("--data {}", path(data))));
        words.push(format!("--seed {} --out run-{}", row.seed, row.run));
        words.join(" ")
    }
}

/// A word with shell quotes, if it needs them.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,+:".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn a_shell_takes_back_the_words_that_were_quoted() {
        assert_eq!(quoted("sensor.gnss.noise=3"), "sensor.gnss.noise=3");
        assert_eq!(quoted("sensor.gnss.noise=3 m"), "'sensor.gnss.noise=3 m'");
        assert_eq!(quoted("it's"), "'it'\\''s'");
        assert_eq!(quoted(""), "''");
    }
}
