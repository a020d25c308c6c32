//! Belief and layout as data for other programs, by serde.
//!
//! A covariance is written as the matrix P, with the name of its form. Stored again in a
//! factored form, it is the same up to rounding. A run that must continue bit for bit needs a checkpoint
//! ([`memory`](crate::memory)). The input that led to the belief is not written.

use super::Belief;
use crate::covariance::{Covariance, FormKind};
use crate::model::LastInput;
use crate::state::{Block, Layout, StateRole};
use crate::time::Time;
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A belief as it is written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenBelief {
    time_ns: i64,
    x: Vec<f64>,
    form: String,
    /// P, row by row.
    covariance: Vec<Vec<f64>>,
}

/// `time_ns`, `x` in storage order, `form`, and `covariance` as rows of P in the canonical chart.
impl Serialize for Belief {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let n = self.covariance.dim();
        let dense = self.covariance.to_dense();
        let written = WrittenBelief {
            time_ns: self.time.nanos(),
            x: self.x.clone(),
            form: self.covariance.form().name().to_owned(),
            covariance: dense.chunks(n.max(1)).map(<[f64]>::to_vec).collect(),
        };
        written.serialize(serializer)
    }
}

/// Refuses a form of another crate, rows that make no square, and what [is not sound](Belief::is_sound).
impl<'de> Deserialize<'de> for Belief {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let written = WrittenBelief::deserialize(deserializer)?;
        let n = written.covariance.len();
        if let Some(row) = written.covariance.iter().position(|row| row.len() != n) {
            let found = written.covariance[row].len();
            return Err(D::Error::custom(format!(
                "row {row} of the covariance has {found} numbers, there are {n} rows"
            )));
        }
        let Some(form) = FormKind::named(&written.form) else {
            return Err(D::Error::custom(format!("`{}` is no form of a covariance here", written.form)));
        };
        let mut covariance = Covariance::zeros(n, form.form());
        covariance.set_whole(&written.covariance.concat());
        let belief = Self {
            time: Time::from_nanos(written.time_ns),
            x: written.x,
            covariance,
            input: LastInput::default(),
        };
        if belief.is_sound() {
            Ok(belief)
        } else {
            Err(D::Error::custom(
                "the belief has a value that is not a number, or a negative variance",
            ))
        }
    }
}

/// A block as it is written.
#[derive(Serialize)]
struct WrittenBlock<'a> {
    name: &'a str,
    owner: &'a str,
    kind: &'static str,
    role: &'static str,
    unit: &'static str,
    /// Its first number in `x`, and how many.
    storage: [usize; 2],
    /// Its first row of the covariance, and how many.
    tangent: [usize; 2],
    sigma: &'a [f64],
}

impl<'a> WrittenBlock<'a> {
    fn of(block: &'a Block) -> Self {
        Self {
            name: &block.name,
            owner: &block.owner,
            kind: block.kind.name(),
            role: role(block.role),
            unit: block.unit,
            storage: [block.storage, block.kind.storage()],
            tangent: [block.tangent, block.kind.dim()],
            sigma: &block.sigma,
        }
    }
}

/// `blocks`, in order: name, owner, kind, role, unit, `storage` and `tangent` (first and count), and the
/// initial `sigma`.
impl Serialize for Layout {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let blocks: Vec<_> = self.blocks().iter().map(WrittenBlock::of).collect();
        serializer.collect_map([("blocks", blocks)])
    }
}

const fn role(role: StateRole) -> &'static str {
    match role {
        StateRole::Kinematic => "kinematic",
        StateRole::Calibration => "calibration",
        StateRole::Nuisance => "nuisance",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::tests::declare;
    use crate::state::{Attitude, Dynamics, LayoutBuilder, Position};
    use nalgebra::{UnitQuaternion, Vector3};

    fn layout() -> Layout {
        let mut b = LayoutBuilder::new();
        declare::<Position>(
            &mut b,
            "position",
            Vector3::new(1.0, 2.0, 1e-300),
            &[1.0, 2.0, 0.1],
            Dynamics::Process,
        );
        let turned = UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3);
        declare::<Attitude>(&mut b, "attitude", turned, &[0.1; 3], Dynamics::Process);
        b.finish()
    }

    #[test]
    fn a_belief_that_was_written_is_read_again() {
        for kind in [FormKind::Joseph, FormKind::Udu, FormKind::SquareRoot] {
            let belief = Belief::initial(&layout(), &kind.form(), Time::from_nanos(-3));
            let read: Belief = serde_json::from_str(&serde_json::to_string(&belief).unwrap()).unwrap();
            assert_eq!((read.time, &read.x), (belief.time, &belief.x));
            let pairs = read.covariance.to_dense().into_iter().zip(belief.covariance.to_dense());
            let difference = pairs.map(|(a, b)| (a - b).abs());
            // A whole P has the same bits; factors are made of it again: rounding.
            let most = if kind == FormKind::Joseph { 0.0 } else { 1e-15 };
            assert!(difference.fold(0.0, f64::max) <= most, "{kind:?}");
        }
    }

    #[test]
    fn what_is_no_belief_is_refused_with_its_reason() {
        let refused = |text: &str, wanted: &str| {
            let told = serde_json::from_str::<Belief>(text).unwrap_err().to_string();
            assert!(told.contains(wanted), "{told}");
        };
        refused(
            r#"{"time_ns": 0, "x": [1.0], "form": "joseph", "covariance": [[1.0, 0.0]]}"#,
            "row 0 of the covariance has 2 numbers, there are 1 rows",
        );
        refused(
            r#"{"time_ns": 0, "x": [1.0], "form": "magic", "covariance": [[1.0]]}"#,
            "`magic` is no form",
        );
        refused(
            r#"{"time_ns": 0, "x": [1.0], "form": "joseph", "covariance": [[-1.0]]}"#,
            "negative variance",
        );
    }

    #[test]
    fn a_layout_says_where_each_block_is() {
        let written: serde_json::Value = serde_json::to_value(layout()).unwrap();
        let attitude = &written["blocks"][1];
        assert_eq!((&attitude["name"], &attitude["kind"]), (&"attitude".into(), &"attitude".into()));
        assert_eq!(
            (&attitude["storage"], &attitude["tangent"]),
            (&serde_json::json!([3, 4]), &serde_json::json!([3, 3]))
        );
    }
}
