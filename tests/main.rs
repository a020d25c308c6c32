//! The integration tests, one binary: this page is their table of contents.

#![expect(clippy::unwrap_used, reason = "helpers of tests are tests")]

/// Heading from the Earth's rotation at rest.
#[path = "suite/alignment.rs"]
mod alignment;
/// The noises of an inertial unit from a log at rest.
#[path = "suite/allan.rs"]
mod allan;
/// A filter inside a stage that finds the attitude: what its blocks do together.
#[path = "suite/attitude_filter.rs"]
mod attitude_filter;
/// Every chart, update, form and reset on a shipped design, and combinations without a meaning.
#[path = "suite/backends.rs"]
mod backends;
/// A bank of hypotheses: false fixes after an outage, starts without a heading.
#[path = "suite/bank.rs"]
mod bank;
/// A Doppler log whose beams come and go one by one.
#[path = "suite/beams.rs"]
mod beams;
/// The book: its commands are run, its designs are checked, its links are followed.
#[cfg(unix)]
#[path = "suite/book.rs"]
mod book;
/// The design with outliers over a hundred seeds: its experiments, and its gate under stress.
#[path = "suite/campaigns.rs"]
mod campaigns;
/// Charts of the attitude through loops that pass the vertical.
#[path = "suite/charts.rs"]
mod charts;
/// Stopped at any row and gone on from a checkpoint.
#[path = "suite/checkpoint.rs"]
mod checkpoint;
/// The built command: help, results, exit codes, files.
#[path = "suite/command.rs"]
mod command;
/// Rows that a program brings, in place of files.
#[path = "suite/feeds.rs"]
mod feeds;
/// Stopped and killed runs, full disks, pipes, long names: what lies in the folder afterwards.
#[cfg(unix)]
#[path = "suite/files.rs"]
mod files;
/// What runs of the shipped designs are told to look at next.
#[path = "suite/findings.rs"]
mod findings;
/// Every shipped design with every form of the covariance.
#[path = "suite/forms.rs"]
mod forms;
/// Mistakes of axes, signs, units and lever arms, found from the data.
#[path = "suite/frames/mod.rs"]
mod frames;
/// Gaps and spikes of the inertial unit, recorded and simulated.
#[path = "suite/gaps.rs"]
mod gaps;
/// What gates did to rows that are known to be wrong, and the innovations.
#[path = "suite/gates.rs"]
mod gates;
/// What filters say of themselves: good on good data, degraded or lost before they are astray.
#[path = "suite/health.rs"]
mod health;
/// Which crate may use which, and no circle of modules.
#[path = "suite/house.rs"]
mod house;
/// Designs put together from parts, and how they read when flat.
#[path = "suite/includes.rs"]
mod includes;
/// First designs that are guessed from logs, beside those made by hand.
#[path = "suite/inspect.rs"]
mod inspect;
/// Time offsets that are estimated: recorded logs, and a simulated drive with noisy accelerometers.
#[path = "suite/latency.rs"]
mod latency;
/// A magnetometer with hard iron, and what disturbs it.
#[path = "suite/magnetometer.rs"]
mod magnetometer;
/// What a user is told about every kind of mistake, word for word.
#[path = "suite/mistakes.rs"]
mod mistakes;
/// Many seeds: the same on any number of threads, and as runs of their own.
#[path = "suite/montecarlo.rs"]
mod montecarlo;
/// The navigators of a tracked vehicle side by side, and the gains of the published one.
#[path = "suite/navigators.rs"]
mod navigators;
/// Designs to begin with: what `fusion new` writes runs at once.
#[path = "suite/new.rs"]
mod new;
/// Closed forms of inertial navigation: drift, coning, clean data, the seam of the heading.
#[path = "suite/oracles.rs"]
mod oracles;
/// Order of arrival against order of time.
#[path = "suite/order.rs"]
mod order;
/// report.html in a browser, used by mouse and keys.
#[path = "suite/page.rs"]
mod page;
/// The parts library: every part in a small design of its kind.
#[path = "suite/parts.rs"]
mod parts;
/// The tables on speed: made of the figures that were measured.
#[path = "suite/performance.rs"]
mod performance;
/// How far a run over recorded files is.
#[path = "suite/progress.rs"]
mod progress;
/// Published tables of filters on benchmarks, reproduced.
#[path = "suite/published.rs"]
mod published;
/// False tracks that gates believe, or must not, and what they leave behind.
#[path = "suite/reacquisition.rs"]
mod reacquisition;
/// Real recorded logs, scored against their references.
#[path = "suite/real.rs"]
mod real;
/// Simulated worlds as logs, and the filter over them.
#[path = "suite/record.rs"]
mod record;
/// References of several sources, and of some axes only.
#[path = "suite/references.rs"]
mod references;
/// Every value of every shipped design made wrong: each message says where, and what is accepted.
#[path = "suite/refused.rs"]
mod refused;
/// Runs that are stopped, and gone on with from what was saved.
#[cfg(unix)]
#[path = "suite/resumed.rs"]
mod resumed;
/// Rows that come late, used by going back: every design, any order of arrival.
#[path = "suite/rewind.rs"]
mod rewind;
/// The designs of scenes in which backends differ: that they run, and who wins.
#[path = "suite/scenes.rs"]
mod scenes;
/// The JSON Schema against every example and every shipped design.
#[path = "suite/schema.rs"]
mod schema;
/// The sea trial of a tracked robot: its fixes, and the filter beside them.
#[path = "suite/sea_trial.rs"]
mod sea_trial;
/// Smoothed estimates: recorded logs, a lag, files and memory.
#[path = "suite/smoothing.rs"]
mod smoothing;
/// Position, velocity and attitude as processes tell them, against a known motion.
#[path = "suite/solution.rs"]
mod solution;
/// Starts at moments of recorded drives: how certain parameters are a minute later.
#[path = "suite/starts.rs"]
mod starts;
/// Vehicles that are steered by the estimate of their own filter.
#[path = "suite/steered.rs"]
mod steered;
/// A design under its catalogue of faults: does it survive, and does it say so.
#[path = "suite/stress.rs"]
mod stress;
/// A workspace of files for a test, and the command run in it.
#[path = "suite/support.rs"]
mod support;
/// Absolute and relative errors of a recorded trajectory, against figures of evo.
#[path = "suite/trajectories.rs"]
mod trajectories;
/// Simulated sensors of which the filter is wrong.
#[path = "suite/truth.rs"]
mod truth;
/// Variants of the shipped designs, alone and two at a time.
#[path = "suite/variants.rs"]
mod variants;
/// Track odometry of a skidding robot: parameters learnt on some of its log, judged on the rest.
#[path = "suite/warthog.rs"]
mod warthog;
/// Recorded logs under water, scored on positions that the filter has not seen.
#[path = "suite/water.rs"]
mod water;
