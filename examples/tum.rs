//! A run as two trajectories in the format of the TUM benchmarks, for `evo_ape` and `evo_rpe`.
//!
//!     cargo run --release --example tum -- DESIGN OUTPUT_DIR [DATA_DIR]
//!
//! writes OUTPUT_DIR/estimate.tum and reference.tum: a pose at each position of the reference that counts, with equal
//! stamps, in north-east-down axes tangent to the Earth at the first of them. Where there is no attitude it is the
//! identity. The errors that fusion finds are printed.

use fusion::config::Document;
use fusion::core::runner::Halt;
use fusion::core::time::Time;
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Options, Run};
use fusion::score::trajectory::{Pose, Poses};
use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Collects the poses of the outermost filter, from when on errors count.
struct Collector {
    from: Time,
    poses: Poses,
}

impl RunObserver for Collector {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Reference {
            filter,
            error: Some(error),
            ..
        } = event
            && filter.is_outermost()
            && error.time() >= self.from
        {
            self.poses.add(error);
        }
        Ok(())
    }
}

fn write(file: &Path, poses: impl Iterator<Item = (f64, Pose)>) -> std::io::Result<()> {
    let mut file = std::io::BufWriter::new(std::fs::File::create(file)?);
    for (t, pose) in poses {
        let (p, q) = (pose.position, pose.attitude.unwrap_or_default());
        writeln!(file, "{t:.9} {} {} {} {} {} {} {}", p.x, p.y, p.z, q.i, q.j, q.k, q.w)?;
    }
    file.flush()
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [file, output, data @ ..] = &args[..] else {
        return Err("usage: tum DESIGN OUTPUT_DIR [DATA_DIR]".into());
    };
    let design = Design::read(Document::load(file)?)?;
    let options = Options {
        base: file.parent().map(Path::to_path_buf).unwrap_or_default(),
        data: data.first().cloned(),
        ..Options::default()
    };
    let from = design.reference.as_ref().and_then(|r| r.block.from);
    let mut collector = Collector {
        from: from.map_or(Time::MIN, |t| Time::from_seconds(t.si())),
        poses: Poses::default(),
    };
    let finished = Run::open(&design, &options)?.go(&mut [&mut collector], &mut |_| {})?;
    let pairs = collector.poses.pairs(&Default::default());
    std::fs::create_dir_all(output)?;
    write(&output.join("estimate.tum"), pairs.iter().map(|p| (p.time.seconds(), p.estimate)))?;
    write(&output.join("reference.tum"), pairs.iter().map(|p| (p.time.seconds(), p.reference)))?;
    let found = finished.summary.score().map(|score| &score.trajectory);
    writeln!(std::io::stdout(), "{}", serde_json::to_string_pretty(&found)?)?;
    Ok(())
}
