//! `fusion montecarlo`.

use super::part::{self, range, refused};
use super::progress::Runs;
use super::run::written;
use super::{DesignArgs, Failure, OutputArgs};
use clap::Args;
use core::ops::Range;
use fusion::config::Diagnostic;
use fusion::design::Design;
use fusion::output::FileSet;
use fusion::run::Options;
use fusion_judge::campaign::{Campaign, RunRow, Runner, read, write};
use fusion_judge::part::{Head, Kind, Parts, Subject};
use fusion_present::Shown;
use fusion_present::report::{Look, Run, record, render, render_campaign};
use fusion_tables::Page;
use std::io::Write;
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
    /// Writes the runs to this file, for `fusion merge`. A file without an end, `FILE.partial`, is that of a stopped run.
    #[arg(long, value_name = "FILE", conflicts_with = "out")]
    part: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
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
    let numbers = args.runs.clone().unwrap_or(0..args.n);
    let total = numbers.end - numbers.start;
    let subject = Subject::new("", &design, args.seed);
    let head = Head {
        again: format!("{} --seed {}", args.design.typed("montecarlo"), args.seed),
        run: args.design.typed("run"),
        ..Head::new(Kind::Montecarlo, vec![subject], numbers, None)
    };
    let told = |done| bar.at(done as u64, total);
    let over_time = args.out.is_some() || args.part.is_some();
    let runner = Runner::new(args.seed, args.threads, over_time, &told)?;
    let work = [(design, options)];
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
    let mut page = results((&parts, &only(&parts)?), args.out.as_deref(), files, Some(&work[0]))?;
    page.sections.extend(args.part.clone().map(|path| written([path])));
    args.output.print(&page)
}

/// The campaign of one design.
pub(super) fn only(parts: &Parts) -> Result<Campaign, Failure> {
    let first = read(parts).map_err(refused)?.into_iter().next();
    first.ok_or_else(|| Diagnostic::error("a campaign of one design was asked for").into())
}

/// The page of a campaign, after its files are written. The worst runs need the design.
pub(super) fn results(
    (parts, campaign): (&Parts, &Campaign),
    out: Option<&Path>,
    files: Option<FileSet>,
    design: Option<&(Design, Options)>,
) -> Result<Page, Failure> {
    let mut page = Shown(campaign).page();
    if let (Some(out), Some(mut files)) = (out, files) {
        files.write("runs.csv", |file| write(parts, campaign, file))?;
        let reports = design.map_or(Ok(Vec::new()), |design| worst_reports(campaign, design, &mut files))?;
        let look = |row: &RunRow| Look {
            command: format!("{} --seed {} --out run-{}", parts.head().run, row.seed, row.run),
            report: reports.iter().find(|(run, _)| *run == row.run).map(|(_, name)| name.clone()),
        };
        let text = render_campaign(&campaign.subject.description, campaign, &look);
        files.write("montecarlo.html", |file| file.write_all(text.as_bytes()))?;
        files.commit()?;
        let names = ["runs.csv", "montecarlo.html"].into_iter();
        let names = names.chain(reports.iter().map(|(_, name)| name.as_str()));
        page.sections.push(written(names.map(|name| out.join(name))));
    }
    Ok(page)
}

/// Writes the reports of the worst runs: their numbers and files.
fn worst_reports(campaign: &Campaign, (design, options): &(Design, Options), files: &mut FileSet) -> Result<Vec<(u64, String)>, Failure> {
    let mut reports = Vec::new();
    for row in campaign.worst().iter().take(WORST) {
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
    Ok(reports)
}

impl DesignArgs {
    /// The command with this design, as a user types it.
    pub(super) fn typed(&self, command: &str) -> String {
        let path = |path: &Path| quoted(&path.display().to_string());
        let mut words = vec![format!("fusion {command}")];
        words.extend(self.config.iter().map(|file| path(file)));
        words.extend(self.variant.iter().map(|name| format!("--variant {}", quoted(name))));
        words.extend(self.backend.iter().map(|words| format!("--backend {}", quoted(words))));
        words.extend(self.set.iter().map(|set| format!("--set {}", quoted(set))));
        words.extend(self.data.iter().map(|data| format!("--data {}", path(data))));
        words.join(" ")
    }
}

/// A word with shell quotes, if it needs them.
pub(super) fn quoted(word: &str) -> String {
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
