//! The faults of a case, drawn by its number, as `--set` adds them to the design.

use super::super::cases::{Target, digits, scale, seconds, sized, targets, unit};
use super::super::catalogue::Catalogue;
use super::super::survey::Survey;
use super::Case;
use fusion::assembly::Assembly;
use fusion::config::{Diagnostic, Diagnostics};
use fusion::design::Design;
use fusion_core::math;
use fusion_core::time::{Time, nanos};
use fusion_models::block::{Channel, Shape};
use fusion_models::fault::derive_seed;
use fusion_models::units::{Dimension, Dimensional, dim};

/// A kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum Kind {
    Scale,
    Unit,
    Sign,
    Swap,
    Step,
    Ramp,
    Noise,
    Freeze,
    Gap,
    Delay,
    Stamp,
    Duplicate,
}

impl Kind {
    pub(in super::super) const ALL: [Self; 12] = [
        Self::Scale,
        Self::Unit,
        Self::Sign,
        Self::Swap,
        Self::Step,
        Self::Ramp,
        Self::Noise,
        Self::Freeze,
        Self::Gap,
        Self::Delay,
        Self::Stamp,
        Self::Duplicate,
    ];

    /// As it is shown and asked for.
    pub(in super::super) const fn word(self) -> &'static str {
        match self {
            Self::Scale => "scale",
            Self::Unit => "unit",
            Self::Sign => "sign",
            Self::Swap => "swap",
            Self::Step => "step",
            Self::Ramp => "ramp",
            Self::Noise => "noise",
            Self::Freeze => "freeze",
            Self::Gap => "gap",
            Self::Delay => "delay",
            Self::Stamp => "stamp",
            Self::Duplicate => "duplicate",
        }
    }

    /// Whether it disturbs whole rows; else one channel.
    const fn is_of_rows(self) -> bool {
        matches!(self, Self::Freeze | Self::Gap | Self::Delay | Self::Stamp | Self::Duplicate)
    }

    /// Whether it can be done to a channel with this 1σ.
    fn fits(self, channel: &Channel, scale: &[f64]) -> bool {
        match self {
            Self::Scale | Self::Unit | Self::Sign => matches!(channel.shape, Shape::Vector | Shape::Angle),
            Self::Swap => channel.width > 1,
            _ => scale.iter().all(|s| s.is_finite()) && scale.iter().any(|s| *s > 0.0),
        }
    }
}

/// A kind of fault on a stream, or on a channel of it.
#[derive(Clone, Debug)]
struct Choice {
    kind: Kind,
    stream: usize,
    on: String,
    /// The path of the table of faults of the stream.
    path: String,
    /// The channel and its scale per axis.
    channel: Option<(Channel, Vec<f64>)>,
    /// From, to, in multiples of the scale.
    size: [f64; 2],
    factor: [f64; 2],
    /// From, to \[s\].
    delay: [f64; 2],
}

/// Numbers that depend on a seed and on what is drawn.
#[derive(Clone, Copy, Debug)]
struct Draws(u64);

impl Draws {
    /// From 0 to 1.
    fn share(self, what: &str) -> f64 {
        // 53 bits.
        (derive_seed(self.0, &[what]) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(self, what: &str, [from, to]: [f64; 2]) -> f64 {
        from + self.share(what) * (to - from)
    }

    /// A decade is as likely as another.
    fn size(self, what: &str, [from, to]: [f64; 2]) -> f64 {
        from * math::powf(to / from, self.share(what))
    }

    fn index(self, what: &str, count: usize) -> usize {
        usize::try_from(derive_seed(self.0, &[what]) % count.max(1) as u64).unwrap_or(0)
    }

    fn one(self, what: &str, of: &[f64]) -> f64 {
        of.get(self.index(what, of.len())).copied().unwrap_or(1.0)
    }
}

/// All that may be drawn.
#[derive(Debug)]
pub(super) struct Lot<'a> {
    survey: &'a Survey,
    choices: Vec<Choice>,
    /// When the first fault may begin, and the last one has to have ended.
    pub(super) from: Time,
    pub(super) to: Time,
    /// From, to \[s\].
    lasts: [f64; 2],
    together: usize,
    /// Good data after the last fault \[s\].
    pub(super) left: f64,
    /// Whether the log is long enough for what is asked for.
    pub(super) is_whole: bool,
    seed: u64,
}

impl<'a> Lot<'a> {
    pub(super) fn new(
        design: &Design,
        assembly: &Assembly,
        catalogue: &Catalogue,
        survey: &'a Survey,
        seed: u64,
    ) -> Result<Self, Diagnostics> {
        let limits = &catalogue.draw;
        let choices: Vec<Choice> = targets(design, assembly)
            .iter()
            .flat_map(|target| choices(design, assembly, catalogue, survey, target))
            .collect();
        let (started, end) = (survey.started.unwrap_or_default(), survey.judged_end());
        // A log that is too short is shared out: the beginning has a quarter at most, the end half of the rest.
        let whole = end.seconds_since(started).max(0.0);
        let from = started.shifted(nanos(catalogue.settle.min(0.25 * whole)));
        let rest = end.seconds_since(from).max(0.0);
        let is_whole = catalogue.settle <= 0.25 * whole && limits.left + limits.lasts[1] <= rest;
        let left = if is_whole { limits.left } else { limits.left.min(0.5 * rest) };
        let longest = limits.lasts[1].min(rest - left);
        if choices.is_empty() || longest <= 0.0 {
            let message = "there is nothing to draw: no fault fits a stream that the filter reads, or there is no time for one";
            return Err(Diagnostic::error(message).into());
        }
        Ok(Self {
            survey,
            choices,
            from,
            to: end.shifted(-nanos(left)),
            lasts: [limits.lasts[0].min(longest), longest],
            together: limits.together,
            left,
            is_whole,
            seed,
        })
    }

    /// From the end of the faults of a case to that of what can be judged \[s\].
    pub(super) fn seconds_left(&self, case: &Case) -> f64 {
        self.survey.judged_end().seconds_since(case.to).max(0.0)
    }

    /// The case of this number, and the kinds of its faults.
    pub(super) fn case(&self, number: u64) -> (Vec<&'static str>, Case) {
        let draws = Draws(derive_seed(self.seed, &["draw", &number.to_string()]));
        let mut case = Case::quiet(Time::MAX, Time::MIN);
        let (mut taken, mut first): (Vec<usize>, Option<(Time, f64)>) = (Vec::new(), None);
        let (mut faults, mut on, mut sizes) = (Vec::new(), Vec::new(), Vec::new());
        for part in 0..=draws.index("together", self.together) {
            let draws = Draws(derive_seed(draws.0, &["fault", &part.to_string()]));
            let lasts = draws.between("lasts", self.lasts);
            // Later ones begin while the first is at work.
            let (since, span) = first.unwrap_or((self.from, self.to.seconds_since(self.from) - lasts));
            let from = millis(since.shifted(nanos(draws.share("from") * span.max(0.0))));
            let to = millis(from.shifted(nanos(lasts))).min(self.to);
            first.get_or_insert((from, to.seconds_since(from)));
            let Some(number) = self.choose(draws, &taken, from, to) else {
                break;
            };
            taken.push(number);
            let choice = &self.choices[number];
            let (fields, size) = choice.fault(draws, to.seconds_since(from));
            let window = format!("window = {{ from = {}, to = {} }}", seconds(from), seconds(to));
            case.sets
                .push(format!("{}.drawn-{}={{ {fields}, {window} }}", choice.path, part + 1));
            case.from = case.from.min(from);
            case.to = case.to.max(to);
            if choice.kind == Kind::Stamp {
                case.streams.push(choice.stream);
            }
            faults.push(choice.kind.word());
            on.push(choice.on.as_str());
            sizes.extend((!size.is_empty()).then_some(size));
        }
        case.fault = faults.join(" + ");
        case.on = on.join(" + ");
        case.size = sizes.join(" + ");
        (faults, case)
    }

    /// Draws a choice that is not taken, of those with a row in the window if there are any.
    fn choose(&self, draws: Draws, taken: &[usize], from: Time, to: Time) -> Option<usize> {
        let free: Vec<usize> = (0..self.choices.len()).filter(|k| !taken.contains(k)).collect();
        let has_row = |k: &usize| {
            let times = &self.survey.streams[self.choices[*k].stream].times;
            times.get(times.partition_point(|t| *t < from)).is_some_and(|t| *t < to)
        };
        let heard: Vec<usize> = free.iter().copied().filter(has_row).collect();
        let from = if heard.is_empty() { &free } else { &heard };
        from.get(draws.index("choice", from.len())).copied()
    }
}

/// The faults that fit a stream.
fn choices(design: &Design, assembly: &Assembly, catalogue: &Catalogue, survey: &Survey, target: &Target<'_>) -> Vec<Choice> {
    let limits = &catalogue.draw;
    let mut found = Vec::new();
    for kind in Kind::ALL.into_iter().filter(|k| limits.only.is_empty() || limits.only.contains(k)) {
        let choice = |on: String, channel| Choice {
            kind,
            stream: target.stream,
            on,
            path: target.path.clone(),
            channel,
            size: if target.is_input { limits.input } else { limits.size },
            factor: limits.factor,
            delay: limits.delay,
        };
        let name = &target.layout.name;
        if kind.is_of_rows() {
            found.push(choice(name.clone(), None));
            continue;
        }
        for (number, provided) in target.channels.iter().enumerate() {
            let channel = &provided.channel;
            let scale = scale(design, assembly, survey, target, number);
            if kind.fits(channel, &scale) {
                let on = if target.channels.len() > 1 {
                    format!("{name}.{}", channel.name)
                } else {
                    name.clone()
                };
                found.push(choice(on, Some((channel.clone(), scale))));
            }
        }
    }
    found
}

impl Choice {
    /// The fields of a fault that lasts so long \[s\], but for the window; and its size, to be read.
    fn fault(&self, draws: Draws, lasts: f64) -> (String, String) {
        let (mut fields, size) = match &self.channel {
            None => self.of_rows(draws),
            Some((channel, scale)) => {
                let (fields, size) = self.of_channel(draws, lasts, channel, scale);
                (format!("channel = {:?}, {fields}", channel.name), size)
            }
        };
        fields = fields.trim_end_matches(", ").to_owned();
        (fields, size)
    }

    fn of_rows(&self, draws: Draws) -> (String, String) {
        match self.kind {
            Kind::Delay => {
                let by = digits(draws.size("by", self.delay));
                (format!("type = \"late\", by = {by}"), format!("{by} s"))
            }
            Kind::Stamp => {
                let by = digits(draws.size("by", self.delay) * draws.one("way", &[1.0, -1.0]));
                (format!("type = \"clock_jump\", by = {by}"), format!("{by} s"))
            }
            Kind::Duplicate => {
                let copies = 1 + draws.index("copies", 4);
                (format!("type = \"duplicate\", copies = {copies}"), format!("{copies} more"))
            }
            Kind::Freeze => ("type = \"frozen\"".to_owned(), String::new()),
            _ => ("type = \"outage\"".to_owned(), String::new()),
        }
    }

    fn of_channel(&self, draws: Draws, lasts: f64, channel: &Channel, scale: &[f64]) -> (String, String) {
        let multiple = draws.size("size", self.size);
        let length = |by: &[f64]| math::sqrt(by.iter().map(|x| x * x).sum::<f64>());
        let sized = |multiple: f64| sized(scale, multiple, derive_seed(draws.0, &["direction"]));
        match self.kind {
            Kind::Scale => {
                let factor = digits(draws.size("factor", self.factor));
                (format!("type = \"scale\", factor = {factor}"), format!("× {factor}"))
            }
            Kind::Unit => {
                let factor = digits(draws.one("unit", units(channel.dimension)));
                (format!("type = \"scale\", factor = {factor}"), format!("× {factor}"))
            }
            Kind::Sign => {
                // One axis, or all.
                let axes = channel.degrees();
                let turned = draws.index("axis", axes + 1);
                let factor: Vec<i8> = (0..axes).map(|k| if k == turned || turned == axes { -1 } else { 1 }).collect();
                (format!("type = \"scale\", factor = {factor:?}"), format!("× {factor:?}"))
            }
            Kind::Swap => {
                // Latitude and longitude: a height has another unit.
                let count = if channel.shape == Shape::Geodetic { 2 } else { channel.width };
                let a = draws.index("one", count);
                let b = (a + 1 + draws.index("other", count - 1)) % count;
                (format!("type = \"swap\", numbers = [{a}, {b}]"), format!("{a}, {b}"))
            }
            Kind::Ramp => {
                let rate = sized(multiple / lasts);
                (
                    format!("type = \"ramp\", rate = {rate:?}"),
                    unit(channel, "rate").list(&[length(&rate)]),
                )
            }
            Kind::Noise => {
                let sigma: Vec<f64> = scale.iter().map(|s| digits(multiple * s)).collect();
                (format!("type = \"noise\", sigma = {sigma:?}"), unit(channel, "sigma").list(&sigma))
            }
            _ => {
                let value = sized(multiple);
                (
                    format!("type = \"spike\", value = {value:?}"),
                    unit(channel, "value").list(&[length(&value)]),
                )
            }
        }
    }
}

/// The factors between units that are confused.
fn units(dimension: Dimension) -> &'static [f64] {
    const TURN: [f64; 2] = [180.0 / core::f64::consts::PI, core::f64::consts::PI / 180.0];
    const KNOT: f64 = 1852.0 / 3600.0;
    const FOOT: f64 = 0.3048;
    const GRAVITY: f64 = 9.80665;
    match dimension {
        d if d == dim::Angle::KIND.dimension || d == dim::AngularRate::KIND.dimension => &TURN,
        d if d == dim::Speed::KIND.dimension => &[3.6, 1.0 / 3.6, KNOT, 1.0 / KNOT, FOOT, 1.0 / FOOT],
        d if d == dim::Acceleration::KIND.dimension => &[GRAVITY, 1.0 / GRAVITY, FOOT, 1.0 / FOOT],
        d if d == dim::Length::KIND.dimension => &[FOOT, 1.0 / FOOT, 100.0, 0.01],
        _ => &[10.0, 0.1, 1000.0, 0.001],
    }
}

/// To a millisecond: it is meant to be read.
fn millis(time: Time) -> Time {
    Time::from_nanos(time.nanos().div_euclid(1_000_000).saturating_mul(1_000_000))
}
