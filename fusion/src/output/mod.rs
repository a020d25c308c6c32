//! The tables that a run writes. All are CSV (RFC 4180) with a header; a name that holds a comma
//! or a quotation mark stands in quotation marks. A cell is empty where there is nothing to say.
//!
//! A [`FileSet`] gives the files of one result their names together, when all are whole.
//!
//! | file | a row per | columns |
//! |---|---|---|
//! | estimates.csv | epoch: the estimate after every measurement valid at that time was used, thinned to `output_rate` | `t_s`; the solution ([`SOLUTION`]); its 1σ, `sigma_` before the name; then the axes of every further state and their 1σ, in SI |
//! | `estimates.STAGE.csv` | epoch of the filter inside that stage | as estimates.csv |
//! | smoothed.csv | as estimates.csv | as estimates.csv: the same epochs, with what later data say of them |
//! | current.csv | as estimates.csv, of a design with `order = "rewind"` | as estimates.csv: what was believed before later rows changed it. With `--causal` it is estimates.csv, and what later rows made of it revised.csv |
//! | updates.csv | measurement, in the order of use; `stage.sensor` inside a stage | `t_s,sensor,verdict,nis,statistic,threshold,mode,weight`; `residual_0…`, then `sigma_0…`, the 1σ of the residual, in SI |
//! | runs.csv | run of a campaign | `run,seed`; RMS and maxima of the errors; NEES; what became of the measurements of every sensor |

mod cells;
mod decimal;
mod estimates;
mod set;
mod spill;
mod unwritable;
mod updates;

pub use cells::Cells;
pub use estimates::{EstimateWriter, Origin, SOLUTION};
pub use set::{Abandoned, FileSet, OutputFile, Sink, abandon};
pub use spill::Spill;
pub use unwritable::Unwritable;
pub use updates::{UpdateWriter, verdict_name};
