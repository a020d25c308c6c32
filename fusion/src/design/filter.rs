//! `[filter]`: the backend, as a preset or by its axes.

use super::choice::{ChartSpec, Choice, FormSpec, UpdateSpec, duplicate, words};
use crate::config::{Diagnostic, Diagnostics, Node, did_you_mean};
use fusion_core::chart::{Biases, Chart, Reset, Side};
use fusion_core::covariance::{Form, FormKind, Kernel};
use fusion_core::filter::{Backend, BankLimits, ChartKind, Iterated, SigmaSpread, UpdateKind, UpdateRule};
use fusion_core::state::{Kind, Layout, StateRole};
use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::StrDeserializer;

/// The backend: a preset, or its axes one by one.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FilterSpec {
    /// A preset of the axes below. An axis that is declared too replaces that of the preset.
    pub backend: Option<PresetSpec>,
    /// The error coordinates that the covariance refers to.
    pub chart: Option<Choice<dyn Chart>>,
    /// How an invariant chart treats vectors in body axes, such as the biases of inertial sensors.
    pub biases: Option<BiasesSpec>,
    /// How a measurement is linearised.
    pub update: Option<Choice<dyn UpdateRule>>,
    /// The most steps of an iterated update, at least 1; 10 by default.
    pub iterations: Option<u16>,
    /// An iterated update ends when a step is shorter than this many σ of the estimate given the
    /// measurement; 0.001 by default.
    pub tolerance: Option<f64>,
    /// How far the sigma points of an unscented update are from the estimate.
    pub spread: Option<SpreadSpec>,
    /// How the covariance is stored and kept positive.
    pub form: Option<Choice<dyn Form>>,
    /// How the covariance changes when a correction moves the state.
    pub reset: Option<ResetSpec>,
    /// Calibrations get only a share 1/k² of the corrections by a sensor whose NIS is k² times its expectation, beyond
    /// chance. It is for receivers with large errors after their start. If the state is wrong and not the sensor,
    /// calibrations converge later.
    #[serde(default)]
    pub protect_calibrations: bool,
    /// Keeps several hypotheses until the data decide between them: for sensors whose gate is `hypotheses`, and
    /// for starts without a heading.
    pub bank: Option<BankSpec>,
    /// The kernel that computes, if a run selects one. It is not part of a design: a design runs on every machine.
    #[serde(skip)]
    pub kernel: Option<Kernel>,
}

/// A bank of hypotheses.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BankSpec {
    /// The most hypotheses, 1 to 100; 20 by default.
    pub hypotheses: usize,
    /// The number of headings, in even steps over the full circle, that a start tries if its heading is hardly
    /// known; 1 by default. The start turns the attitude, or the first estimated angle that is as uncertain.
    pub headings: usize,
    /// The displayed hypothesis changes if another one is this many times as probable; 1e6 by default.
    pub switch: f64,
}

impl Default for BankSpec {
    fn default() -> Self {
        let limits = BankLimits::DEFAULT;
        Self {
            hypotheses: limits.most,
            headings: limits.starts,
            switch: limits.switch,
        }
    }
}

impl BankSpec {
    /// The limits of the bank.
    #[must_use]
    pub fn limits(self) -> BankLimits {
        BankLimits {
            most: self.hypotheses,
            starts: self.headings,
            switch: self.switch,
            ..BankLimits::DEFAULT
        }
    }
}

/// Named backends.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PresetSpec {
    /// Additive Euler angles, single update, Joseph form: the classical EKF.
    Ekf,
    /// Body-frame error, single update, Joseph form.
    ErrorState,
    /// Body-frame error, iterated update, Joseph form.
    Iekf,
    /// Right-invariant error, single update, Joseph form.
    Invariant,
    /// Body-frame error, sigma points for prediction and update.
    Ukf,
}

/// Biases under an invariant chart.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BiasesSpec {
    /// Their errors are not part of the group: the imperfect extension.
    Imperfect,
    /// Their errors are part of the group: the two-frames group.
    TwoFrames,
}

/// The scaled set of sigma points: α√(n + κ) σ from the estimate.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SpreadSpec {
    /// α, greater than 0.
    pub alpha: f64,
    /// β, at least α²; 2 is best for a Gaussian.
    pub beta: f64,
    /// κ, not negative.
    pub kappa: f64,
}

impl Default for SpreadSpec {
    fn default() -> Self {
        let SigmaSpread { alpha, beta, kappa } = SigmaSpread::DEFAULT;
        Self { alpha, beta, kappa }
    }
}

/// How P changes at a correction.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum ResetSpec {
    /// P in the coordinates of the chart stays as it is.
    Plain,
    /// It is carried by the Jacobian of the chart's retraction; an iterated update always does so.
    Full,
}

/// A mistake of `[filter]`: the key it is in, what is wrong, and what to do.
struct Mistake(&'static str, String, &'static str);

impl FilterSpec {
    /// Returns true if each measurement is linearised once, at a single estimate.
    #[must_use]
    pub fn linearises_once(&self) -> bool {
        matches!(self.backend().update, UpdateKind::Single) && self.bank.is_none_or(|bank| bank.headings <= 1)
    }

    /// The backend declared: the preset, with each axis that is named put in its place.
    #[must_use]
    pub fn backend(&self) -> Backend {
        let mut backend = match self.backend {
            Some(PresetSpec::Ekf) => Backend::EKF,
            Some(PresetSpec::ErrorState) | None => Backend::ERROR_STATE,
            Some(PresetSpec::Iekf) => Backend::IEKF,
            Some(PresetSpec::Invariant) => Backend::INVARIANT,
            Some(PresetSpec::Ukf) => Backend::UKF,
        };
        if let Some(chart) = self.chart {
            use Choice::{BuiltIn, Custom};
            backend.chart = match chart {
                Custom(chart) => ChartKind::Custom(chart),
                BuiltIn(ChartSpec::AdditiveEuler) => ChartKind::AdditiveEuler,
                BuiltIn(ChartSpec::AdditiveQuaternion) => ChartKind::AdditiveQuaternion,
                BuiltIn(ChartSpec::Body) => ChartKind::Body,
                BuiltIn(ChartSpec::Navigation) => ChartKind::Navigation,
                BuiltIn(ChartSpec::RightInvariant) => ChartKind::Invariant(Side::Right, Biases::Imperfect),
                BuiltIn(ChartSpec::LeftInvariant) => ChartKind::Invariant(Side::Left, Biases::Imperfect),
            };
        }
        if let (ChartKind::Invariant(_, biases), Some(BiasesSpec::TwoFrames)) = (&mut backend.chart, self.biases) {
            *biases = Biases::TwoFrames;
        }
        if let Some(update) = self.update {
            backend.update = match update {
                Choice::BuiltIn(UpdateSpec::Single) => UpdateKind::Single,
                Choice::BuiltIn(UpdateSpec::Iterated) => UpdateKind::Iterated(Iterated::DEFAULT),
                Choice::BuiltIn(UpdateSpec::Unscented) => UpdateKind::Unscented(SigmaSpread::DEFAULT),
                Choice::BuiltIn(UpdateSpec::Outright) => UpdateKind::Outright,
                Choice::Custom(rule) => UpdateKind::Custom(rule),
            };
        }
        match &mut backend.update {
            UpdateKind::Single | UpdateKind::Outright | UpdateKind::Custom(_) => {}
            UpdateKind::Iterated(rule) => {
                rule.iterations = self.iterations.unwrap_or(rule.iterations);
                rule.tolerance = self.tolerance.unwrap_or(rule.tolerance);
            }
            UpdateKind::Unscented(spread) => {
                let SpreadSpec { alpha, beta, kappa } = self.spread.unwrap_or_default();
                *spread = SigmaSpread { alpha, beta, kappa };
            }
        }
        backend.protection = self.protect_calibrations;
        if let Some(form) = self.form {
            backend.form = match form {
                Choice::BuiltIn(FormSpec::Joseph) => FormKind::Joseph,
                Choice::BuiltIn(FormSpec::Standard) => FormKind::Standard,
                Choice::BuiltIn(FormSpec::Udu) => FormKind::Udu,
                Choice::BuiltIn(FormSpec::SquareRoot) => FormKind::SquareRoot,
                Choice::Custom(form) => FormKind::Custom(form),
            };
        }
        if let UpdateKind::Iterated(_) = backend.update {
            backend.reset = Reset::Full;
        }
        match self.reset {
            Some(ResetSpec::Plain) => backend.reset = Reset::Plain,
            Some(ResetSpec::Full) => backend.reset = Reset::Full,
            None => {}
        }
        backend.kernel = self.kernel;
        backend
    }

    /// The backend in the words of TOML: `body / single / joseph`, then the other settings that are not the default.
    #[must_use]
    pub fn backend_name(&self) -> String {
        let backend = self.backend();
        let chart = match backend.chart {
            ChartKind::AdditiveEuler => "additive_euler",
            ChartKind::AdditiveQuaternion => "additive_quaternion",
            ChartKind::Body => "body",
            ChartKind::Navigation => "navigation",
            ChartKind::Invariant(Side::Right, _) => "right_invariant",
            ChartKind::Invariant(Side::Left, _) => "left_invariant",
            ChartKind::Custom(chart) => chart.name,
        };
        let update = match backend.update {
            UpdateKind::Single => "single",
            UpdateKind::Iterated(_) => "iterated",
            UpdateKind::Unscented(_) => "unscented",
            UpdateKind::Outright => "outright",
            UpdateKind::Custom(rule) => rule.name,
        };
        let mut words = vec![chart, update, backend.form.form().name()];
        if matches!(backend.chart, ChartKind::Invariant(_, Biases::TwoFrames)) {
            words.push("two_frames");
        }
        if backend.reset == Reset::Full && !matches!(backend.update, UpdateKind::Iterated(_)) {
            words.push("full reset");
        }
        if let Some(bank) = self.bank {
            words.push(if bank.headings > 1 { "bank of starts" } else { "bank" });
        }
        words.join(" / ")
    }

    /// The table `[filter]` for a backend named on the command line, such as `ekf` or `invariant+iterated`: a
    /// preset and any axes, each by its own word.
    ///
    /// # Errors
    /// A word that does not name a backend or an axis, with the word that was probably meant.
    pub fn table_of(words: &str) -> Result<String, Diagnostic> {
        let mut keys = Vec::new();
        for word in words.split('+').map(str::trim) {
            let Some(key) = key_of(word) else {
                let known = names();
                let message = format!("`{word}` is not a backend, a chart, an update or a form");
                let near =
                    did_you_mean(word, &known.iter().map(String::as_str).collect::<Vec<_>>()).map(|near| format!("did you mean `{near}`?"));
                let help = near.unwrap_or_else(|| format!("there are {}", known.join(", ")));
                return Err(Diagnostic::error(message).help(help));
            };
            keys.push(format!("{key} = \"{word}\""));
        }
        Ok(format!("filter={{ {} }}", keys.join(", ")))
    }

    /// Reads the table. If `backend` names a chart, an update or a form, the message shows its right key.
    pub(super) fn of(node: &Node, d: &mut Diagnostics) -> Option<Self> {
        let named = node.get("backend").and_then(|backend| Some((backend, backend.as_str()?)));
        let Some((backend, word, key)) = named
            .and_then(|(backend, word)| Some((backend, word, key_of(word)?)))
            .filter(|(.., key)| *key != "backend")
        else {
            return node.read(d);
        };
        let message = format!("`{word}` is no named backend, but what `filter.{key}` may be");
        let help = format!("write `filter.{key} = \"{word}\"`; a `backend` next to it gives the rest");
        d.push(Diagnostic::error(message).at(backend.place()).help(help));
        None
    }

    /// Reports a contradiction within the table.
    pub(super) fn check(&self, node: &Node, d: &mut Diagnostics) {
        if let Some(name) = duplicate() {
            let error = Diagnostic::error(format!("two charts, updates or forms of the linked crates are called `{name}`"));
            d.push(error.at(node.place()).help("give one of them another name where it is registered"));
        }
        if let Some(mistake) = self.contradiction() {
            mistake.tell(Some(node), node, d);
        }
    }

    fn contradiction(&self) -> Option<Mistake> {
        let backend = self.backend();
        let is_invariant = matches!(backend.chart, ChartKind::Invariant(..));
        let (is_iterated, is_unscented) = (
            matches!(backend.update, UpdateKind::Iterated(_)),
            matches!(backend.update, UpdateKind::Unscented(_)),
        );
        let mistake = |key, message: &str, help| Some(Mistake(key, message.to_owned(), help));
        if self.biases.is_some() && !is_invariant {
            return mistake(
                "biases",
                "`biases` belongs to an invariant chart",
                "add `chart = \"right_invariant\"`, or leave it out",
            );
        }
        if self.iterations.is_some() && !is_iterated {
            return mistake(
                "iterations",
                "`iterations` belongs to the iterated update",
                "add `update = \"iterated\"`, or leave it out",
            );
        }
        if self.tolerance.is_some() && !is_iterated {
            return mistake(
                "tolerance",
                "`tolerance` belongs to the iterated update",
                "add `update = \"iterated\"`, or leave it out",
            );
        }
        if self.spread.is_some() && !is_unscented {
            return mistake(
                "spread",
                "`spread` belongs to the unscented update",
                "add `update = \"unscented\"`, or leave it out",
            );
        }
        if self.protect_calibrations && matches!(backend.update, UpdateKind::Outright) {
            return mistake(
                "protect_calibrations",
                "an `outright` update has no covariance, and protects nothing",
                "take another `update`, or leave it out",
            );
        }
        if self.iterations == Some(0) {
            return mistake("iterations", "an update takes at least 1 step", "10 are usual");
        }
        if self.tolerance.is_some_and(|t| !(t.is_finite() && t >= 0.0)) {
            return mistake("tolerance", "must be finite and at least 0", "0.001 is usual: a thousandth of a σ");
        }
        if let Some(SpreadSpec { alpha, beta, kappa }) = self.spread {
            // n + κ > 0 for every n, and no negative variance.
            let is_sound =
                alpha > 0.0 && alpha.is_finite() && kappa >= 0.0 && kappa.is_finite() && beta >= alpha * alpha && beta.is_finite();
            if !is_sound {
                let message = format!("alpha = {alpha}, beta = {beta}, kappa = {kappa} may give a negative variance");
                return mistake(
                    "spread",
                    &message,
                    "take alpha > 0, beta ≥ alpha², kappa ≥ 0; alpha = 1, beta = 2, kappa = 0 are usual",
                );
            }
        }
        if let Some(BankSpec {
            hypotheses,
            headings,
            switch,
        }) = self.bank
        {
            if !(1..=100).contains(&hypotheses) {
                return mistake("bank", "a bank has 1 to 100 hypotheses", "write e.g. `hypotheses = 20`");
            }
            if headings == 0 || headings > hypotheses {
                let message = format!("a bank of {hypotheses} hypotheses cannot begin with {headings} headings, a hypothesis each");
                return mistake("bank", &message, "write `headings` from 1 to `hypotheses`");
            }
            if !(switch >= 1.0 && switch.is_finite()) {
                return mistake(
                    "bank",
                    "`switch` must be at least 1: how many times as probable another hypothesis must be to be shown instead",
                    "1e6 is usual",
                );
            }
        }
        if is_iterated && self.reset == Some(ResetSpec::Plain) {
            return mistake(
                "reset",
                "an iterated update always carries the covariance by the full reset",
                "leave `reset` out",
            );
        }
        if is_unscented && backend.form == FormKind::Standard {
            let help = "leave `form` out: sigma points need no form that holds for one gain only";
            return mistake("form", "`standard` has no meaning for sigma points", help);
        }
        None
    }

    /// Reports entries of the table that have no meaning for the states of `layout`. `node` is the table; without
    /// a table, the message points to `otherwise`.
    pub(crate) fn check_layout(&self, layout: &Layout, node: Option<&Node>, otherwise: &Node, d: &mut Diagnostics) {
        let ChartKind::Invariant(_, biases) = self.backend().chart else {
            return;
        };
        let key = if self.chart.is_some() { "chart" } else { "backend" };
        let has = |is: fn(Kind) -> bool| layout.blocks().iter().any(|b| b.role == StateRole::Kinematic && is(b.kind));
        let mistake = if !has(|k| matches!(k, Kind::Attitude | Kind::Angle)) {
            let message = "an invariant chart needs an attitude or a heading, and this process has neither";
            Mistake(key, message.to_owned(), "leave it out: all states of this process are additive")
        } else if biases == Biases::TwoFrames && !layout.blocks().iter().any(fusion_core::state::Block::is_in_body_axes) {
            let message = "there is no estimated bias in body axes to belong to the two-frames group";
            Mistake(
                "biases",
                message.to_owned(),
                "leave `biases` out, or estimate a bias of the gyros or accelerometers",
            )
        } else {
            return;
        };
        mistake.tell(node, otherwise, d);
    }
}

impl Mistake {
    fn tell(self, node: Option<&Node>, otherwise: &Node, d: &mut Diagnostics) {
        let Self(key, message, help) = self;
        let place = node.map_or(otherwise.name_place(), |node| node.get(key).unwrap_or(node).place());
        d.push(Diagnostic::error(message).at(place).help(help));
    }
}

/// Whether `word` is a value of the enumeration `T`.
fn is<'de, T: Deserialize<'de>>(word: &'de str) -> bool {
    let deserializer: StrDeserializer<'de, serde::de::value::Error> = word.into_deserializer();
    T::deserialize(deserializer).is_ok()
}

/// The key of `[filter]` that a word is a value of.
fn key_of(word: &str) -> Option<&'static str> {
    let kinds = [
        ("backend", is::<PresetSpec>(word)),
        ("chart", is::<Choice<dyn Chart>>(word)),
        ("biases", is::<BiasesSpec>(word)),
        ("update", is::<Choice<dyn UpdateRule>>(word)),
        ("form", is::<Choice<dyn Form>>(word)),
        ("reset", is::<ResetSpec>(word)),
    ];
    kinds.into_iter().find(|(_, is_one)| *is_one).map(|(key, _)| key)
}

/// Every word that [`FilterSpec::table_of`] takes.
fn names() -> Vec<String> {
    let schemas = [
        schemars::schema_for!(PresetSpec),
        schemars::schema_for!(Choice<dyn Chart>),
        schemars::schema_for!(BiasesSpec),
        schemars::schema_for!(Choice<dyn UpdateRule>),
        schemars::schema_for!(Choice<dyn Form>),
        schemars::schema_for!(ResetSpec),
    ];
    schemas.iter().flat_map(words).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Document;

    #[test]
    fn a_chart_that_is_named_as_a_backend_is_told_by_its_key() {
        let of = |text: &str| {
            let mut d = Diagnostics::new();
            let is_read = FilterSpec::of(Document::parse("test", text).0.root(), &mut d).is_some();
            (is_read, d.render(false))
        };
        let (is_read, told) = of("backend = 'left_invariant'\nupdate = 'iterated'");
        assert!(!is_read && told.contains("write `filter.chart = \"left_invariant\"`"), "{told}");
        assert!(of("backend = 'iterated'").1.contains("`filter.update = \"iterated\"`"));
        let (is_read, told) = of("backend = 'invariant'");
        assert!(is_read && told.is_empty(), "{told}");
        assert!(of("backend = 'left'").1.contains("unknown name"));
    }
}
