//! Laws of initialisers, on every registered process that they can be built for.

use super::rows::Motion;
use super::{Bench, build};
use crate::block::InitialiserSpec;
use crate::registry::{self, Registration, Role};
use crate::vocabulary::state;
use fusion_core::belief::Belief;
use fusion_core::covariance::FormKind;
use fusion_core::state::Layout;
use fusion_core::testing::{Lcg, check_memory};
use fusion_core::time::Time;

/// Rows on each input, 100 a second, after which it must have found what it looks for.
const ROWS: i32 = 12_000;
/// Rows up to which the memory is given, again and again.
const LAST_GIVEN: i32 = 1000;

/// An initialiser is ready at some time, writes a sound belief into the blocks that it declares and
/// no others, and another that was given its memory on the way writes the same bits.
pub(super) fn check(r: &Registration) -> Result<(), String> {
    let (mut refusals, mut accepted, mut written) = (String::new(), 0, 0);
    for p in registry::all().into_iter().filter(|p| p.role == Role::Process) {
        let mut bench = Bench::new(p).map_err(|e| format!("process `{}`: {e}", p.name))?;
        let spec: Box<dyn InitialiserSpec> = r.spec()?;
        match spec.build(&mut build(r.name, &mut bench.layout)) {
            Ok(_) => {
                accepted += 1;
                for motion in Motion::ALL {
                    let blocks = feed(r.name, spec.as_ref(), &mut bench, motion);
                    written += blocks.map_err(|e| format!("on process `{}`, {motion:?}: {e}", p.name))?;
                }
            }
            Err(e) => refusals += &format!("\n{}: {e}", p.name),
        }
    }
    match (accepted, written) {
        (0, _) => Err(format!("no process suits it:{refusals}")),
        (_, 0) => Err("it writes nothing, at rest or on the move".to_owned()),
        _ => Ok(()),
    }
}

/// How many blocks it writes; none where it is never ready.
fn feed(name: &str, spec: &dyn InitialiserSpec, bench: &mut Bench, motion: Motion) -> Result<usize, String> {
    let mut made = || spec.build(&mut build(name, &mut bench.layout)).map_err(|e| e.to_string());
    let (mut initialiser, mut twin) = (made()?, made()?);
    let layout = bench.layout.so_far();
    let inputs = spec.inputs();
    if inputs.is_empty() && initialiser.waits_for().is_some() {
        return Err("it listens to nothing and waits all the same".to_owned());
    }
    let (mut random, mut time) = (Lcg::new(12), Time::default());
    for k in 0..ROWS {
        if initialiser.waits_for().is_none() {
            break;
        }
        time = Time::from_seconds(0.01 * f64::from(k));
        // From then on it sees the same rows.
        if k % 97 == 0 && k < LAST_GIVEN {
            check_memory(initialiser.as_mut(), twin.as_mut()).map_err(|e| format!("before row {k}: {e}"))?;
        }
        for (input, listen) in inputs.iter().enumerate() {
            let row = motion.row(&listen.channels, time.seconds(), &mut random);
            initialiser.row(input, time, &row);
            twin.row(input, time, &row);
        }
    }
    if initialiser.waits_for() != twin.waits_for() {
        return Err("one with its memory waits for something else".to_owned());
    }
    if initialiser.waits_for().is_some() {
        return Ok(0);
    }
    let before = Belief::initial(layout, &FormKind::default().form(), time);
    let (mut after, mut of_the_twin) = (before.clone(), before.clone());
    initialiser.write(time, layout, &mut after);
    twin.write(time, layout, &mut of_the_twin);
    if after.x != of_the_twin.x || covariance(&after) != covariance(&of_the_twin) {
        return Err("one with its memory writes another belief".to_owned());
    }
    sound(&after)?;
    only_declared(spec, layout, &before, &after)
}

/// P, row by row.
fn covariance(belief: &Belief) -> Vec<f64> {
    belief.covariance.to_dense()
}

/// No correlation is larger than one.
fn sound(belief: &Belief) -> Result<(), String> {
    let (n, p) = (belief.covariance.dim(), covariance(belief));
    let possible = |k: usize| {
        let limit = p[k / n * (n + 1)] * p[k % n * (n + 1)];
        // 1e-12: rounding where a variance is turned into other axes.
        p[k] * p[k] <= limit * (1.0 + 1e-12)
    };
    if belief.is_sound() && (0..n * n).all(possible) {
        Ok(())
    } else {
        Err(format!("the belief it writes is not sound: {:?}, {p:?}", belief.x))
    }
}

/// How many blocks differ, all of them declared. A heading is written to `attitude` where there is one.
fn only_declared(spec: &dyn InitialiserSpec, layout: &Layout, before: &Belief, after: &Belief) -> Result<usize, String> {
    let (n, declared) = (layout.dim(), spec.writes());
    let (p, q) = (covariance(before), covariance(after));
    let mut count = 0;
    for b in layout.blocks() {
        let by_heading = b.name == state::ATTITUDE.as_str() && declared.contains(&state::HEADING.as_str());
        let moved = before.x[b.storage_range()] != after.x[b.storage_range()];
        if moved || b.tangent_range().any(|i| p[i * n..(i + 1) * n] != q[i * n..(i + 1) * n]) {
            if !by_heading && !declared.contains(&b.name.as_str()) {
                return Err(format!("it writes `{}`, which it does not declare", b.name));
            }
            count += 1;
        }
    }
    Ok(count)
}
