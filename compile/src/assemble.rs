//! The text of the function that assembles the filter.

use core::fmt::Write;
use fusion::assembly::Plan;
use fusion_core::chart::{Biases, Side};
use fusion_core::covariance::FormKind;
use fusion_core::filter::{ChartKind, UpdateKind};
use fusion_core::model::Literal;
use fusion_core::runner::{InitialiserUnit, Sensor, StageUnit};

/// A part of a plan that has no expression.
pub(crate) struct Unwritten {
    /// The part, for a message.
    pub(crate) what: String,
    /// Its table in the design.
    pub(crate) table: String,
    /// A remedy.
    pub(crate) help: &'static str,
}

/// The expression of a model of the block that `table` declares.
fn of(model: Option<&dyn Literal>, what: &str, table: String) -> Result<String, Unwritten> {
    model.map(text).ok_or_else(|| Unwritten {
        what: format!("{what} of `{table}`"),
        table,
        help: "derive `Literal` for its model, and write `literal!()` in the trait of its role; a filter inside a stage has no literal",
    })
}

fn text(value: &dyn Literal) -> String {
    let mut out = String::new();
    value.expression(&mut out);
    out
}

/// The statements of `assemble`, each on its line.
pub(crate) fn body(plan: &Plan) -> Result<String, Unwritten> {
    let mut out = String::new();
    let mut line = |text: String| {
        // A string takes any text.
        let _ = writeln!(out, "    {text}");
    };
    line(format!("let layout = Arc::new({});", text(plan.layout.as_ref())));
    let process = of(plan.process.literal(), "the model", "process".to_owned())?;
    line(format!("let process: Arc<dyn Process> = Arc::new({process});"));
    line(format!("let parts = {};", parts(plan)?));
    let (value, residual) = (plan.largest.value, plan.largest.residual);
    line(format!(
        "let filter = Filter::of(layout.clone(), process.clone(), parts, Size {{ value: {value}, residual: {residual} }});"
    ));
    line(format!(
        "let mut runner = Runner::new(Box::new(filter), process.clone(), {});",
        text(&plan.reorder)
    ));
    line(format!("runner.set_limits({});", text(&plan.limits)));
    for stream in &plan.streams {
        line(format!("runner.add_stream({:?}, {});", stream.name, stream.width()));
    }
    if let Some((port, limits)) = &plan.input {
        line(format!("runner.set_input({});", text(port)));
        line(format!("runner.limit_input({});", text(limits)));
    }
    for sensor in &plan.sensors {
        line(format!("runner.add_sensor({});", of_sensor(sensor)?));
    }
    for stage in &plan.stages {
        line(format!("runner.add_stage({});", of_stage(stage)?));
    }
    for initialiser in &plan.initialisers {
        line(format!("runner.add_initialiser({});", of_initialiser(initialiser)?));
    }
    let times = [
        ("limit_jumps", plan.longest_jump),
        ("restart_lost", plan.restart_lost),
        ("restart_after", plan.restart_after),
    ];
    for (function, seconds) in times {
        if let Some(seconds) = seconds {
            line(format!("runner.{function}({});", text(&seconds)));
        }
    }
    line("Vehicle::new(runner, &layout, process, &BOUNDS, FINGERPRINT)".to_owned());
    Ok(out)
}

/// The parts of the filter. Only those that it uses are linked.
fn parts(plan: &Plan) -> Result<String, Unwritten> {
    let backend = &plan.backend;
    let custom = |what: &str, name: &str| Unwritten {
        what: format!("the {what} `{name}` of another crate"),
        table: "filter".to_owned(),
        help: "use one of this framework in a variant for the vehicle",
    };
    let chart = match backend.chart {
        ChartKind::AdditiveEuler => "AdditiveEuler".to_owned(),
        ChartKind::AdditiveQuaternion => "AdditiveQuaternion".to_owned(),
        ChartKind::Body => "Body".to_owned(),
        ChartKind::Navigation => "Navigation".to_owned(),
        ChartKind::Invariant(side, biases) => {
            let side = match side {
                Side::Left => "Left",
                Side::Right => "Right",
            };
            let biases = match biases {
                Biases::Imperfect => "Imperfect",
                Biases::TwoFrames => "TwoFrames",
            };
            format!("Invariant {{ side: chart::Side::{side}, biases: chart::Biases::{biases}, origin: None }}")
        }
        ChartKind::Custom(chart) => return Err(custom("chart", chart.name)),
    };
    let update = match backend.update {
        UpdateKind::Single => "Single".to_owned(),
        UpdateKind::Outright => "Outright".to_owned(),
        UpdateKind::Iterated(rule) => {
            let (iterations, tolerance) = (rule.iterations, text(&rule.tolerance));
            format!("Iterated {{ iterations: {iterations}, tolerance: {tolerance} }}")
        }
        UpdateKind::Unscented(spread) => {
            let (alpha, beta, kappa) = (text(&spread.alpha), text(&spread.beta), text(&spread.kappa));
            format!("Unscented(filter::SigmaSpread {{ alpha: {alpha}, beta: {beta}, kappa: {kappa} }})")
        }
        UpdateKind::Custom(rule) => return Err(custom("update", rule.name)),
    };
    let form = match backend.form {
        FormKind::Joseph => "Joseph",
        FormKind::Standard => "Standard",
        FormKind::Udu => "Udu",
        FormKind::SquareRoot => "SquareRoot::default()",
        FormKind::Custom(form) => return Err(custom("form", form.name)),
    };
    Ok(format!(
        "Parts {{ chart: Arc::new(chart::{chart}), update: Arc::new(filter::{update}), form: Arc::new(covariance::{form}), \
         reset: chart::Reset::{:?}, kernel: covariance::Kernel::PORTABLE, protection: {} }}",
        backend.reset, backend.protection
    ))
}

fn of_sensor(sensor: &Sensor) -> Result<String, Unwritten> {
    let (name, table) = (&sensor.name, format!("sensor.{}", sensor.name));
    let model = of(sensor.model.literal(), "the model", table.clone())?;
    let gate = of(sensor.gate.literal(), "the gate", table.clone())?;
    let loss = of(sensor.loss.literal(), "the loss", table)?;
    Ok(format!(
        "Sensor {{ name: {}, model: Arc::new({model}), port: {}, offset: {}, constant: {}, noise: {}, quality: {}, \
         gate: Box::new({gate}), loss: Arc::new({loss}), switch: {} }}",
        text(name),
        text(&sensor.port),
        text(&sensor.offset),
        text(&sensor.constant),
        text(&sensor.noise),
        text(&sensor.quality),
        text(&sensor.switch),
    ))
}

fn of_stage(unit: &StageUnit) -> Result<String, Unwritten> {
    let (name, stage) = (&unit.name, of(unit.stage.literal(), "the model", format!("stage.{}", unit.name))?);
    Ok(format!(
        "StageUnit {{ name: {}, stage: Box::new({stage}), inputs: {}, output: {} }}",
        text(name),
        text(&unit.inputs),
        unit.output
    ))
}

fn of_initialiser(unit: &InitialiserUnit) -> Result<String, Unwritten> {
    let (name, initialiser) = (&unit.name, of(unit.initialiser.literal(), "the model", unit.name.clone())?);
    Ok(format!(
        "InitialiserUnit {{ name: {}, initialiser: Box::new({initialiser}), inputs: {} }}",
        text(name),
        text(&unit.inputs)
    ))
}
