//! From a design to the feed of a live run, or of a record.

use crate::arrival::ArrivalClock;
use crate::decoder::Decoder;
use crate::feed::{Due, Events, Fed, LiveFeed, Recording, Sending, Tally};
use crate::inbox::{Counts, Inbox, Open, Outlet};
use crate::leaving::{Leaving, Mailbox};
use crate::output::About;
use crate::placing::{Base, Placing};
use crate::record::Record;
use crate::sensors::{Sensors, Watch};
use crate::speaker::{LineListener, Speaker};
use crate::status::{Board, StatusListener};
use crate::table::{LinkDesign, Tables};
use fusion::assembly::Assembly;
use fusion::config::{Diagnostic, Diagnostics};
use fusion::design::{Design, LinkClock};
use fusion::examine::build;
use fusion::health::Names;
use fusion::models::earth::LocalFrame;
use fusion::observe::Filters;
use fusion::output::{EstimateClock, Origin};
use fusion::rows::Feed;
use fusion::run::FeedMaker;
use fusion::source::OpenContext;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The interval of an output's watchdog, in intervals of its estimates.
const WATCHDOG: f64 = 10.0;
/// A longer interval between two estimates is shortened to this: the monotonic clock has to reach its end.
const RAREST: Duration = Duration::from_secs(86_400);
/// Bytes of a link that may wait for the filter, if the design does not declare them.
const MOST_WAITING: u64 = 4 << 20;

/// A design with links.
#[derive(Debug)]
pub struct Live {
    design: Arc<Design>,
    tables: Tables,
}

/// How a design runs live.
#[derive(Default)]
pub struct LiveOptions {
    /// The file into which everything that comes in is recorded.
    pub record: Option<PathBuf>,
    /// How long it runs; without it, until its links end or it is stopped.
    pub duration: Option<Duration>,
    /// Becomes true when it is to end.
    pub stop: Arc<AtomicBool>,
    /// Hears the status, at this interval.
    pub status: Option<(Duration, StatusListener)>,
    /// Hears lines about events, such as those of a watchdog.
    pub say: Option<LineListener>,
}

impl core::fmt::Debug for LiveOptions {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("LiveOptions").field("record", &self.record).finish_non_exhaustive()
    }
}

/// A failure of the operating system, which ends the run.
fn cannot(what: &str, error: &std::io::Error) -> Diagnostics {
    Diagnostic::error(format!("{what}: {error}")).into()
}

impl Live {
    /// The links and outputs of a design.
    ///
    /// # Errors
    /// The design has no link that feeds a source, or a simulated world; or mistakes of the tables.
    pub fn of(design: &Design) -> Result<Self, Diagnostics> {
        let mut d = Diagnostics::new();
        let tables = Tables::read(&design.document, &mut d);
        let root = design.document.root();
        if design.simulation.is_some() {
            let help = "leave out `[simulation]`, and declare `[source.NAME]` for the bytes of the links";
            let message = "a simulated design has no live rows";
            d.push(Diagnostic::error(message).at(root.place_of("simulation")).help(help));
        } else if tables.links.iter().all(|link| link.common.sources.is_empty()) {
            let help = "add [link.NAME] with a `type`, such as \"udp\", and `sources = [\"NAME\"]`; `fusion blocks` lists the types";
            d.push(
                Diagnostic::error("no link feeds a source of this design")
                    .at(root.place())
                    .help(help),
            );
        }
        let tables = d.unless_errors(tables)?;
        let design = Arc::new(build(design.document.clone())?);
        Ok(Self { design, tables })
    }

    /// The feed of a live run, for [`Options::feed`](fusion::run::Options::feed), and the observer that its outputs need.
    #[must_use]
    pub fn start(self, options: LiveOptions) -> (FeedMaker, Watch) {
        let watch = Watch::default();
        let sensors = watch.sensors.clone();
        let waiting = Mutex::new(Some((self, options)));
        let maker = FeedMaker::new(move |_, assembly| {
            let taken = waiting.lock().unwrap_or_else(PoisonError::into_inner).take();
            let twice = || Diagnostics::from(Diagnostic::error("a live run is opened once"));
            let (live, options) = taken.ok_or_else(twice)?;
            live.open(assembly, options, sensors.clone())
        });
        (maker, watch)
    }

    /// The feed of a record, with the same rows as the live run. `say` hears lines about events.
    #[must_use]
    pub fn replay(self, record: &Path, say: Option<LineListener>) -> FeedMaker {
        let path = record.to_owned();
        FeedMaker::new(move |_, assembly| {
            let links = || self.tables.links.iter();
            let names: Vec<String> = links().map(|link| link.name.clone()).collect();
            let needed = links().filter(|link| !link.common.sources.is_empty());
            let needed: Vec<&str> = needed.map(|link| link.name.as_str()).collect();
            let unreadable = |error| cannot(&path.display().to_string(), &error);
            let mut record = Record::open(&path, &names).map_err(unreadable)?;
            record.needs(&needed).map_err(unreadable)?;
            let (sources, of_links) = self.sources(assembly)?;
            let board = Board::new(None).map_err(|error| cannot("no thread for the status", &error))?;
            let speaker = Speaker::new(say.clone()).map_err(|error| cannot("no thread for lines", &error))?;
            let feed = LiveFeed::new(Events::Record(record), of_links, sources, self.base(), board, speaker);
            Ok(Box::new(feed))
        })
    }

    /// GPS time at the time zero of the filter, if the stamps of a source are dates; or if no source has its own stamps.
    fn base(&self) -> Base {
        let own = |link: &&LinkDesign| link.common.clock == LinkClock::Own;
        let named = self.tables.links.iter().filter(own).flat_map(|link| &link.common.sources);
        let own: Vec<Option<i64>> = named.map(|name| self.time_zero(name)).collect();
        let zero = if own.is_empty() {
            Some(0)
        } else {
            own.into_iter().flatten().next()
        };
        Base::new(zero)
    }

    fn time_zero(&self, source: &str) -> Option<i64> {
        let named = self.design.sources.iter().find(|named| named.name == source)?;
        named.block.source.time_zero()
    }

    /// The sources that links feed, and their numbers by link.
    fn sources(&self, assembly: &Assembly) -> Result<(Vec<Fed>, Vec<Vec<usize>>), Diagnostics> {
        let (mut sources, mut of_links) = (Vec::new(), Vec::new());
        for link in &self.tables.links {
            let first = sources.len();
            for name in &link.common.sources {
                let number = self.design.sources.iter().position(|named| named.name == *name);
                let stream = assembly.streams.iter().position(|stream| stream.name == *name);
                // A source that no block reads has no stream.
                let Some((number, stream)) = number.zip(stream) else { continue };
                let context = OpenContext {
                    name: name.clone(),
                    origin: self.design.run.origin.map(Into::into),
                    seed: self.design.run.seed,
                    ..OpenContext::default()
                };
                let decoder = Decoder::start(self.design.clone(), number, context);
                sources.push(Fed {
                    name: name.clone(),
                    stream,
                    decoder: decoder.map_err(|error| cannot("no thread for a source", &error))?,
                    placing: Placing::new(link.common.clock, link.common.drift.map(|drift| drift.si())),
                    lately: Default::default(),
                    number_before: 0,
                    tally: Tally::default(),
                    last_number: 0,
                });
            }
            of_links.push((first..sources.len()).collect());
        }
        Ok((sources, of_links))
    }

    fn open(self, assembly: &Assembly, options: LiveOptions, sensors: Sensors) -> Result<Box<dyn Feed>, Diagnostics> {
        let clock = ArrivalClock::start();
        let (sources, of_links) = self.sources(assembly)?;
        let base = self.base();
        let inbox = Arc::new(Inbox::new(self.tables.links.len(), options.stop.clone()));
        let mut board = Board::new(options.status).map_err(|error| cannot("no thread for the status", &error))?;
        let filters = Filters::of(assembly);
        let names = filters.outermost().map(|own| Names::new(own, assembly)).unwrap_or_default();
        let time_zero = self.design.time_zero();
        let about = About {
            description: self.design.run.description.clone(),
            origin: Origin::new(self.design.run.origin.map(|place| LocalFrame::new(place.into()))),
            clock: EstimateClock { time_zero },
            sensors: filters
                .outermost()
                .map_or_else(Vec::new, |own| own.sensors.iter().map(|s| s.name.clone()).collect()),
        };
        let speaker = Speaker::new(options.say).map_err(|error| cannot("no thread for lines", &error))?;
        let outlets: Vec<Outlet> = self.tables.links.iter().map(|_| Outlet::default()).collect();
        let links: Vec<String> = self.tables.links.iter().map(|link| link.name.clone()).collect();
        let mut due = Vec::new();
        for output in &self.tables.outputs {
            let opened = output.spec.open(&about);
            let opened = opened.map_err(|error| cannot(&format!("the output `{}` cannot be opened", output.name), &error))?;
            let every = 1.0 / output.common.rate.si();
            let watchdog = output.common.watchdog.map_or(WATCHDOG * every, |declared| declared.si());
            let mailbox = Arc::new(Mailbox::default());
            let number = output.spec.link().and_then(|name| links.iter().position(|link| link == name));
            let leaving = Leaving {
                name: output.name.clone(),
                output: opened,
                outlet: number.map(|number| outlets[number].clone()),
                mailbox: mailbox.clone(),
                watchdog: Duration::try_from_secs_f64(watchdog).map_or(RAREST, |watchdog| watchdog.min(RAREST)),
                speaker: speaker.clone(),
            };
            leaving.start().map_err(|error| cannot("no thread for an output", &error))?;
            board.outputs.push((output.name.clone(), mailbox.clone()));
            due.push(Due {
                mailbox,
                every: Duration::try_from_secs_f64(every).map_or(RAREST, |every| every.min(RAREST)),
                next: Instant::now(),
                count: 0,
            });
        }
        for (number, (link, outlet)) in self.tables.links.into_iter().zip(outlets).enumerate() {
            let counts = Arc::new(Counts::default());
            board.links.push((link.name.clone(), counts.clone()));
            let open = Open {
                spec: link.spec,
                number,
                most: link.common.most_waiting.unwrap_or(MOST_WAITING),
                is_read: !of_links[number].is_empty(),
                outlet,
                counts,
                name: link.name,
                speaker: speaker.clone(),
            };
            open.start(inbox.clone(), clock)
                .map_err(|error| cannot("no thread for a link", &error))?;
        }
        let mut feed = LiveFeed::new(Events::Links(inbox), of_links, sources, base, board, speaker);
        feed.sending = Some(Sending {
            outputs: due,
            sensors,
            names,
            time_zero,
            clock,
            // A length beyond the clock has no end.
            until: options.duration.and_then(|duration| Instant::now().checked_add(duration)),
        });
        feed.recording = options.record.map(|path| Recording {
            path,
            recorder: None,
            ended_at: None,
            links,
            ahead: clock.ahead_of_unix(),
        });
        Ok(Box::new(feed))
    }
}
