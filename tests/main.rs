//! The integration tests, one binary: this page is their table of contents.

#![expect(clippy::unwrap_used, reason = "helpers of tests are tests")]

/// Heading from the Earth's rotation at rest.
#[path = "suite/alignment.rs"]
mod alignment;
/// The noises of an inertial unit from a log at rest.
#[path = "suite/allan.rs"]
mod allan;
/// A filter inside a stage that estimates the attitude: the effect of its blocks together.
#[path = "suite/attitude_filter.rs"]
mod attitude_filter;
/// Every chart, update, form and reset on a shipped design, and combinations without a meaning.
#[path = "suite/backends.rs"]
mod backends;
/// Real logs of messages against the reference readers, and against the text files made of them.
#[path = "suite/bags.rs"]
mod bags;
/// A bank of hypotheses: false fixes after an outage, starts without a heading.
#[path = "suite/bank.rs"]
mod bank;
/// A Doppler log whose beams are lost and return one by one.
#[path = "suite/beams.rs"]
mod beams;
/// The first measurement that two runs treat differently.
#[path = "suite/bisect.rs"]
mod bisect;
/// The book: its commands are run, its designs are checked, its links are followed.
#[cfg(unix)]
#[path = "suite/book.rs"]
mod book;
/// Which share of each error comes from which source.
#[path = "suite/budget.rs"]
mod budget;
/// The design with outliers over a hundred seeds: its experiments, and its gate under stress.
#[path = "suite/campaigns.rs"]
mod campaigns;
/// Charts of the attitude through loops that pass the vertical.
#[path = "suite/charts.rs"]
mod charts;
/// Stops at any row and resumes from a checkpoint.
#[path = "suite/checkpoint.rs"]
mod checkpoint;
/// The built command: help, results, exit codes, files.
#[path = "suite/command.rs"]
mod command;
/// Rows from a program instead of files.
#[path = "suite/feeds.rs"]
mod feeds;
/// Stopped and killed runs, full disks, pipes, long names: the files that remain in the folder.
#[cfg(unix)]
#[path = "suite/files.rs"]
mod files;
/// Findings in the runs of the shipped designs.
#[path = "suite/findings.rs"]
mod findings;
/// Estimates in the formats of maps and other programs.
#[path = "suite/formats.rs"]
mod formats;
/// Every shipped design with every form of the covariance.
#[path = "suite/forms.rs"]
mod forms;
/// Mistakes of axes, signs, units and lever arms, found from the data.
#[path = "suite/frames/mod.rs"]
mod frames;
/// Gaps and spikes of the inertial unit, recorded and simulated.
#[path = "suite/gaps.rs"]
mod gaps;
/// The decisions of gates on rows that are known to be wrong, and the innovations.
#[path = "suite/gates.rs"]
mod gates;
/// The reported health of filters: good on good data, degraded or lost before the estimate diverges.
#[path = "suite/health.rs"]
mod health;
/// Which crate may use which, and no cycles of modules.
#[path = "suite/house.rs"]
mod house;
/// Designs composed of parts, and their flat form.
#[path = "suite/includes.rs"]
mod includes;
/// First designs guessed from logs, compared with designs made by hand.
#[path = "suite/inspect.rs"]
mod inspect;
/// Time offsets that are estimated: recorded logs, and a simulated drive with noisy accelerometers.
#[path = "suite/latency.rs"]
mod latency;
/// Live links over loopback, their record, kills and resumes.
#[cfg(unix)]
#[path = "suite/live.rs"]
mod live;
/// A magnetometer with hard iron and disturbances.
#[path = "suite/magnetometer.rs"]
mod magnetometer;
/// The message for every kind of mistake, word for word.
#[path = "suite/mistakes.rs"]
mod mistakes;
/// Many seeds: the same results on any number of threads, and as separate runs.
#[path = "suite/montecarlo.rs"]
mod montecarlo;
/// The navigators of a tracked vehicle side by side, and the gains of the published navigator.
#[path = "suite/navigators.rs"]
mod navigators;
/// Designs to begin with: the designs that `fusion new` writes run at once.
#[path = "suite/new.rs"]
mod new;
/// Observability along a motion: published ranks, and the motion that identifies a state.
#[path = "suite/observability.rs"]
mod observability;
/// The maximum a posteriori of a log, found in two ways.
#[path = "suite/optimum.rs"]
mod optimum;
/// Closed forms of inertial navigation: drift, coning, clean data, the wrap of the heading.
#[path = "suite/oracles.rs"]
mod oracles;
/// Order of arrival compared with order of time.
#[path = "suite/order.rs"]
mod order;
/// report.html in a browser, operated by mouse and keys.
#[path = "suite/page.rs"]
mod page;
/// The parts library: every part in a small design of its kind.
#[path = "suite/parts.rs"]
mod parts;
/// The tables on speed: made from the measured figures.
#[path = "suite/performance.rs"]
mod performance;
/// The progress of a run over recorded files.
#[path = "suite/progress.rs"]
mod progress;
/// Published tables of filters on benchmarks, reproduced.
#[path = "suite/published.rs"]
mod published;
/// False tracks that gates accept, or must not accept, and their effect on biases and latencies.
#[path = "suite/reacquisition.rs"]
mod reacquisition;
/// Real recorded logs, scored against their references.
#[path = "suite/real.rs"]
mod real;
/// Simulated worlds as logs, and the filter over them.
#[path = "suite/record.rs"]
mod record;
/// References with several sources, and with some axes only.
#[path = "suite/references.rs"]
mod references;
/// Every value of every shipped design made wrong: each message names the place and the accepted values.
#[path = "suite/refused.rs"]
mod refused;
/// Runs that are stopped and resumed from their checkpoint.
#[cfg(unix)]
#[path = "suite/resumed.rs"]
mod resumed;
/// Rows that arrive late, used by going back: every design, any order of arrival.
#[path = "suite/rewind.rs"]
mod rewind;
/// Raw GNSS: few satellites, and a published demonstration.
#[path = "suite/satellites.rs"]
mod satellites;
/// The designs of scenes in which backends differ: they run, and the ranking is as expected.
#[path = "suite/scenes.rs"]
mod scenes;
/// The JSON Schema against every example and every shipped design.
#[path = "suite/schema.rs"]
mod schema;
/// The sea trial of a tracked robot: its fixes compared with the filter.
#[path = "suite/sea_trial.rs"]
mod sea_trial;
/// Smoothed estimates: recorded logs, a lag, files and memory.
#[path = "suite/smoothing.rs"]
mod smoothing;
/// Position, velocity and attitude computed by processes, compared with a known motion.
#[path = "suite/solution.rs"]
mod solution;
/// Starts at moments of recorded drives: the σ of parameters one minute later.
#[path = "suite/starts.rs"]
mod starts;
/// Vehicles steered by the estimate of a filter.
#[path = "suite/steered.rs"]
mod steered;
/// A design under its catalogue of faults: does it survive, and does its health report the fault?
#[path = "suite/stress.rs"]
mod stress;
/// A workspace of files for a test, and the command run in it.
#[path = "suite/support.rs"]
mod support;
/// Sensors that rows switch off, or whose noise they change, while the filter runs.
#[path = "suite/switches.rs"]
mod switches;
/// Absolute and relative errors of a recorded trajectory, against figures of evo.
#[path = "suite/trajectories.rs"]
mod trajectories;
/// Simulated sensors whose true parameters differ from those of the filter.
#[path = "suite/truth.rs"]
mod truth;
/// Noises found from innovations: simulated worlds with known noises, a recorded drive judged on its other half.
#[path = "suite/tune.rs"]
mod tune;
/// Variants of the shipped designs, alone and two at a time.
#[path = "suite/variants.rs"]
mod variants;
/// Track odometry of a skidding robot: parameters learnt on parts of the log, judged on the rest.
#[path = "suite/warthog.rs"]
mod warthog;
/// Recorded logs under water, scored on positions that the filter has not seen.
#[path = "suite/water.rs"]
mod water;
