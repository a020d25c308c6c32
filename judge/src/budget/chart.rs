//! The shares over time as a drawing: an SVG file that needs nothing else.

use super::result::{Budget, Split, StateBudget};
use core::fmt::Write;
use fusion_core::math;
use fusion_tables::{Unit, significant};

const WIDTH: f64 = 860.0;
const COLUMNS: usize = 3;
/// A panel with its title, and the plot inside it.
const PANEL: (f64, f64) = (280.0, 170.0);
const PLOT: (f64, f64) = (226.0, 110.0);
const LEFT: f64 = 34.0;
const TOP: f64 = 30.0;
/// The height of the key's first line, and the distance between its lines.
const KEY: f64 = 62.0;
const LINE: f64 = 18.0;
/// For the sources that bring most, then for all others together. Readers with red-green colour blindness can also
/// distinguish these colours (Okabe and Ito).
const COLOURS: [&str; 8] = [
    "#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#999999",
];
const NAMED: usize = COLOURS.len() - 1;

/// A panel for each axis of the state: the shares of the variance over time, stacked. The key names the sources that bring
/// most; the others are together.
#[must_use]
pub fn svg(budget: &Budget) -> String {
    let named = largest(budget);
    let key = (named.len() + usize::from(named.len() < budget.sources.len())) as f64;
    let head = KEY + LINE * math::ceil(key / 2.0);
    let rows = budget.states.len().div_ceil(COLUMNS) as f64;
    let height = head + PANEL.1 * rows;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{LEFT}\" y=\"24\" font-size=\"15\">Shares of the error variance over time</text>\n\
         <text x=\"{LEFT}\" y=\"42\">{}</text>\n",
        escaped(&budget.description)
    );
    let mut names: Vec<&str> = named.iter().map(|source| budget.sources[*source].as_str()).collect();
    if names.len() < budget.sources.len() {
        names.push("all others");
    }
    for (k, name) in names.iter().enumerate() {
        let (x, y) = (LEFT + 420.0 * (k % 2) as f64, KEY + LINE * (k / 2) as f64);
        let colour = if *name == "all others" { COLOURS[NAMED] } else { COLOURS[k] };
        let _ = writeln!(
            out,
            "<rect x=\"{x}\" y=\"{}\" width=\"12\" height=\"12\" fill=\"{colour}\"/><text x=\"{}\" y=\"{y}\">{}</text>",
            y - 10.0,
            x + 18.0,
            escaped(name)
        );
    }
    for (k, state) in budget.states.iter().enumerate() {
        let (x, y) = (PANEL.0 * (k % COLUMNS) as f64, head + PANEL.1 * (k / COLUMNS) as f64);
        let _ = writeln!(out, "<g transform=\"translate({x} {y})\">");
        panel(&mut out, budget, (k, state), &named);
        out += "</g>\n";
    }
    out + "</svg>\n"
}

/// The sources with the largest mean share, the largest first.
fn largest(budget: &Budget) -> Vec<usize> {
    let mean = |source: usize| -> f64 {
        let shares = budget
            .states
            .iter()
            .map(|state| state.rms.share(source))
            .filter(|share| share.is_finite());
        shares.sum()
    };
    let mut all: Vec<usize> = (0..budget.sources.len()).collect();
    all.sort_by(|a, b| mean(*b).total_cmp(&mean(*a)));
    all.truncate(NAMED);
    all
}

fn panel(out: &mut String, budget: &Budget, (k, state): (usize, &StateBudget), named: &[usize]) {
    let unit = Unit::of_si(state.unit);
    let sigma = significant(unit.of(state.end.sigma()));
    let _ = writeln!(
        out,
        "<text x=\"{LEFT}\" y=\"22\">{}: σ {sigma} {} at the end</text>",
        escaped(&state.name()),
        escaped(unit.symbol())
    );
    let points = budget.course.points();
    let (Some(first), Some(last)) = (points.first(), points.last()) else {
        return;
    };
    let span = (last.0 - first.0).max(f64::MIN_POSITIVE);
    let x = |time: f64| LEFT + PLOT.0 * (time - first.0) / span;
    let y = |share: f64| TOP + PLOT.1 * (1.0 - share);
    // Each layer from the sum below it to the sum above it.
    let mut below = vec![0.0; points.len()];
    let layers = named.iter().zip(COLOURS).map(|(source, colour)| (Some(*source), colour));
    for (source, colour) in layers.chain([(None, COLOURS[NAMED])]) {
        // The last layer is what is left, if there is any error at all.
        let share = |split: &Split, below: f64| match source {
            _ if split.total() <= 0.0 => 0.0,
            Some(source) => below + split.share(source),
            None => 1.0,
        };
        let sums = points.iter().zip(&below).map(|((_, states), below)| share(&states[k], *below));
        let above: Vec<f64> = sums.collect();
        let edge = |shares: &[f64]| -> Vec<String> {
            let each = points
                .iter()
                .zip(shares)
                .map(|((time, _), share)| format!("{:.1},{:.1}", x(*time), y(*share)));
            each.collect()
        };
        let mut outline = edge(&above);
        outline.extend(edge(&below).into_iter().rev());
        let _ = writeln!(out, "<polygon points=\"{}\" fill=\"{colour}\"/>", outline.join(" "));
        below = above;
    }
    let _ = writeln!(
        out,
        "<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#888\"/>\n\
         <text x=\"{}\" y=\"{}\" text-anchor=\"end\">1</text><text x=\"{}\" y=\"{}\" text-anchor=\"end\">0</text>\n\
         <text x=\"{LEFT}\" y=\"{bottom}\">{:.0} s</text><text x=\"{}\" y=\"{bottom}\" text-anchor=\"end\">{:.0} s</text>",
        PLOT.0,
        PLOT.1,
        LEFT - 5.0,
        TOP + 10.0,
        LEFT - 5.0,
        TOP + PLOT.1,
        first.0,
        LEFT + PLOT.0,
        last.0,
        bottom = TOP + PLOT.1 + 15.0,
    );
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
