//! The tables that a run writes. All are CSV (RFC 4180) with a header; a name with a comma or a quotation
//! mark is in quotation marks. A cell without a value is empty.
//!
//! A [`FileSet`] gives the files of one result their names together, when all are complete.
//!
//! | file | a row per | columns |
//! |---|---|---|
//! | estimates.csv | epoch: the estimate after every measurement valid at that time was used, thinned to `output_rate` | `t_s`; the solution ([`SOLUTION`]); its 1σ, `sigma_` before the name; then the axes of every further state and their 1σ, in SI |
//! | `estimates.STAGE.csv` | epoch of the filter inside that stage | as estimates.csv |
//! | smoothed.csv | as estimates.csv | as estimates.csv: the same epochs, estimated with later data too |
//! | current.csv | as estimates.csv, of a design with `order = "rewind"` | as estimates.csv: the estimate before later rows changed it. With `--causal` this table is estimates.csv, and the changed estimate is revised.csv |
//! | updates.csv | measurement, in the order of use; `stage.sensor` inside a stage | `t_s,sensor,verdict,nis,statistic,threshold,mode,weight`; `residual_0…`, then `sigma_0…`, the 1σ of the residual, in SI |
//! | `estimates.ENDING`, `smoothed.ENDING` | in another [`EstimateFormat`]: as estimates.csv and smoothed.csv | as the format defines |
//! | runs.csv | run of a campaign | `run,seed`; RMS and maxima of the errors; NEES; the outcomes of the measurements of every sensor |

mod cells;
mod decimal;
mod estimates;
mod format;
pub mod pose;
mod set;
mod spill;
mod unwritable;
mod updates;

pub use cells::Cells;
pub use estimates::{Digits, EstimateCells, EstimateColumns, EstimateWriter, Origin, SOLUTION};
pub use format::{EstimateAbout, EstimateClock, EstimateFormat, EstimateSink};
pub use set::{Abandoned, FileSet, OutputFile, Sink, abandon};
pub(crate) use spill::Spill;
pub use unwritable::Unwritable;
pub(crate) use updates::UpdateWriter;
pub use updates::verdict_name;
