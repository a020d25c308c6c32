//! Curves and noises of a whole log, as tables and as TOML.

use super::{Instrument, Log, Noises, Point, deviation};
use fusion::config::{Diagnostic, Diagnostics};
use fusion_core::math;
use fusion_models::units::STANDARD_GRAVITY;
use fusion_tables::{Cell, Column, Page, Section, Table, Unit, short};

/// One axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Mean of the samples \[SI\].
    pub mean: f64,
    /// Its Allan deviation \[s, SI\].
    pub curve: Vec<Point>,
    /// The fitted noises \[SI\].
    pub noises: Noises,
}

/// Three axes of an instrument.
#[derive(Clone, Debug)]
pub struct Study {
    /// Gyros or accelerometers.
    pub instrument: Instrument,
    /// The source or file.
    pub name: String,
    /// Length of the used part \[s\].
    pub span: f64,
    /// Samples per second.
    pub rate: f64,
    /// Gaps in time.
    pub gaps: usize,
    /// Why the columns were read as increments and divided by the interval.
    pub increments: Option<String>,
    /// x, y, z.
    pub axes: [Axis; 3],
}

impl Instrument {
    /// The channel's name in words.
    pub(super) fn title(self) -> &'static str {
        match self {
            Self::Gyro => "Gyros",
            Self::Accelerometer => "Accelerometers",
        }
    }

    /// The unit in which it is shown, and the value of one such unit in SI.
    pub(super) fn unit(self) -> (&'static str, f64) {
        match self {
            Self::Gyro => ("deg/s", 1_f64.to_radians()),
            Self::Accelerometer => ("m/s^2", 1.0),
        }
    }

    fn key(self) -> &'static str {
        match self {
            Self::Gyro => "gyro",
            Self::Accelerometer => "accelerometer",
        }
    }
}

impl Study {
    /// Studies a log.
    ///
    /// # Errors
    /// An axis that is too short, or that does not vary.
    pub fn of(log: &Log) -> Result<Self, Diagnostics> {
        let study = |samples: &Vec<f64>| {
            let curve = deviation(samples, log.interval);
            let noises = Noises::fit(&curve)?;
            let mean = samples.iter().sum::<f64>() / samples.len() as f64;
            Some(Axis { mean, curve, noises })
        };
        let axes: Option<Vec<Axis>> = log.axes.iter().map(study).collect();
        let axes: Option<[Axis; 3]> = axes.and_then(|axes| axes.try_into().ok());
        let axes = axes.ok_or_else(|| {
            let message = format!("`{}` has no Allan deviation: an axis is too short or does not vary", log.name);
            let help = "a log at rest of some hours is expected; 36 samples are the fewest that a curve can be fitted to";
            Diagnostic::error(message).help(help)
        })?;
        Ok(Self {
            instrument: log.instrument,
            name: log.name.clone(),
            span: log.axes[0].len() as f64 * log.interval,
            rate: 1.0 / log.interval,
            gaps: log.gaps,
            increments: log.increments.clone(),
            axes,
        })
    }

    /// The tables of several instruments.
    #[must_use]
    pub fn page(studies: &[Self]) -> Page {
        let mut page = Page::default();
        for study in studies {
            if study.gaps > 0 {
                page.warnings.push(format!(
                    "`{}` has {} gaps in time: the longest piece between them is used, {} s",
                    study.name,
                    study.gaps,
                    short(study.span)
                ));
            }
            page.warnings.extend(study.motion());
            page.warnings.extend(study.weight());
            page.sections.push(study.section());
        }
        page
    }

    /// A warning if the unit moves: the values change more from one second to the next than those of any instrument at
    /// rest.
    fn motion(&self) -> Option<String> {
        // The cheapest units in use have 0.05 deg/s/√Hz and 0.02 m/s²/√Hz.
        let most = match self.instrument {
            Instrument::Gyro => 0.5_f64.to_radians(),
            Instrument::Accelerometer => 0.3,
        };
        let second = |axis: &Axis| {
            let apart = |tau: f64| math::ln(tau).abs();
            let nearest = axis.curve.iter().min_by(|a, b| apart(a.tau).total_cmp(&apart(b.tau)));
            nearest.map_or(0.0, |p| p.sigma)
        };
        let largest = self.axes.iter().map(second).fold(0.0, f64::max);
        let (unit, si) = self.instrument.unit();
        (largest > most).then(|| {
            format!(
                "`{}` moves: from one second to the next it changes by {} {unit}. The figures are those of the motion, not of the \
                 instrument: take a log at rest, or a part that is at rest, by `--from` and `--to`",
                self.name,
                short(largest / si)
            )
        })
    }

    /// A warning if accelerometers at rest do not measure the length of gravity.
    fn weight(&self) -> Option<String> {
        let length = math::sqrt(self.axes.iter().map(|axis| math::powi(axis.mean, 2)).sum::<f64>());
        let is_gravity = (0.8..1.2).contains(&(length / STANDARD_GRAVITY));
        (self.instrument == Instrument::Accelerometer && !is_gravity).then(|| {
            format!(
                "the mean force of `{}` is {} m/s^2 long, and gravity is 9.8: the unit is another one, so the figures are in no unit. Of a \
                 table give `--accelerometer-unit`, of a design `unit`, or `increment = true` for increments",
                self.name,
                short(length)
            )
        })
    }

    fn section(&self) -> Section {
        let (unit, si) = self.instrument.unit();
        let with = |per: &str| Unit::shown(&format!("{unit}{per}"));
        let mut table = Table::new([
            Column::text("axis"),
            Column::with_unit("mean", with("")),
            Column::with_unit("N", with("/sqrt(Hz)")),
            Column::with_unit("B", with("")),
            Column::with_unit("K", with("/sqrt(s)")),
            Column::with_unit("least σ", with("")),
            Column::with_unit("at τ", Unit::of_si("s")),
        ]);
        for (name, axis) in ["x", "y", "z"].iter().zip(&self.axes) {
            let seen = |size: f64| {
                if size > 0.0 {
                    Cell::Real(size / si)
                } else {
                    Cell::text("not seen")
                }
            };
            let Noises { white, flicker, walk } = axis.noises;
            let least = axis.curve.iter().min_by(|a, b| a.sigma.total_cmp(&b.sigma));
            table.row([
                Cell::text(*name),
                Cell::Real(axis.mean / si),
                seen(white),
                seen(flicker),
                seen(walk),
                Cell::real(least.map(|p| p.sigma / si)),
                Cell::real(least.map(|p| p.tau)),
            ]);
        }
        let title = format!("{} of {}", self.instrument.title(), self.name);
        let section = Section::new(title, [table]).note(format!(
            "{} s at {} Hz. N: white noise; B: bias instability, 0.664 B is the flat part of the curve; K: random walk of the bias. \
             A log of this length shows σ up to τ = {} s.",
            short(self.span),
            short(self.rate),
            short(self.longest()),
        ));
        match &self.increments {
            Some(why) => section.note(format!(
                "The columns hold increments over the interval of {} s, for {why}: they were divided by it.",
                short(1.0 / self.rate)
            )),
            None => section,
        }
    }

    /// The longest cluster time of the curves \[s\].
    fn longest(&self) -> f64 {
        self.axes[0].curve.last().map_or(0.0, |p| p.tau)
    }

    /// Root mean square over the axes, in the displayed unit.
    fn rms(&self, of: impl Fn(&Axis) -> f64) -> f64 {
        let (_, si) = self.instrument.unit();
        math::sqrt(self.axes.iter().map(|axis| math::powi(of(axis), 2)).sum::<f64>() / 3.0) / si
    }

    /// Size of the visible turn-on bias, at least B. For gyros it is the mean; for accelerometers it is the difference
    /// between the length of the mean and gravity.
    fn bias(&self) -> f64 {
        let (_, si) = self.instrument.unit();
        let instability = self.rms(|axis| axis.noises.flicker);
        match self.instrument {
            Instrument::Gyro => self.rms(|axis| axis.mean).max(instability),
            Instrument::Accelerometer => {
                let length = math::sqrt(self.axes.iter().map(|axis| math::powi(axis.mean, 2)).sum::<f64>());
                ((length - STANDARD_GRAVITY).abs() / si).max(instability)
            }
        }
    }
}

/// The size of a noise on each axis, and the axes that do not show it; `None` if no axis shows it. An axis that does
/// not show the noise gets the smallest size of the other axes.
fn filled(study: &Study, of: fn(&Noises) -> f64) -> Option<([f64; 3], String)> {
    let sizes = study.axes.each_ref().map(|axis| of(&axis.noises));
    let least = sizes.into_iter().filter(|size| *size > 0.0).reduce(f64::min)?;
    let hidden = ["x", "y", "z"].into_iter().zip(sizes).filter(|(_, size)| *size == 0.0);
    let hidden: Vec<&str> = hidden.map(|(name, _)| name).collect();
    Some((sizes.map(|size| if size > 0.0 { size } else { least }), hidden.join(", ")))
}

/// The TOML to write into a design.
#[must_use]
pub fn toml(studies: &[Study]) -> String {
    let mut text = String::from("[process]\n");
    for study in studies {
        let (unit, si) = study.instrument.unit();
        let key = study.instrument.key();
        let up_to = short(study.longest());
        let of_others = |what: &str, hidden: &str| match hidden {
            "" => String::new(),
            _ => format!("# No {what} shows in {hidden}: the smallest of the other axes is written.\n"),
        };
        let instability = study.axes.each_ref().map(|axis| match axis.noises.flicker {
            0.0 => "not seen".to_owned(),
            flicker => format!("{:.2e} {unit}", flicker / si),
        });
        text += &format!(
            "# B = {}; `sigma` is the bias that this log shows: a data sheet knows more.\n",
            instability.join(", ")
        );
        match filled(study, |noises| noises.white) {
            None => {
                text += &format!(
                    "# No white noise shows from τ = {} s on: take `{key}.noise` from a data sheet.\n",
                    short(1.0 / study.rate)
                )
            }
            Some((white, hidden)) => {
                let noise = white.map(|white| format!("\"{:.3e} {unit}/sqrt(Hz)\"", white / si));
                text += &of_others("white noise", &hidden);
                text += &format!("{key}.noise = [{}]\n", noise.join(", "));
            }
        }
        let bias = format!("estimate = true, initial = [0, 0, 0], sigma = \"{:.2e} {unit}\"", study.bias());
        match filled(study, |noises| noises.walk) {
            None => {
                text += &format!("# No random walk of the bias shows up to τ = {up_to} s: none is written. A longer log may show one.\n");
                text += &format!("{key}.bias = {{ {bias} }}\n");
            }
            Some((walk, hidden)) => {
                let walk = walk.map(|walk| format!("\"{:.2e} {unit}/sqrt(s)\"", walk / si));
                text += &of_others("random walk", &hidden);
                text += &format!("{key}.bias = {{ {bias}, random_walk = [{}] }}\n", walk.join(", "));
            }
        }
    }
    text
}
