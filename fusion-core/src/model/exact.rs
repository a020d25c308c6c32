//! Exact derivatives for models that write only h.
//!
//! An author implements [`ExactModel::h`] once, generic over the number type, and wraps the
//! model in [`Exact`]. One evaluation in real numbers finds the quantities that h reads. Dual
//! numbers then carry the derivative along one tangent direction of these quantities at a time.

use super::dual::{Dual, Real};
use super::literal::Literal;
use super::measurement::{Measurement, Size, Undefined};
use crate::geometry::wgs84;
use crate::linear::Jacobian;
use crate::math;
use crate::state::{Angle, Attitude, Geodetic, Manifold, Position, Quantity, Scalar, Vector, Velocity, View};
use core::cell::RefCell;
use core::fmt::Debug;
use nalgebra::{SVector, Vector3};
use smallvec::{SmallVec, smallvec};

/// A measurement model given by h alone.
pub trait ExactModel: Debug + Send + Sync {
    /// Numbers in h.
    fn dim(&self) -> usize;

    /// h(x) into `z`, for real and dual numbers alike.
    ///
    /// # Errors
    /// [`Undefined`] where h has no value or derivative.
    fn h<D: Real>(&self, x: &ExactView<'_, D>, z: &mut [D]) -> Result<(), Undefined>;

    /// The model as a Rust expression, by [`literal!`](crate::literal!); `None` if it cannot write itself.
    fn literal(&self) -> Option<&dyn Literal> {
        None
    }
}

/// The state in real or dual numbers, perturbed along one tangent direction or none.
#[derive(Debug)]
pub struct ExactView<'a, D> {
    at: &'a View<'a>,
    seed: Option<(Source, usize, D)>,
    reads: Option<&'a RefCell<Reads>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    State,
    Signal,
}

/// One quantity read by h: where its tangent starts and how long it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Read {
    source: Source,
    tangent: usize,
    dim: usize,
}

/// The quantities that h reads, each once, in the order of the first reading. Up to sixteen are
/// stored inline.
type Reads = SmallVec<[Read; 16]>;

impl<'a, D: Real> ExactView<'a, D> {
    /// The view without a perturbation.
    const fn plain(at: &'a View<'a>) -> Self {
        let (seed, reads) = (None, None);
        Self { at, seed, reads }
    }

    /// Notes in `reads` the quantities that are read.
    const fn noting(at: &'a View<'a>, reads: &'a RefCell<Reads>) -> Self {
        let (seed, reads) = (None, Some(reads));
        Self { at, seed, reads }
    }

    /// Perturbs the tangent axis `axis`, counted over the whole state or all signals.
    const fn along(at: &'a View<'a>, source: Source, axis: usize, by: D) -> Self {
        let (seed, reads) = (Some((source, axis, by)), None);
        Self { at, seed, reads }
    }

    /// Notes the reading of a quantity and returns where its tangent starts; `None` for a constant.
    fn note<M: Manifold>(&self, q: &Quantity<M>) -> Option<(Source, usize)> {
        let (source, tangent) = match q {
            Quantity::Fixed(_) => return None,
            Quantity::State(s) => (Source::State, s.tangent),
            Quantity::Signal(s) => (Source::Signal, s.tangent),
        };
        if let Some(reads) = self.reads {
            let dim = M::KIND.dim();
            let read = Read { source, tangent, dim };
            let mut reads = reads.borrow_mut();
            if !reads.contains(&read) {
                reads.push(read);
            }
        }
        Some((source, tangent))
    }

    /// The given numbers of the row, see [`Measurement::given`].
    #[must_use]
    pub const fn given(&self) -> &'a [f64] {
        self.at.given()
    }

    fn delta(&self, place: Option<(Source, usize)>, i: usize) -> D {
        match (place, &self.seed) {
            (Some((source, tangent)), Some((s, k, d))) if source == *s && tangent + i == *k => *d,
            _ => D::from(0.0),
        }
    }

    fn additive<M: Manifold, const N: usize>(&self, q: &Quantity<M>, value: SVector<f64, N>) -> SVector<D, N> {
        let place = self.note(q);
        SVector::from_fn(|i, _| self.delta(place, i) + value[i])
    }

    /// A scalar quantity.
    pub fn scalar(&self, q: &Quantity<Scalar>) -> D {
        self.additive(q, SVector::from([self.at.get(q)]))[0]
    }

    /// An angle \[rad\].
    pub fn angle(&self, q: &Quantity<Angle>) -> D {
        self.additive(q, SVector::from([self.at.get(q)]))[0]
    }

    /// A velocity \[m/s\].
    pub fn velocity(&self, q: &Quantity<Velocity>) -> Vector3<D> {
        self.additive(q, self.at.get(q))
    }

    /// A Cartesian position \[m\].
    pub fn position(&self, q: &Quantity<Position>) -> Vector3<D> {
        self.additive(q, self.at.get(q))
    }

    /// A vector of N numbers.
    pub fn vector<const N: usize>(&self, q: &Quantity<Vector<N>>) -> SVector<D, N> {
        self.additive(q, self.at.get(q))
    }

    /// A geodetic position as latitude, longitude \[rad\] and height \[m\].
    pub fn geodetic(&self, q: &Quantity<Geodetic>) -> [D; 3] {
        let p = self.at.get(q);
        let place = self.note(q);
        let r = wgs84::radii(p.lat);
        [
            self.delta(place, 0) * (1.0 / (r.meridian + p.height)) + p.lat,
            self.delta(place, 1) * (1.0 / ((r.normal + p.height) * wgs84::divisible_cos(math::cos(p.lat)))) + p.lon,
            -self.delta(place, 2) + p.height,
        ]
    }

    /// Rotates `v` from body to navigation by an attitude: C_nb v.
    pub fn rotate(&self, q: &Quantity<Attitude>, v: &Vector3<D>) -> Vector3<D> {
        self.matrix(q) * v
    }

    /// C_nb of an attitude.
    pub fn matrix(&self, q: &Quantity<Attitude>) -> nalgebra::Matrix3<D> {
        let c = self.at.get(q).to_rotation_matrix().into_inner();
        let place = self.note(q);
        let d = Vector3::from_fn(|i, _| self.delta(place, i));
        let one = D::from(1.0);
        // Exp(δ) to first order is all a derivative needs, and δ = 0 in value.
        #[rustfmt::skip]
        let exp = nalgebra::Matrix3::new(
            one, -d[2], d[1],
            d[2], one, -d[0],
            -d[1], d[0], one,
        );
        nalgebra::Matrix3::from_fn(|i, j| exp[(0, j)] * c[(i, 0)] + exp[(1, j)] * c[(i, 1)] + exp[(2, j)] * c[(i, 2)])
    }
}

/// The adapter: an [`ExactModel`] as a [`Measurement`] with exact Jacobians.
#[derive(Clone, Debug)]
pub struct Exact<M>(pub M);

impl<M: ExactModel> Measurement for Exact<M> {
    fn size(&self) -> Size {
        Size::same(self.0.dim())
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        self.0.h(&ExactView::plain(at), &mut value[..self.0.dim()])
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        let m = self.0.dim();
        // Up to sixteen rows are stored inline.
        let mut value: SmallVec<[f64; 16]> = smallvec![0.0; m];
        let reads = RefCell::new(Reads::new());
        self.0.h(&ExactView::noting(at, &reads), &mut value)?;
        let mut z: SmallVec<[Dual; 16]> = smallvec![Dual::from(0.0); m];
        for Read { source, tangent, dim } in reads.into_inner() {
            for column in tangent..tangent + dim {
                self.0.h(&ExactView::along(at, source, column, Dual::EPSILON), &mut z)?;
                for (row, z) in z.iter().enumerate() {
                    match source {
                        Source::State => h.add_element(row, column, z.slope),
                        Source::Signal => h.add_signal_element(row, column, z.slope),
                    }
                }
            }
        }
        Ok(())
    }

    crate::literal!(0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::so3::{from_rpy, rotation, skew};
    use crate::model::{Input, Process, SignalsOut};
    use crate::state::{Declaration, Dynamics, Layout, LayoutBuilder, Signal, Slot, StateRole};
    use crate::testing::check_measurement;

    /// Reads a block of every kind, one of them twice, one fixed and one a signal.
    #[derive(Debug)]
    struct Everything {
        position: Quantity<Geodetic>,
        attitude: Quantity<Attitude>,
        lever_arm: Quantity<Vector<3>>,
        velocity: Quantity<Velocity>,
        local: Quantity<Position>,
        heading: Quantity<Angle>,
        scale: Quantity<Scalar>,
        rate: Quantity<Vector<3>>,
    }

    impl ExactModel for Everything {
        fn dim(&self) -> usize {
            3
        }
        fn h<D: Real>(&self, x: &ExactView<'_, D>, z: &mut [D]) -> Result<(), Undefined> {
            let [lat, lon, height] = x.geodetic(&self.position);
            let arm = x.rotate(&self.attitude, &x.vector(&self.lever_arm));
            let v = x.velocity(&self.velocity);
            z[0] = (lat.sin() * lon.cos() + height * 1e-3) * x.scalar(&self.scale) + arm.x * v.y;
            z[1] = x.angle(&self.heading).sin() * v.dot(&v) + arm.z;
            z[2] = x.position(&self.local).dot(&x.vector(&self.rate)) + x.scalar(&self.scale) * v.x;
            Ok(())
        }
    }

    /// Gives the signal `rate` = 2 × velocity.
    #[derive(Debug)]
    struct Turning(Slot<Velocity>, Signal<Vector<3>>);

    impl Process for Turning {
        fn input_dim(&self) -> usize {
            0
        }
        fn propagate(&self, _: &mut [f64], _: &Input<'_>, _: f64) {}
        fn linearise(&self, _: &[f64], _: &Input<'_>, _: f64, _: &mut crate::linear::Transition) {}
        fn signals(&self, x: &[f64], _: &Input<'_>, out: &mut SignalsOut<'_>) {
            out.set(self.1, &(self.0.read(x) * 2.0));
            out.add(self.1, self.0, &(nalgebra::Matrix3::identity() * 2.0));
        }
    }

    fn state<M: Manifold>(b: &mut LayoutBuilder, name: &str, initial: M::Value) -> Slot<M> {
        let (name, owner, sigma) = (name.to_owned(), String::new(), vec![1.0; M::KIND.dim()]);
        b.declare::<M>(Declaration {
            name,
            owner,
            unit: "",
            initial,
            sigma,
            role: StateRole::Kinematic,
            dynamics: Dynamics::Process,
        })
        .unwrap()
    }

    fn problem() -> (Layout, Turning, Everything) {
        let mut b = LayoutBuilder::new();
        let velocity = state::<Velocity>(&mut b, "velocity", Vector3::new(1.0, -2.0, 0.5));
        let signal = b.signal("rate").unwrap();
        let model = Everything {
            position: state::<Geodetic>(&mut b, "position", Geodetic::new(0.6, 2.2, 100.0)).into(),
            attitude: state::<Attitude>(&mut b, "attitude", from_rpy(0.3, -0.5, 2.0)).into(),
            lever_arm: state::<Vector<3>>(&mut b, "lever_arm", Vector3::new(0.5, 1.0, -2.0)).into(),
            velocity: velocity.into(),
            local: Quantity::Fixed(Vector3::new(10.0, 20.0, 30.0)),
            heading: state::<Angle>(&mut b, "heading", 1.0).into(),
            scale: state::<Scalar>(&mut b, "scale", 1.5).into(),
            rate: Quantity::Signal(signal),
        };
        (b.finish(), Turning(velocity, signal), model)
    }

    #[test]
    fn exact_jacobians_of_every_kind_match_central_differences() {
        let (layout, process, model) = problem();
        check_measurement(&layout, Some(&process), &Exact(model), layout.initial(), &Input::held(&[])).unwrap();
    }

    /// Row i is the square of state i, plus the state before it.
    #[derive(Debug)]
    struct Many(Vec<Quantity<Scalar>>);

    impl ExactModel for Many {
        fn dim(&self) -> usize {
            self.0.len()
        }
        fn h<D: Real>(&self, x: &ExactView<'_, D>, z: &mut [D]) -> Result<(), Undefined> {
            for (i, state) in self.0.iter().enumerate() {
                z[i] = x.scalar(state) * x.scalar(state) + x.scalar(&self.0[i.saturating_sub(1)]);
            }
            Ok(())
        }
    }

    #[test]
    fn more_rows_and_readings_than_fit_inline_are_all_there() {
        let mut b = LayoutBuilder::new();
        let mut scalar = |i: u32| state::<Scalar>(&mut b, &format!("s{i}"), 1.0 + f64::from(i)).into();
        let model = Many((0..40).map(&mut scalar).collect());
        let layout = b.finish();
        check_measurement(&layout, None, &Exact(model), layout.initial(), &Input::held(&[])).unwrap();
    }

    #[test]
    fn the_exact_derivative_of_a_rotated_vector_is_the_one_by_hand() {
        let (layout, _, model) = problem();
        let signals = [0.0; 3];
        let view = View::new(layout.initial(), &signals);
        let mut h = Jacobian::new(&layout, 3);
        h.reset(3);
        let (c, l, v) = (
            rotation(&view.get(&model.attitude)),
            view.get(&model.lever_arm),
            view.get(&model.velocity),
        );
        let start = layout.block("attitude").unwrap().tangent;
        Exact(model).jacobian(&view, &mut h).unwrap();
        let by_hand = -c * skew(&l);
        for j in 0..3 {
            // 4 ε: rounding.
            assert!((h.get(0, start + j) - by_hand[(0, j)] * v.y).abs() < 1e-14);
            assert!((h.get(1, start + j) - by_hand[(2, j)]).abs() < 1e-14);
        }
    }
}
