//! Trajectories of TUM, as evo reads them.
//!
//! A row is `stamp x y z qx qy qz qw`. The world is east, north, up from the origin of local coordinates. The body is
//! forward, left, up, as in ROS. The stamps are Unix time \[s\], or the time of the log if its date is not known. Without
//! an attitude the quaternion is 0 0 0 1.
//!
//! Source    <https://github.com/MichaelGrupp/evo/wiki/Formats>

use crate::pose::Pose;
use fusion::core::belief::Belief;
use fusion::output::{EstimateClock, EstimateFormat, EstimateSink, Origin, OutputFile};
use fusion::solution::Solution;
use std::io::{self, Write};

fusion::inventory::submit! {
    EstimateFormat {
        name: "tum",
        ending: "tum",
        about: "trajectory of TUM for evo: stamp, position east, north, up, attitude",
        begin: |file, about| Ok(Box::new(Tum { file, origin: about.origin.clone(), clock: about.clock })),
    }
}

#[derive(Debug)]
struct Tum {
    file: OutputFile,
    origin: Origin,
    clock: EstimateClock,
}

impl EstimateSink for Tum {
    fn write(&mut self, solution: &Solution, _belief: &Belief) -> io::Result<()> {
        let Some(Pose { p, q }) = Pose::of(solution, &self.origin) else {
            return Ok(());
        };
        let nanos = self.clock.unix_nanos(solution.time);
        let (seconds, fraction) = (nanos.div_euclid(1_000_000_000), nanos.rem_euclid(1_000_000_000));
        writeln!(
            self.file,
            "{seconds}.{fraction:09} {:.4} {:.4} {:.4} {:.9} {:.9} {:.9} {:.9}",
            p.x, p.y, p.z, q.i, q.j, q.k, q.w
        )
    }

    fn finish(self: Box<Self>) -> io::Result<OutputFile> {
        Ok(self.file)
    }
}
