//! Robust losses as TOML declares them.

#![cfg(feature = "declare")]

use crate::block::{BuildError, LossSpec};
use crate::de::DeserializeSpec;
use crate::units::{Positive, dim};
use fusion_core::loss::{Cauchy, Huber, Loss, Quadratic, StudentT};
use schemars::JsonSchema;

fn constant(value: f64) -> Positive<dim::Ratio> {
    Positive::try_from_si(value).unwrap_or_else(|_| unreachable!("defaults are positive"))
}

/// Least squares: every accepted measurement has full weight.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QuadraticSpec {}

crate::register!(Loss, "quadratic", QuadraticSpec, "");

#[typetag::deserialize(name = "quadratic")]
impl LossSpec for QuadraticSpec {
    fn build(&self) -> Result<Box<dyn Loss>, BuildError> {
        Ok(Box::new(Quadratic))
    }
}

/// Huber: quadratic near zero, linear from `k` standard deviations.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HuberSpec {
    /// Where the loss becomes linear, for a residual of one row; 1.345 gives 95 % efficiency. Of more
    /// rows, where as large a share of good measurements lies.
    #[serde(default = "huber_k")]
    k: Positive<dim::Ratio>,
}

fn huber_k() -> Positive<dim::Ratio> {
    constant(1.345)
}

crate::register!(Loss, "huber", HuberSpec, "k = 1.345");

#[typetag::deserialize(name = "huber")]
impl LossSpec for HuberSpec {
    fn build(&self) -> Result<Box<dyn Loss>, BuildError> {
        Ok(Box::new(Huber::new(self.k.si())))
    }
}

/// Cauchy: weights fall with the square of the residual.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CauchySpec {
    /// Scale in standard deviations of a residual of one row; 2.385 gives 95 % efficiency. Of more
    /// rows, where as large a share of good measurements lies.
    #[serde(default = "cauchy_c")]
    c: Positive<dim::Ratio>,
}

fn cauchy_c() -> Positive<dim::Ratio> {
    constant(2.385)
}

crate::register!(Loss, "cauchy", CauchySpec, "c = 2.385");

#[typetag::deserialize(name = "cauchy")]
impl LossSpec for CauchySpec {
    fn build(&self) -> Result<Box<dyn Loss>, BuildError> {
        Ok(Box::new(Cauchy::new(self.c.si())))
    }
}

/// Student-t: the weight of a heavy-tailed noise of `nu` degrees of freedom.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StudentTSpec {
    /// Degrees of freedom.
    #[serde(default = "student_nu")]
    nu: Positive<dim::Ratio>,
}

fn student_nu() -> Positive<dim::Ratio> {
    constant(4.0)
}

crate::register!(Loss, "student_t", StudentTSpec, "nu = 4");

#[typetag::deserialize(name = "student_t")]
impl LossSpec for StudentTSpec {
    fn build(&self) -> Result<Box<dyn Loss>, BuildError> {
        Ok(Box::new(StudentT { nu: self.nu.si() }))
    }
}
