//! The curves as a drawing: an SVG file that needs nothing else.

use super::{Instrument, Study};
use core::fmt::Write;
use fusion_core::math;

const WIDTH: f64 = 860.0;
/// For one instrument.
const HEIGHT: f64 = 440.0;
const LEFT: f64 = 80.0;
const RIGHT: f64 = 120.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = 50.0;
/// For the axes x, y, z. Readers with red-green colour blindness can also distinguish these colours (Okabe and Ito).
const COLOURS: [&str; 3] = ["#d55e00", "#009e73", "#0072b2"];

/// A plot for each instrument, below each other: the deviation as a line with its 1σ band, the fit dashed.
#[must_use]
pub fn svg(studies: &[Study]) -> String {
    let height = HEIGHT * studies.len() as f64;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    for (k, study) in studies.iter().enumerate() {
        let y = HEIGHT * k as f64;
        let _ = writeln!(out, "<g transform=\"translate(0 {y})\">");
        plot(&mut out, study);
        out += "</g>\n";
    }
    out + "</svg>\n"
}

/// Decades of both coordinates: the range of the axes of the plot.
struct Frame {
    tau: (i32, i32),
    sigma: (i32, i32),
}

impl Frame {
    /// The frame around all curves; `None` if there are no curves.
    fn around(study: &Study) -> Option<Self> {
        let (_, si) = study.instrument.unit();
        let points = || study.axes.iter().flat_map(|axis| &axis.curve);
        let decades = |values: &mut dyn Iterator<Item = f64>| {
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            let ends = (math::floor(math::log10(low)), math::ceil(math::log10(high)));
            (ends.0.is_finite() && ends.1.is_finite()).then_some((ends.0 as i32, (ends.1 as i32).max(ends.0 as i32 + 1)))
        };
        Some(Self {
            tau: decades(&mut points().map(|p| p.tau))?,
            sigma: decades(&mut points().map(|p| p.sigma / si))?,
        })
    }

    fn x(&self, tau: f64) -> f64 {
        let (low, high) = self.tau;
        LEFT + (WIDTH - LEFT - RIGHT) * (math::log10(tau) - f64::from(low)) / f64::from(high - low)
    }

    fn y(&self, sigma: f64) -> f64 {
        let (low, high) = self.sigma;
        let share = (math::log10(sigma) - f64::from(low)) / f64::from(high - low);
        HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * share.clamp(0.0, 1.0)
    }
}

fn plot(out: &mut String, study: &Study) {
    let Some(frame) = Frame::around(study) else { return };
    let (unit, si) = study.instrument.unit();
    grid(out, &frame);
    let what = match study.instrument {
        Instrument::Gyro => "angular rate",
        Instrument::Accelerometer => "specific force",
    };
    let name = escaped(&study.name);
    let middle = (TOP + HEIGHT - BOTTOM) / 2.0;
    let _ = writeln!(
        out,
        "<text x=\"{LEFT}\" y=\"24\" font-size=\"15\">Allan deviation of the {what}, {name}</text>\n\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">cluster time τ [s]</text>\n\
         <text transform=\"translate(18 {middle}) rotate(-90)\" text-anchor=\"middle\">σ(τ) [{unit}]</text>",
        (LEFT + WIDTH - RIGHT) / 2.0,
        HEIGHT - 12.0,
    );
    for (k, (axis, colour)) in study.axes.iter().zip(COLOURS).enumerate() {
        let line = |value: &dyn Fn(&super::Point) -> f64| {
            let points = axis
                .curve
                .iter()
                .map(|p| format!("{:.1},{:.1}", frame.x(p.tau), frame.y(value(p) / si)));
            points.collect::<Vec<_>>()
        };
        // σ/√(2 · freedom) above and below the curve.
        let error = |p: &super::Point| math::sqrt(2.0 * p.freedom).recip();
        let mut band = line(&|p| p.sigma * (1.0 + error(p)));
        band.extend(line(&|p| p.sigma * (1.0 - error(p))).into_iter().rev());
        let _ = writeln!(
            out,
            "<polygon points=\"{}\" fill=\"{colour}\" fill-opacity=\"0.15\"/>\n\
             <polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>\n\
             <polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-dasharray=\"5 4\"/>\n\
             <text x=\"{}\" y=\"{}\" fill=\"{colour}\">{} (dashed: fit)</text>",
            band.join(" "),
            line(&|p| p.sigma).join(" "),
            line(&|p| axis.noises.deviation(p.tau)).join(" "),
            WIDTH - RIGHT + 10.0,
            TOP + 16.0 * (k as f64 + 1.0),
            ["x", "y", "z"][k],
        );
    }
}

fn grid(out: &mut String, frame: &Frame) {
    let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
    for decade in frame.tau.0..=frame.tau.1 {
        let x = frame.x(math::powi(10_f64, decade));
        let _ = writeln!(
            out,
            "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{bottom}\" stroke=\"#ccc\"/>\
             <text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            bottom + 18.0,
            power(decade)
        );
    }
    for decade in frame.sigma.0..=frame.sigma.1 {
        let y = frame.y(math::powi(10_f64, decade));
        let _ = writeln!(
            out,
            "<line x1=\"{LEFT}\" x2=\"{right}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"#ccc\"/>\
             <text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>",
            LEFT - 6.0,
            y + 4.0,
            power(decade)
        );
    }
}

fn power(decade: i32) -> String {
    match decade {
        -2..=3 => math::powi(10_f64, decade).to_string(),
        _ => format!("1e{decade}"),
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
