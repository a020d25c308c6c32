//! Fixed parameters of sensors against what the design's own filter makes of them where they are states.
//!
//! First all are states at once, in one more run (`search.rs`): each starts from what is declared, with a σ that a careful
//! guess would have. What goes elsewhere there is only suspected, for several parameters may share one error. So each
//! suspect is tried alone, and the one that makes the innovations most probable is told (`course.rs`). What else is wrong is
//! looked for where that one is put right.
//!
//! Where the filter does not follow its data even so, what a linear filter cannot find is tried as well: quarter turns, a
//! sign, another unit, another latency (`parameter.rs`).

mod course;
mod parameter;
mod search;
mod told;

pub(super) use search::{judge, untried};
