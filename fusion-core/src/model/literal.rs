//! A model as a Rust expression, for a program that has no design to read.
//!
//! An expression is made of calls and numbers only: floating-point numbers by their bits, so that the model built from
//! it is equal to the bit. Its paths begin at crates, `::alloc` and `::nalgebra` among them: the crate that contains it
//! has `extern crate alloc`, and depends on `nalgebra`, `fusion_core` and the crate of the model.

use super::exact::{Exact, ExactModel};
use crate::Time;
use crate::geometry::wgs84::Geodetic;
use crate::state::{Block, Dynamics, Kind, Layout, Manifold, Quantity, Signal, Slot, StateRole};
use alloc::boxed::Box;
use alloc::collections::VecDeque;
use alloc::format;
use alloc::vec::Vec;
use nalgebra::{Quaternion, SMatrix, Unit};

#[doc(hidden)]
pub use alloc::string::String;

/// A value that can be written as a Rust expression. A model derives it, and says so in the trait of its role by
/// [`literal!`](crate::literal!). The derive needs a public type with public types of fields, in a public module.
///
/// The expression of a block with a memory has this memory too: take it of a block that has seen no row.
///
/// ```
/// use fusion_core::loss::Loss;
/// use fusion_core::model::Literal;
///
/// /// Weight 1 up to `limit` standard deviations, 0 beyond.
/// #[derive(Debug, Literal)]
/// pub struct Cut {
///     limit: f64,
/// }
///
/// impl Loss for Cut {
///     fn weight(&self, norm: f64, _: usize) -> f64 {
///         if norm <= self.limit { 1.0 } else { 0.0 }
///     }
///     fusion_core::literal!();
/// }
///
/// let loss: Box<dyn Loss> = Box::new(Cut { limit: 3.0 });
/// let mut expression = String::new();
/// loss.literal().ok_or("none")?.expression(&mut expression);
/// assert!(expression.ends_with("::Cut::from_literal(f64::from_bits(0x4008000000000000))"));
/// # Ok::<(), &str>(())
/// ```
pub trait Literal {
    /// Appends an expression that builds this value.
    fn expression(&self, out: &mut String);
}

/// In an `impl` of [`Process`](crate::model::Process), [`Measurement`](crate::model::Measurement),
/// [`ExactModel`], [`Stage`](crate::runner::Stage), [`Initialiser`](crate::runner::Initialiser),
/// [`Gate`](crate::gate::Gate) or [`Loss`](crate::loss::Loss): the model writes itself by its [`Literal`]. With the name
/// of a field, only if that field writes itself. It expands to nothing without the feature `std`, so that the code of a
/// microcontroller does not grow.
#[cfg(feature = "std")]
#[macro_export]
macro_rules! literal {
    ($($field:tt)?) => {
        fn literal(&self) -> ::core::option::Option<&dyn $crate::model::Literal> {
            $(self.$field.literal()?;)?
            ::core::option::Option::Some(self)
        }
    };
}

/// In an `impl` of a model: nothing, without the feature `std`.
#[cfg(not(feature = "std"))]
#[macro_export]
macro_rules! literal {
    ($($field:tt)?) => {};
}

/// Appends the call of `function`, a path, with these arguments.
pub fn call(out: &mut String, function: &str, arguments: &[&dyn Literal]) {
    out.push_str(function);
    list(out, '(', arguments.iter().copied(), ')');
}

/// Appends a struct, or a variant with named fields, by its path.
pub fn fields(out: &mut String, path: &str, fields: &[(&str, &dyn Literal)]) {
    out.push_str(path);
    out.push_str(" { ");
    for (name, value) in fields {
        out.push_str(name);
        out.push_str(": ");
        value.expression(out);
        out.push_str(", ");
    }
    out.push('}');
}

/// Appends items between two brackets.
fn list<'a>(out: &mut String, open: char, items: impl IntoIterator<Item = &'a dyn Literal>, close: char) {
    out.push(open);
    for (i, item) in items.into_iter().enumerate() {
        if i > 0 {
            out.push_str(", ");
        }
        item.expression(out);
    }
    out.push(close);
}

/// The boxed value of an expression.
pub(crate) struct Boxed<'a>(pub(crate) &'a dyn Literal);

impl Literal for Boxed<'_> {
    fn expression(&self, out: &mut String) {
        call(out, "::alloc::boxed::Box::new", &[self.0]);
    }
}

impl<T: Literal> Literal for Box<T> {
    fn expression(&self, out: &mut String) {
        Boxed(self.as_ref()).expression(out);
    }
}

impl Literal for f64 {
    fn expression(&self, out: &mut String) {
        out.push_str(&format!("f64::from_bits({:#018x})", self.to_bits()));
    }
}

/// Values whose `Debug` is their expression.
macro_rules! as_shown {
    ($($type:ty),*) => {
        $(impl Literal for $type {
            fn expression(&self, out: &mut String) {
                out.push_str(&format!("{self:?}"));
            }
        })*
    };
}

as_shown!(bool, u8, u16, u32, u64, usize, i8, i16, i32, i64, isize, &str);

impl Literal for String {
    fn expression(&self, out: &mut String) {
        call(out, "::alloc::string::String::from", &[&self.as_str()]);
    }
}

impl<T: Literal> Literal for Option<T> {
    fn expression(&self, out: &mut String) {
        match self {
            Some(value) => call(out, "Some", &[value]),
            None => out.push_str("None"),
        }
    }
}

impl<T: Literal, const N: usize> Literal for [T; N] {
    fn expression(&self, out: &mut String) {
        list(out, '[', self.iter().map(|item| item as _), ']');
    }
}

impl<T: Literal> Literal for Vec<T> {
    fn expression(&self, out: &mut String) {
        out.push_str("::alloc::vec!");
        list(out, '[', self.iter().map(|item| item as _), ']');
    }
}

/// Written as a vector, which owns what the slice borrows.
impl<T: Literal> Literal for &[T] {
    fn expression(&self, out: &mut String) {
        out.push_str("::alloc::vec!");
        list(out, '[', self.iter().map(|item| item as _), ']');
    }
}

impl<T: Literal> Literal for VecDeque<T> {
    fn expression(&self, out: &mut String) {
        out.push_str("::alloc::collections::VecDeque::from(::alloc::vec!");
        list(out, '[', self.iter().map(|item| item as _), ']');
        out.push(')');
    }
}

impl<A: Literal, B: Literal> Literal for (A, B) {
    fn expression(&self, out: &mut String) {
        call(out, "", &[&self.0, &self.1]);
    }
}

impl<A: Literal, B: Literal, C: Literal> Literal for (A, B, C) {
    fn expression(&self, out: &mut String) {
        call(out, "", &[&self.0, &self.1, &self.2]);
    }
}

impl<const R: usize, const C: usize> Literal for SMatrix<f64, R, C> {
    fn expression(&self, out: &mut String) {
        out.push_str("::nalgebra::SMatrix::from_array_storage(::nalgebra::ArrayStorage(");
        self.data.0.expression(out);
        out.push_str("))");
    }
}

impl<T: Literal> Literal for Unit<T> {
    fn expression(&self, out: &mut String) {
        call(out, "::nalgebra::Unit::new_unchecked", &[self.as_ref()]);
    }
}

impl Literal for Quaternion<f64> {
    fn expression(&self, out: &mut String) {
        call(out, "::nalgebra::Quaternion::from_vector", &[&self.coords]);
    }
}

impl Literal for Time {
    fn expression(&self, out: &mut String) {
        call(out, "::fusion_core::Time::from_nanos", &[&self.nanos()]);
    }
}

impl Literal for Geodetic {
    fn expression(&self, out: &mut String) {
        let coordinates: [&dyn Literal; 3] = [&self.lat, &self.lon, &self.height];
        call(out, "::fusion_core::geometry::wgs84::Geodetic::new", &coordinates);
    }
}

/// A manifold of another crate has no expression: a program with one is not written.
impl Literal for Kind {
    fn expression(&self, out: &mut String) {
        out.push_str(&format!("::fusion_core::state::Kind::{self:?}"));
    }
}

impl Literal for StateRole {
    fn expression(&self, out: &mut String) {
        out.push_str(&format!("::fusion_core::state::StateRole::{self:?}"));
    }
}

impl Literal for Dynamics {
    fn expression(&self, out: &mut String) {
        match self {
            Self::Process | Self::Constant => out.push_str(&format!("::fusion_core::state::Dynamics::{self:?}")),
            Self::RandomWalk { psd } => fields(out, "::fusion_core::state::Dynamics::RandomWalk", &[("psd", psd)]),
            Self::GaussMarkov { sigma, tau } => {
                fields(
                    out,
                    "::fusion_core::state::Dynamics::GaussMarkov",
                    &[("sigma", sigma), ("tau", tau)],
                );
            }
            Self::Integral { rate, psd } => {
                fields(out, "::fusion_core::state::Dynamics::Integral", &[("rate", rate), ("psd", psd)]);
            }
        }
    }
}

impl Literal for Block {
    fn expression(&self, out: &mut String) {
        let parts: [&dyn Literal; 10] = [
            &self.name,
            &self.kind,
            &self.storage,
            &self.tangent,
            &self.role,
            &self.dynamics,
            &self.owner,
            &self.unit,
            &self.sigma,
            &self.is_in_body_axes(),
        ];
        call(out, "::fusion_core::state::Block::from_literal", &parts);
    }
}

impl Literal for Layout {
    fn expression(&self, out: &mut String) {
        let signals: Vec<(String, Kind)> = self.signals().map(|(name, kind, ..)| (name.into(), kind)).collect();
        let parts: [&dyn Literal; 3] = [&self.blocks(), &signals, &self.initial()];
        call(out, "::fusion_core::state::Layout::from_literal", &parts);
    }
}

impl<M> Literal for Slot<M> {
    fn expression(&self, out: &mut String) {
        call(out, "::fusion_core::state::Slot::from_literal", &[&self.storage, &self.tangent]);
    }
}

impl<M> Literal for Signal<M> {
    fn expression(&self, out: &mut String) {
        call(out, "::fusion_core::state::Signal::from_literal", &[&self.storage, &self.tangent]);
    }
}

impl<M: Manifold<Value: Literal>> Literal for Quantity<M> {
    fn expression(&self, out: &mut String) {
        match self {
            Self::Fixed(value) => call(out, "::fusion_core::state::Quantity::Fixed", &[value]),
            Self::State(slot) => call(out, "::fusion_core::state::Quantity::State", &[slot]),
            Self::Signal(signal) => call(out, "::fusion_core::state::Quantity::Signal", &[signal]),
        }
    }
}

impl<M: ExactModel> Literal for Exact<M> {
    fn expression(&self, out: &mut String) {
        out.push_str("::fusion_core::model::Exact(");
        if let Some(model) = self.0.literal() {
            model.expression(out);
        }
        out.push(')');
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Literal;
    use crate::state::Scalar;
    use alloc::string::ToString;
    use nalgebra::Matrix1x2;

    fn expression(value: &dyn Literal) -> String {
        let mut text = String::new();
        value.expression(&mut text);
        text.replace("::fusion_core::model::literal::tests::", "")
    }

    /// A field may have the name of a variable of the derived function.
    #[derive(Literal)]
    struct Named {
        out: bool,
        list: Vec<u8>,
    }

    #[derive(Literal)]
    struct Tuple<T>(T, [i64; 2]);

    #[derive(Literal)]
    struct Marker;

    #[derive(Literal)]
    #[literal(at = "elsewhere", core = crate)]
    enum Choice {
        None,
        One(Marker),
        Several { out: usize, of: usize },
    }

    #[test]
    fn structs_call_their_constructor_and_variants_are_named() {
        let named = Named {
            out: true,
            list: vec![1, 2],
        };
        assert_eq!(expression(&named), "Named::from_literal(true, ::alloc::vec![1, 2])");
        let same = Named::from_literal(true, vec![1, 2]);
        assert!(same.out == named.out && same.list == named.list);
        assert_eq!(
            expression(&Tuple("a", [-1, i64::MIN])),
            "Tuple::from_literal(\"a\", [-1, -9223372036854775808])"
        );
        assert_eq!(expression(&Marker), "Marker");
        assert_eq!(expression(&Choice::None), "::elsewhere::Choice::None");
        assert_eq!(expression(&Choice::One(Marker)), "::elsewhere::Choice::One(Marker)");
        let several = Choice::Several { out: 1, of: 2 };
        assert_eq!(expression(&several), "::elsewhere::Choice::Several { out: 1, of: 2, }");
    }

    #[test]
    fn numbers_keep_their_bits() {
        assert_eq!(expression(&-0.0), "f64::from_bits(0x8000000000000000)");
        assert_eq!(expression(&f64::INFINITY), "f64::from_bits(0x7ff0000000000000)");
        assert_eq!(expression(&f64::from_bits(1)), "f64::from_bits(0x0000000000000001)");
    }

    #[test]
    fn paths_of_values_begin_at_crates() {
        let time = Time::from_nanos(-3);
        assert_eq!(expression(&time), "::fusion_core::Time::from_nanos(-3)");
        assert_eq!(expression(&Some((1_u8, None::<bool>, "a\""))), "Some((1, None, \"a\\\"\"))");
        assert_eq!(
            expression(&Box::new("a".to_string())),
            "::alloc::boxed::Box::new(::alloc::string::String::from(\"a\"))"
        );
        assert_eq!(
            expression(&VecDeque::from([1, 2])),
            "::alloc::collections::VecDeque::from(::alloc::vec![1, 2])"
        );
        let slot = Quantity::State(Slot::<Scalar>::from_literal(7, 6));
        assert_eq!(
            expression(&slot),
            "::fusion_core::state::Quantity::State(::fusion_core::state::Slot::from_literal(7, 6))"
        );
        // Column by column.
        let numbers = "[[f64::from_bits(0x3ff0000000000000)], [f64::from_bits(0x4000000000000000)]]";
        let matrix = format!("::nalgebra::SMatrix::from_array_storage(::nalgebra::ArrayStorage({numbers}))");
        assert_eq!(expression(&Matrix1x2::new(1.0, 2.0)), matrix);
    }
}
