//! `fusion tune`.

use super::fix::FixArgs;
use super::part::{self, range, refused};
use super::progress::Runs;
use super::run::{period, written};
use super::{DesignArgs, Failure, OutputArgs};
use clap::{Args, Command, FromArgMatches};
use core::ops::Range;
use fusion::config::{Diagnostic, Diagnostics, Document, Edit};
use fusion::design::Design;
use fusion::examine::{Missing, examine};
use fusion::provenance::Provenance;
use fusion::run::{KeptRows, Options, run};
use fusion_advice::frames::judge;
use fusion_judge::likelihood::Difference;
use fusion_judge::part::{Effort, Head, Kind, Parts, Subject, Writer};
use fusion_judge::tune::{
    Coasting, Found, Hidden, Independence, Log, Outage, Proposal, Searched, Settings, Share, SlowError, Tuned, Unobserved, hidden,
    searches, structure, tune as tune_logs,
};
use fusion_tables::{Cell, Column, Page, Section, Table, short};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

#[derive(Debug, Args)]
pub(super) struct TuneArgs {
    #[command(flatten)]
    design: DesignArgs,
    /// The noises to tune, by their paths: `*` matches any text inside a key, and `process.` may be left out. Without
    /// it: the noises of the process and of the sensors that measure.
    #[arg(long, value_name = "PATH,PATH", value_delimiter = ',')]
    params: Vec<String>,
    /// Another log for the same design: where its relative source paths start.
    #[arg(long, value_name = "DIR")]
    also: Vec<PathBuf>,
    /// Rows count from this time after the alignment on.
    #[arg(long, value_name = "TIME", default_value = "0 s", hide_default_value = true, value_parser = period)]
    settle: Duration,
    /// The number of parts of each log, each judged by what the others give; 4 by default.
    #[arg(long, value_name = "K", default_value_t = 4, hide_default_value = true, value_parser = clap::value_parser!(u64).range(2..))]
    folds: u64,
    /// The factor within which the declared noises are right, 1σ: they are a prior. Without it, they are one only for
    /// noises that the log does not identify, with a factor of 20.
    #[arg(long, value_name = "FACTOR")]
    within: Option<f64>,
    /// An outage over which the filter has to predict, as `30 s` for all instruments or `gnss=30 s` for a source or a
    /// sensor. The rows after such outages join the likelihood. If a change makes them less probable, the noise keeps its
    /// declared value. Each run becomes three.
    #[arg(long, value_name = "[NAME=]TIME", value_parser = outage)]
    outage: Option<Outage>,
    /// The share of parts of a log in which a found noise has to hold, such as 0.95, where the noise of a sensor changes
    /// along the log. Without it, the noise is that of the whole.
    #[arg(long, value_name = "SHARE", value_parser = share)]
    cover: Option<f64>,
    /// Another start of the search: the declared noises with one of them changed, as by `--set`. The best end counts.
    #[arg(long, value_name = "PATH=VALUE")]
    start: Vec<String>,
    /// Searches from these starts only, such as 0..2; the last number is not included. Number 0 is the common factor of all
    /// noises that explains the innovations best, number 1 the first `--start`.
    #[arg(long, value_name = "A..B", requires_all = ["part", "start"], value_parser = range)]
    runs: Option<Range<u64>>,
    /// Writes the ends of these searches to this file. `fusion merge` takes the best end of all, and tunes as one process does.
    #[arg(long, value_name = "FILE", requires = "runs")]
    part: Option<PathBuf>,
    /// Tries the edits of advice, and states for slow errors of sensors, in place of noises. Advice sees the first half of the
    /// log, and so does the autocorrelation of innovations. An edit is proposed if the innovations of the second half are more
    /// probable with it.
    #[arg(long, conflicts_with_all = ["params", "also", "settle", "within", "outage", "cover", "start", "part"])]
    structure: bool,
    #[command(flatten)]
    fix: FixArgs,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn tune(args: &TuneArgs) -> Result<(), Failure> {
    args.fix.check(&args.design)?;
    let design = args.design.read()?;
    let logs = logs(args, &design)?;
    if args.structure {
        return edits(args, &design);
    }
    let settings = settings(args)?;
    match &args.part {
        Some(path) => write_part(args, &design, &logs, &settings, path),
        None => results(args, &design, &logs, &settings, &args.output),
    }
}

/// Tunes with the searches of all parts, by the words of the first one.
pub(super) fn merged(parts: &Parts, output: &OutputArgs) -> Result<(), Failure> {
    let (subject, words, searched) = parts.read::<Vec<String>, Searched>().map_err(refused)?;
    let command = TuneArgs::augment_args(Command::new("tune").no_binary_name(true));
    let args = command
        .try_get_matches_from(&words)
        .and_then(|matches| TuneArgs::from_arg_matches(&matches));
    let args = args.map_err(|e| Diagnostic::error(format!("the options of the parts cannot be read: {e}")))?;
    args.fix.check(&args.design)?;
    let design = args.design.read()?;
    if Provenance::of(&design, None).hash != subject.provenance.hash {
        let changed = Diagnostic::error(format!("`{}` has changed since the parts were written", subject.provenance.design));
        return Err(changed.help("restore it, or write the parts again").into());
    }
    let logs = logs(&args, &design)?;
    let settings = Settings {
        searched,
        ..settings(&args)?
    };
    results(&args, &design, &logs, &settings, output)
}

/// Searches from some of the starts, and writes the ends.
fn write_part(args: &TuneArgs, design: &Design, logs: &[Log], settings: &Settings, path: &Path) -> Result<(), Failure> {
    let (numbers, end) = (args.runs.clone().unwrap_or_default(), settings.starts.len() as u64 + 1);
    if numbers.end > end {
        return Err(Diagnostic::error(format!("there are the starts 0..{end}: `--runs` is beyond them")).into());
    }
    let words = words()?;
    let quoted: Vec<String> = words.iter().map(|word| format!("'{}'", word.replace('\'', r"'\''"))).collect();
    let head = Head {
        again: format!("fusion tune {}", quoted.join(" ")),
        ..Head::new(
            Kind::Tune,
            vec![Subject::new("", design, design.run.seed)],
            numbers.clone(),
            Some(end),
        )
    };
    let head = head.sharing(&words).map_err(|e| Diagnostic::error(e.to_string()))?;
    let bar = Runs::new();
    let began = Instant::now();
    let ends = searches(logs, &args.params, settings, numbers, &|runs, _| bar.at(runs, settings.most_runs))?;
    drop(bar);
    if settings.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed)) {
        return Err(Diagnostic::error("the search was stopped before its end, so no part is written").into());
    }
    let unwritable = |e: std::io::Error| Diagnostic::error(format!("`{}` cannot be written: {e}", path.display()));
    part::work(Some(path), |file| {
        let mut out = Writer::begin(file, &head).map_err(unwritable)?;
        ends.iter().try_for_each(|end| out.put(end)).map_err(unwritable)?;
        let seconds = began.elapsed().as_secs_f64();
        Ok(out
            .end(Effort {
                seconds,
                threads: std::thread::available_parallelism().map_or(1, usize::from),
            })
            .map_err(unwritable)?)
    })?;
    args.output.print(&page(design, vec![written([path.to_owned()])]))
}

/// The words of the command line that all parts share.
fn words() -> Result<Vec<String>, Diagnostic> {
    let mut given = std::env::args_os().skip_while(|word| word != "tune").skip(1);
    let mut words = Vec::new();
    while let Some(word) = given.next() {
        let word = word.into_string().map_err(|word| {
            let error = Diagnostic::error(format!("`{}` is no Unicode text, so a part cannot contain it", word.display()));
            error.help("name files and folders in Unicode")
        })?;
        match word.as_str() {
            "--runs" | "--part" => drop(given.next()),
            own if own.starts_with("--runs=") || own.starts_with("--part=") => {}
            _ => words.push(word),
        }
    }
    Ok(words)
}

/// The design with each log.
fn logs(args: &TuneArgs, design: &Design) -> Result<Vec<Log>, Failure> {
    let mut logs = Vec::new();
    for data in [args.design.data.clone()].into_iter().chain(args.also.iter().cloned().map(Some)) {
        let options = Options {
            data,
            base: args.design.base(),
            kept: Some(KeptRows::default()),
            ..Options::default()
        };
        examine(design.document.clone(), &options, Missing::Told)?;
        logs.push(Log {
            document: design.document.clone(),
            options,
        });
    }
    Ok(logs)
}

fn settings(args: &TuneArgs) -> Result<Settings, Failure> {
    Ok(Settings {
        settle: args.settle.as_secs_f64(),
        folds: usize::try_from(args.folds).unwrap_or(usize::MAX),
        prior: args.within.map(prior).transpose()?,
        outage: args.outage.clone(),
        cover: args.cover,
        starts: starts(args)?,
        #[cfg(unix)]
        stop: Some(super::stop::search()),
        ..Settings::default()
    })
}

fn page(design: &Design, sections: Vec<Section>) -> Page {
    Page {
        title: design.run.description.clone(),
        provenance: Provenance::of(design, None),
        warnings: Vec::new(),
        sections,
    }
}

/// Tunes, and prints what was found.
fn results(args: &TuneArgs, design: &Design, logs: &[Log], settings: &Settings, output: &OutputArgs) -> Result<(), Failure> {
    let bar = Runs::new();
    let tuned = tune_logs(logs, &args.params, settings, &|runs, _| bar.at(runs, settings.most_runs))?;
    let unseen = if tuned.is_sound() {
        hidden(logs, &tuned, settings)?
    } else {
        Vec::new()
    };
    drop(bar);
    let sections = vec![
        Section::new("Noises", [noises(&tuned.found)]),
        Section::new("Innovations", [innovations(&tuned.independence)]),
        verdict(&tuned, settings.cover),
    ];
    let mut page = page(design, sections);
    if !unseen.is_empty() {
        page.sections.insert(1, not_identifiable(&unseen, settings.outage.is_some()));
    }
    if !tuned.coasting.is_empty() {
        page.sections.insert(
            page.sections.len() - 1,
            Section::new("After outages, on parts that were not seen", [outages(&tuned.coasting)]),
        );
    }
    if tuned.is_better() {
        page.sections.extend(args.fix.write(&args.design, &tuned.edits())?);
    }
    output.print(&page)?;
    if tuned.is_sound() { Ok(()) } else { Err(Failure::Dependent) }
}

/// Judges the edits of advice, and writes those that gain likelihood.
fn edits(args: &TuneArgs, design: &Design) -> Result<(), Failure> {
    let proposals = structure(&design.document, &args.design.options(), &|half| {
        advised(half, &args.design.options())
    })?;
    let mut t = Table::new([
        Column::text("rule"),
        Column::text("edit"),
        Column::number("gain [nats]"),
        Column::number("1σ"),
        Column::text(""),
    ]);
    for proposal in &proposals {
        let edits: Vec<String> = proposal.edits.iter().map(ToString::to_string).collect();
        let verdict = match proposal.is_better() {
            Some(true) => "proposed",
            Some(false) => "no gain on unseen rows",
            None => "a guess: no row can judge it",
        };
        let of = |figure: fn(&Difference) -> f64| proposal.gain.as_ref().map_or(Cell::Empty, |gain| Cell::Real(figure(gain)));
        t.row([
            Cell::text(&proposal.rule),
            Cell::text(edits.join("; ")),
            of(|gain| gain.nats),
            of(|gain| gain.sigma),
            Cell::text(verdict),
        ]);
    }
    let section = Section::new("Edits of advice, judged on the second half", [t]);
    let first = if proposals.is_empty() {
        section.note("Advice has no edit for the first half of this log, and no sensor shows a slow error there.")
    } else {
        section
    };
    let mut page = page(design, vec![first]);
    let slow: Vec<&SlowError> = proposals.iter().filter_map(|proposal| proposal.slow.as_ref()).collect();
    if !slow.is_empty() {
        page.sections.push(slow_errors(&slow));
    }
    let better = proposals.iter().filter(|proposal| proposal.is_better() == Some(true));
    let better: Vec<Edit> = better.flat_map(|proposal| proposal.edits.clone()).collect();
    page.sections.extend(args.fix.write(&args.design, &better)?);
    args.output.print(&page)?;
    Ok(())
}

/// The slow errors that innovations show.
fn slow_errors(found: &[&SlowError]) -> Section {
    let mut t = Table::new([
        Column::text("sensor"),
        Column::text("1σ"),
        Column::number("correlation time [s]"),
        Column::number("95 % from"),
        Column::text("to"),
        Column::text(""),
    ]);
    for slow in found {
        let each: Vec<String> = slow.sigma.iter().map(|sigma| short(*sigma)).collect();
        let (from, to) = slow.interval;
        t.row([
            Cell::text(&slow.sensor),
            Cell::text(format!("{} {}", each.join(", "), slow.unit)),
            Cell::Real(slow.correlation_time),
            Cell::Real(from),
            Cell::text(if to.is_finite() {
                short(to)
            } else {
                "no limit: the log is too short".to_owned()
            }),
            Cell::text(if slow.is_further {
                "in addition to that which the design declares"
            } else {
                ""
            }),
        ]);
    }
    Section::new("Slow errors in the first half", [t]).note(
        "Innovations identify only σ²/τ of a slow error: how fast it changes. A larger σ with a longer correlation time explains them almost \
         as well. So likelihood is no judge between such pairs: take σ from the data sheet, or from a log at rest of many correlation times, \
         and keep σ²/τ.",
    )
}

/// The edits of all rules of advice: those about the frames of recorded data, and those about a run.
fn advised(design: &Design, options: &Options) -> Result<Vec<Proposal>, Diagnostics> {
    let mut found = Vec::new();
    if !design.sources.is_empty() {
        let judged = judge(design, options, &|_| ())?;
        let mistakes = judged.mistakes.iter().filter(|mistake| !mistake.corrections().is_empty());
        found.extend(mistakes.map(|mistake| Proposal::new(mistake.found_by().unwrap_or_default(), mistake.corrections().to_vec())));
    }
    let summary = run(design, options, &mut |_| {})?;
    let findings = summary.findings().iter().filter(|finding| !finding.edits.is_empty());
    found.extend(findings.map(|finding| Proposal::new(&finding.rule, finding.edits.clone())));
    Ok(found)
}

/// The designs of the further starts.
fn starts(args: &TuneArgs) -> Result<Vec<Document>, Failure> {
    let file = args.design.load()?;
    let of = |set: &String| {
        let mut selection = args.design.selection();
        selection.set.push(set.clone());
        let (document, mistakes) = selection.over(&file);
        Ok(mistakes.unless_errors(document)?)
    };
    args.start.iter().map(of).collect()
}

/// An outage as it is typed.
fn outage(text: &str) -> Result<Outage, String> {
    let (of, time) = text
        .split_once('=')
        .map_or((None, text), |(of, time)| (Some(of.trim().to_owned()), time));
    let duration = period(time)?.as_secs_f64();
    (duration > 0.0)
        .then_some(Outage { duration, of })
        .ok_or_else(|| "an outage has a length above zero".to_owned())
}

fn share(text: &str) -> Result<f64, String> {
    let share: f64 = text.parse().map_err(|_| "a number is wanted, such as `0.95`".to_owned())?;
    (0.5..1.0)
        .contains(&share)
        .then_some(share)
        .ok_or_else(|| "a share is from 0.5 to below 1".to_owned())
}

/// The 1σ of the logarithm of a noise that is right within a factor.
fn prior(within: f64) -> Result<f64, Diagnostic> {
    if within > 1.0 && within.is_finite() {
        return Ok(within.ln());
    }
    Err(Diagnostic::error(format!("`--within {within}` has to be a factor above 1")))
}

/// A dozen independent rows determine the factor to a factor of two; above three it is worth a word.
const HEAVY: f64 = 3.0;

fn noises(found: &[Found]) -> Table {
    let mut t = Table::new([
        Column::text("noise"),
        Column::text("declared"),
        Column::text("found"),
        Column::number("factor"),
        Column::number("95 % from"),
        Column::number("to"),
    ]);
    for f in found {
        let (from, to) = f.interval();
        let cells = match f.edit().and_then(|edit| edit.value) {
            Some(value) if f.is_identifiable() => [Cell::text(value), Cell::Real(f.factor), Cell::Real(from), Cell::Real(to)],
            Some(value) => [
                Cell::text(format!(
                    "{value}, a limit: not identifiable, but the log refutes all values up to the declared one"
                )),
                Cell::Real(f.factor),
                Cell::Empty,
                Cell::Empty,
            ],
            None if f.is_identifiable() => [
                Cell::text("as declared: no gain on unseen parts"),
                Cell::Real(f.factor),
                Cell::Empty,
                Cell::Empty,
            ],
            None => [Cell::text("not identifiable on this log"), Cell::Empty, Cell::Empty, Cell::Empty],
        };
        t.row(
            [Cell::text(&f.parameter.path), Cell::text(&f.parameter.declared)]
                .into_iter()
                .chain(cells),
        );
    }
    t
}

/// Why noises are not identifiable, and which motion says most about them.
fn not_identifiable(found: &[Hidden], has_outages: bool) -> Section {
    let mut t = Table::new([Column::text("noise"), Column::text("why it is not identifiable")]);
    for own in found {
        t.row([Cell::text(&own.parameter), Cell::text(why(own))]);
    }
    let section = Section::new("Not identifiable", [t]);
    let is_short = |own: &Hidden| own.unobserved.is_none() && own.parameter.starts_with("process.");
    if has_outages || !found.iter().any(is_short) {
        return section;
    }
    section
        .note("The longer a prediction is, the more a noise of the process adds to it: `--outage` counts predictions over a declared time.")
}

fn why(hidden: &Hidden) -> String {
    let percent = |share: f64| format!("{} %", short(two_digits(100.0 * share)));
    if let Some(Unobserved { state, left, motion }) = &hidden.unobserved {
        let motion = match motion {
            Some((motion, factor)) => format!(
                "The motion that says most about it is `{motion}`: without it, σ is {} % larger. More of that motion identifies it.",
                short(two_digits(100.0 * (factor - 1.0)))
            ),
            None => "No motion of this log says anything about it.".to_owned(),
        };
        return format!(
            "It moves `{state}`, which this log does not determine: {} of the initial σ are left. {motion}",
            percent(*left)
        );
    }
    let Some(Share { sensor, share, motion }) = &hidden.share else {
        return "It changes no innovation.".to_owned();
    };
    let motion = motion.as_ref().map_or_else(String::new, |(motion, share)| {
        format!(" It adds {} in `{motion}`.", percent(*share))
    });
    format!(
        "Other errors hide it: it adds {} to the variance of the innovations of `{sensor}`.{motion}",
        percent(*share)
    )
}

/// A number with two significant digits.
fn two_digits(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

fn outages(coasting: &[Coasting]) -> Table {
    let mut t = Table::new([
        Column::text("sensor"),
        Column::number("outages"),
        Column::number("RMS of innovations, declared"),
        Column::number("found"),
        Column::number("gain [nats]"),
    ]);
    for own in coasting {
        t.row([
            Cell::text(&own.sensor),
            Cell::from(own.outages),
            Cell::Real(own.declared),
            Cell::Real(own.found),
            Cell::Real(own.nats),
        ]);
    }
    t
}

fn innovations(independence: &[Independence]) -> Table {
    let mut t = Table::new([
        Column::text("sensor"),
        Column::number("rows"),
        Column::number("one in"),
        Column::number("overweighted"),
        Column::number("p, white"),
        Column::number("p, NIS not too large"),
        Column::text(""),
    ]);
    for i in independence {
        let verdict = match &i.stage {
            Some(stage) => format!("made by the stage `{stage}`"),
            None if i.is_white => "as independent rows".to_owned(),
            None => "not independent".to_owned(),
        };
        t.row([
            Cell::text(&i.sensor),
            Cell::from(i.rows),
            Cell::from(u64::from(i.one_in)),
            Cell::Real(i.overweighted),
            Cell::Real(i.whiteness),
            Cell::Real(i.distribution),
            Cell::text(verdict),
        ]);
    }
    t
}

/// Why nothing is tuned on the rows of `dependent` sensors, and what to do.
fn refusal(tuned: &Tuned, dependent: &str) -> String {
    let what = if tuned.independence.iter().any(|i| i.stage.is_some()) {
        "Stages make them: a stage averages or filters rows of an instrument, or selects them by their values. Tune a design in which a \
         sensor reads the rows of its instrument itself, with the gate in the sensor, or judge these noises by the errors against a \
         reference."
    } else {
        "An error that lasts needs a state, not a noise: `fusion tune --structure` looks for one, `fusion run` says what the innovations \
         look like, and `fusion check --data DIR` looks for a mistake."
    };
    format!("The rows of {dependent} are not independent: not tuned. {what}")
}

fn verdict(tuned: &Tuned, cover: Option<f64>) -> Section {
    let section = Section::new("Verdict", []);
    let dependent: Vec<String> = tuned
        .independence
        .iter()
        .filter(|i| !i.is_white)
        .map(|i| format!("`{}`", i.sensor))
        .collect();
    let runs = format!("{} runs.", tuned.runs);
    if !dependent.is_empty() {
        return section.note(refusal(tuned, &dependent.join(", "))).note(runs);
    }
    let parts: Vec<String> = tuned.unseen.iter().map(|gain| format!("{gain:.1}")).collect();
    let unseen = format!(
        "ln L {:.1} nats. Gain: {:.1} on all rows, {:.1} on parts that were not seen ({}).",
        tuned.log_likelihood,
        tuned.nats,
        tuned.gain(),
        parts.join(", ")
    );
    let section = section.note(unseen);
    let heavy = tuned.independence.iter().filter(|i| i.one_in > 1 && i.overweighted > HEAVY);
    let heavy: Vec<String> = heavy.map(|i| format!("`{}` {} times", i.sensor, short(i.overweighted))).collect();
    let section = if heavy.is_empty() {
        section
    } else {
        section.note(format!(
            "At their full rate, rows repeat the error of the one before, and their noise overweights them: {}. Give that error a state, or \
             compare drift in outages and NEES before you use these noises.",
            heavy.join(", ")
        ))
    };
    let varying = tuned.independence.iter().filter(|i| i.varies > 1.0);
    let section = varying.fold(section, |section, i| {
        let (sensor, times) = (&i.sensor, short(i.varies));
        section.note(match cover {
            None => format!(
                "The noise of `{sensor}` changes along the log: in one of twenty parts, σ is more than {times} times that of the whole. \
                 Use that where σ has to hold everywhere: `--cover 0.95`."
            ),
            Some(cover) => format!(
                "The noise of `{sensor}` changes along the log. Its found value is {times} times that of the whole, so that it holds in \
                 {} % of the parts.",
                100.0 * cover
            ),
        })
    });
    let section = if tuned.losing.is_empty() {
        section
    } else {
        let losing: Vec<String> = tuned.losing.iter().map(|sensor| format!("`{sensor}`")).collect();
        section.note(format!(
            "{} is predicted worse, by more than chance, while others are predicted better: the design lacks a state.",
            losing.join(", ")
        ))
    };
    let section = if tuned.is_worse_after_outages {
        section.note("After outages, these noises predict worse than the declared ones, by more than chance.")
    } else {
        section
    };
    let section = if tuned.is_better() {
        section
    } else {
        section.note("The log does not prefer these noises where it was not asked: keep the declared ones.")
    };
    let section = if tuned.has_converged {
        section
    } else {
        section.note("The search was stopped, or ended at its limit of runs, before the maximum: start again from what it found.")
    };
    section.note(runs)
}
