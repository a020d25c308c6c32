//! `fusion live`, and the record of a live run.

use super::run::{page, period, results};
use super::{DesignArgs, Failure, OutputArgs, report_line};
use clap::Args;
use fusion::config::Diagnostics;
use fusion::design::Design;
use fusion::run::{Checkpoints, FeedMaker, Options};
use fusion_live::{Live, LiveOptions, Status, StatusListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

#[derive(Debug, Args)]
pub(super) struct LiveArgs {
    #[command(flatten)]
    design: DesignArgs,
    /// Writes estimates.csv, updates.csv, summary.json and report.html here at the end.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Records everything that comes in, with its time of arrival, in a new file of MCAP. `fusion run --replay FILE` gives
    /// the same estimates again.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// How long it runs, such as `60 s`.
    #[arg(long = "for", value_name = "TIME", value_parser = period)]
    duration: Option<Duration>,
    /// Saves the run in FILE regularly. After a kill, `--resume` continues it: first with what was recorded since then.
    #[arg(long, value_name = "FILE", requires = "record")]
    checkpoint: Option<PathBuf>,
    /// Time between two checkpoints: 10 s by default.
    #[arg(long, value_name = "TIME", default_value = "10 s", hide_default_value = true, value_parser = period, requires = "checkpoint")]
    every: Duration,
    /// Continues the run that was saved in FILE, with the same `--record` and the same other options.
    #[arg(long, value_name = "FILE", requires = "record")]
    resume: Option<PathBuf>,
    /// Prints the state of links, sources and outputs at this interval, on standard error.
    #[arg(long, value_name = "TIME", value_parser = period)]
    status: Option<Duration>,
    /// Prints all tables at the end.
    #[arg(short, long)]
    verbose: bool,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn live(args: &LiveArgs) -> Result<(), Failure> {
    let design = args.design.read()?;
    let live = Live::of(&design)?;
    #[cfg(unix)]
    let stop = super::stop::live();
    #[cfg(not(unix))]
    let stop = Arc::default();
    let tell: StatusListener = Arc::new(|status| report_line(&told(status)));
    let (feed, mut watch) = live.start(LiveOptions {
        record: args.record.clone(),
        duration: args.duration,
        stop,
        status: args.status.map(|every| (every, tell)),
        say: Some(Arc::new(report_line)),
    });
    let options = Options {
        base: args.design.base(),
        out: args.out.clone(),
        checkpoint: args.checkpoint.clone().map(|file| Checkpoints { file, every: args.every }),
        resume: args.resume.clone(),
        feed: Some(feed),
        ..Options::default()
    };
    let summary = results(&design, &options, &mut [&mut watch], &mut |_| {})?;
    args.output.print(&page(&summary, &options, args.verbose, args.output.format))
}

/// The feed of a record. Its estimates are compared with the reference of the design.
pub(super) fn replay(design: &Design, record: &Path) -> Result<FeedMaker, Diagnostics> {
    Ok(Live::of(design)?.replay(record, Some(Arc::new(report_line))).scored())
}

/// A line for each link, source and output.
fn told(status: &Status) -> String {
    let mut lines = Vec::new();
    for link in &status.links {
        let mut line = format!("link {}: {} bytes", link.name, link.bytes);
        if link.dropped > 0 {
            line += &format!(", {} bytes dropped: the filter is too slow", link.dropped);
        }
        if link.opened > 1 {
            line += &format!(", opened {} times", link.opened);
        }
        if let Some(trouble) = &link.trouble {
            line += &format!(", not open: {trouble}");
        }
        if let Some(about) = &link.about {
            line += &format!(", {about}");
        }
        lines.push(line);
    }
    for source in &status.sources {
        let mut line = format!("source {}: {} rows", source.name, source.rows);
        if let Some((offset, ppm, delay)) = source.relation {
            line += &format!(", clock {offset:+.6} s, {ppm:+.1} ppm, mean delay {:.1} ms", delay * 1e3);
        }
        if source.jumps > 0 {
            line += &format!(", {} jumps of a clock", source.jumps);
        }
        if source.unplaced > 0 {
            line += &format!(", {} rows before the clocks were related", source.unplaced);
        }
        if let Some(trouble) = &source.trouble {
            line += &format!(", {trouble}");
        }
        lines.push(line);
    }
    for output in &status.outputs {
        let mut line = format!("output {}: {} estimates", output.name, output.sent);
        for (count, what) in [(output.dropped, "dropped"), (output.failed, "not sent")] {
            if count > 0 {
                line += &format!(", {count} {what}");
            }
        }
        for text in output.about.iter().chain(&output.trouble) {
            line += &format!(", {text}");
        }
        lines.push(line);
    }
    let latency = &status.latency;
    if let (Some(median), Some(rare)) = (latency.quantile(0.5), latency.quantile(0.999)) {
        let [median, rare, most] = [median, rare, latency.most()].map(|seconds| seconds * 1e3);
        lines.push(format!(
            "latency from row to estimate: median {median:.3} ms, 99.9 % below {rare:.3} ms, at most {most:.3} ms"
        ));
    }
    lines.join("\n")
}
