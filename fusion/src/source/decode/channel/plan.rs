//! From the declaration of a channel to the conversion of its cells.

use super::convert::{Angles, Conversion, Written};
use super::form::{Form, Input, forms, turns, whole, zone};
use super::rotation::matrix;
use crate::source::decode::OneOrMany;
use crate::source::decode::header_unit::common_unit;
use crate::source::decode::spec::{ChannelSpec, RotationSpec};
use fusion_core::time::nanos;
use fusion_models::block::{BuildError, Channel, Shape, check_delay};
use fusion_models::plausible::Possible;
use fusion_models::units::{Dimension, Dimensional, dim, parse_unit, range};
use fusion_models::vocabulary::channel;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use std::borrow::Cow;

/// The `unit` of latitudes and longitudes in degrees and minutes.
const DEGREES_AND_MINUTES: &str = "ddmm";
const NEEDS_ANGLE: &str = "add `unit = \"deg\"` or `unit = \"rad\"`";

/// A channel, checked; columns are still names.
#[derive(Clone, Debug)]
pub(in super::super) struct ChannelPlan {
    pub(in super::super) channel: Channel,
    pub(in super::super) delay_ns: i64,
    /// The numbers that it reads, in order.
    pub(in super::super) inputs: Vec<Input>,
    pub(in super::super) increment: bool,
    pub(super) average: bool,
    pub(super) variance: bool,
    /// Number = factor · cell + add.
    pub(super) factor: Vec<f64>,
    pub(super) add: Vec<f64>,
    pub(super) conversion: Conversion,
    /// The possible numbers after the conversion.
    pub(super) possible: Possible,
    /// The numbers of the sample before, for the mean with it.
    pub(super) previous: Option<Vec<f64>>,
}

impl ChannelPlan {
    /// Checks the declaration; all mistakes go to `errors`.
    pub(in super::super) fn new(name: &str, spec: &ChannelSpec, errors: &mut Vec<BuildError>) -> Option<Self> {
        let before = errors.len();
        let mut planner = Planner { name, spec, errors };
        let (form, inputs) = planner.form()?;
        let width = inputs.len();
        let units = planner.units(form, &inputs);
        let (mut factor, mut dimension) = planner.factor(form, &inputs, &units);
        // A horizontal position has no factor for a height.
        factor.truncate(width);
        planner.scale(&mut factor);
        if spec.variance {
            dimension = planner.root(dimension);
        }
        let offset_dimension = if form.is_angles() { dim::Angle::KIND.dimension } else { dimension };
        let add = planner.offset(offset_dimension, width);
        if spec.increment {
            dimension = planner.rate(dimension);
        }
        let conversion = planner.conversion(form, width, &units);
        let shape = planner.shape(form, dimension);
        let (shape, dimension) = if shape == Shape::Geodetic && width == 2 {
            (Shape::Angle, dim::Angle::KIND.dimension)
        } else {
            (shape, dimension)
        };
        let latency = spec.latency.si();
        errors.extend(check_delay(format!("channels.{name}.latency"), latency).err());
        let plan = Self {
            channel: Channel {
                name: name.to_owned().into(),
                width: if form.is_attitude() { 4 } else { width },
                dimension,
                shape,
            },
            delay_ns: nanos(latency),
            inputs,
            increment: spec.increment,
            average: spec.average,
            variance: spec.variance,
            factor,
            add,
            conversion,
            possible: Possible::of(name, shape, dimension),
            previous: None,
        };
        (errors.len() == before).then_some(plan)
    }
}

/// The units of a channel: of its columns, and of a height column.
struct Units {
    across: Option<String>,
    height: Option<String>,
}

/// Reads the declaration of one channel. A mistake is noted and replaced by a placeholder of the right form,
/// so that all mistakes are found.
struct Planner<'a> {
    name: &'a str,
    spec: &'a ChannelSpec,
    errors: &'a mut Vec<BuildError>,
}

impl Planner<'_> {
    /// Notes a mistake; an empty `help` gives no advice.
    fn wrong(&mut self, field: &str, message: &str, help: &str) {
        let dot = if field.is_empty() { "" } else { "." };
        let error = BuildError::at(format!("channels.{}{dot}{field}", self.name), message);
        self.errors.push(if help.is_empty() { error } else { error.help(help) });
    }

    /// The form of the channel and its inputs.
    fn form(&mut self) -> Option<(Form, Vec<Input>)> {
        let form = match forms(self.spec)[..] {
            [form] => form,
            ref forms => {
                let message = if forms.is_empty() {
                    "this channel names no columns"
                } else {
                    "this channel is made in two ways"
                };
                let help = "give one of `column`, `columns`, `enu`, `speed` with `course`, `quaternion`, `dcm`, `rpy`, `euler`, \
                            `latitude` with `longitude` and `height`, `ecef`, `utm` with `height`, or `north` with `east` and \
                            `down` or `up`";
                self.wrong("", message, help);
                return None;
            }
        };
        let inputs = match form.inputs(self.name, self.spec) {
            Ok(inputs) => inputs,
            Err(missing) => {
                let without = match (self.name, missing) {
                    ("position", "height") => {
                        "; of fixes without a height call the channel `horizontal_position`, which the sensor of that name reads"
                    }
                    ("velocity", "down") => {
                        "; where nothing is known of the vertical call the channel `horizontal_velocity`, which the sensor of that name reads"
                    }
                    _ => "",
                };
                let help = format!("{}{without}", form.example());
                self.wrong("", &format!("this channel misses `{missing}`"), &help);
                return None;
            }
        };
        if inputs.iter().all(|input| input.columns.is_empty()) {
            self.wrong("columns", "this channel names no columns", form.example());
            return None;
        }
        if let Some(empty) = inputs.iter().find(|input| input.columns.is_empty()) {
            self.wrong(
                empty.field,
                "this sum names no column",
                "write the names of the columns to be added, or the one column as text",
            );
        }
        for key in form.misfits(self.name, self.spec) {
            if let Some(whole) = whole(self.name).filter(|_| ["height", "down", "up"].contains(&key)) {
                let message = format!("a `{}` has no `{key}`", self.name);
                self.wrong(key, &message, &format!("leave it out, or call the channel `{whole}`"));
            } else {
                self.wrong(key, &format!("`{key}` does not apply to {}", form.name()), "");
            }
        }
        if form == Form::Course && Channel::is_sigma(self.name) {
            self.wrong(
                "",
                "a 1σ is along north, east and down, and has no course",
                "write `columns`, or `enu`",
            );
            return None;
        }
        Some((form, inputs))
    }

    /// The units: declared, or stated by the names of the columns.
    fn units(&mut self, form: Form, inputs: &[Input]) -> Units {
        // For a speed with its course, each column has a separate unit.
        let inputs = if form == Form::Course { &[] } else { inputs };
        let inputs = inputs.iter().filter(|input| input.unit.is_none());
        let (heights, others): (Vec<&Input>, Vec<&Input>) = inputs.partition(|input| input.field == "height");
        let columns = |inputs: &[&Input]| -> Vec<String> { inputs.iter().flat_map(|input| input.columns.clone()).collect() };
        let (heights, others) = (columns(&heights), columns(&others));
        let wanted = channel::known(self.name.strip_suffix("_sigma").unwrap_or(self.name)).map(|channel| channel.dimension);
        let stated = |of: Result<Option<Cow<'_, str>>, _>| of.ok().flatten().map(Cow::into_owned);
        let height = self.spec.height_unit.clone().or_else(|| stated(common_unit(&heights, None)));
        let has_unit = self.spec.unit.is_some() || matches!(form, Form::Quaternion | Form::Dcm);
        let of_header = if has_unit { Ok(None) } else { common_unit(&others, wanted) };
        if let Err((one, other)) = &of_header {
            let message = format!("the columns `{one}` and `{other}` state different units");
            self.wrong("", &message, "declare the `unit`, or make two channels");
        }
        let across = self.spec.unit.clone().or_else(|| stated(of_header));
        Units { across, height }
    }

    /// A unit in SI, with its dimension; without a unit, a pure number.
    fn unit(&mut self, field: &str, text: Option<&str>, wanted: Option<Dimension>) -> (f64, Dimension) {
        let read = text.map_or(Ok((1.0, Dimension::NONE)), parse_unit);
        match (read, wanted) {
            (Err(error), wanted) => {
                let example = wanted.map_or_else(|| "deg/s".to_owned(), |wanted| wanted.to_string());
                let help = format!("write the unit of the columns alone, e.g. `{field} = {example:?}`");
                self.wrong(field, &error.to_string(), &help);
            }
            (Ok((_, found)), Some(wanted)) if found != wanted => {
                let (unit, found, wanted) = (text.unwrap_or_default(), found.kind(), wanted.kind());
                self.wrong(
                    field,
                    &format!("{unit:?} is the unit of {found}; that of {wanted} is expected here"),
                    &format!("write e.g. `{field} = {:?}`", wanted.dimension.to_string()),
                );
            }
            (Ok(read), _) => return read,
        }
        (1.0, wanted.unwrap_or(Dimension::NONE))
    }

    /// Factors of the units on the columns, and the dimension of the channel.
    fn factor(&mut self, form: Form, inputs: &[Input], units: &Units) -> (Vec<f64>, Dimension) {
        let length = dim::Length::KIND.dimension;
        let unit = units.across.as_deref();
        let height = units.height.as_deref().unwrap_or("m");
        match form {
            Form::Vector => {
                let (factor, dimension) = self.unit("unit", unit.filter(|unit| !unit.is_empty()), None);
                (vec![factor; inputs.len()], dimension)
            }
            Form::Course => (self.speeds(inputs), dim::Speed::KIND.dimension),
            Form::Quaternion | Form::Dcm => (vec![1.0; inputs.len()], Dimension::NONE),
            Form::Rpy | Form::Euler => {
                let factor = self.angle("an angle needs its unit", unit);
                (vec![factor; inputs.len()], Dimension::NONE)
            }
            Form::Geodetic => {
                let across = if unit == Some(DEGREES_AND_MINUTES) {
                    1.0
                } else {
                    self.angle("a latitude needs its unit", unit)
                };
                let up = self.unit("height_unit", Some(height), Some(length)).0;
                (vec![across, across, up], Dimension::NONE)
            }
            Form::Utm => {
                let across = self.unit("unit", Some(unit.unwrap_or("m")), Some(length)).0;
                let up = self.unit("height_unit", Some(height), Some(length)).0;
                (vec![across, across, up], Dimension::NONE)
            }
            Form::Ecef | Form::Local => {
                let factor = self.unit("unit", Some(unit.unwrap_or("m")), Some(length)).0;
                let own = inputs.get(2).and_then(|input| Some((input.field, input.unit.as_deref()?)));
                let vertical = own.map_or(factor, |(field, own)| {
                    self.unit(&format!("{field}.unit"), Some(own), Some(length)).0
                });
                (vec![factor, factor, self.downwards(vertical)], Dimension::NONE)
            }
        }
    }

    /// The factor of a vertical value, with the sign that makes down positive.
    const fn downwards(&self, factor: f64) -> f64 {
        if self.spec.up.is_some() { -factor } else { factor }
    }

    /// Factors of a speed, its course and a vertical speed. A column has its separate unit, or `unit` for speeds, or
    /// the unit in its name. A vertical speed without these has the unit of the horizontal speed.
    fn speeds(&mut self, inputs: &[Input]) -> Vec<f64> {
        let mut factors = Vec::new();
        let mut of_speed = None;
        for input in inputs {
            let is_course = input.field == "course";
            let (what, wanted, example) = if is_course {
                (
                    "course",
                    dim::Angle::KIND.dimension,
                    "write e.g. `course = { column = \"COG\", unit = \"deg\" }`",
                )
            } else {
                (
                    "speed",
                    dim::Speed::KIND.dimension,
                    "write e.g. `speed = { column = \"SOG\", unit = \"kn\" }`",
                )
            };
            let of_speeds = [&self.spec.unit, &of_speed].map(|unit| unit.clone().filter(|_| !is_course));
            let [declared, same] = of_speeds;
            let is_declared = input.unit.is_none() && declared.is_some();
            let stated = common_unit(&input.columns, None).ok().flatten().map(Cow::into_owned);
            let Some(unit) = input.unit.clone().or(declared).or(stated).or(same) else {
                self.wrong(input.field, &format!("a {what} needs its unit"), example);
                factors.push(1.0);
                continue;
            };
            let field = if is_declared {
                "unit".to_owned()
            } else {
                format!("{}.unit", input.field)
            };
            let factor = self.unit(&field, Some(&unit), Some(wanted)).0;
            factors.push(if input.field == "up" { -factor } else { factor });
            if input.field == "speed" {
                of_speed = Some(unit);
            }
        }
        factors
    }

    /// The factor of angles; their unit must be known.
    fn angle(&mut self, missing: &str, unit: Option<&str>) -> f64 {
        if unit.is_none() {
            self.wrong("", missing, NEEDS_ANGLE);
        }
        self.unit("unit", Some(unit.unwrap_or("rad")), Some(dim::Angle::KIND.dimension)).0
    }

    /// Multiplies the declared scale into the factors.
    fn scale(&mut self, factor: &mut [f64]) {
        let Some(OneOrMany(scale)) = &self.spec.scale else { return };
        let width = factor.len();
        match per_axis(scale, width) {
            Some(scale) if scale.iter().all(|s| s.is_finite()) => factor.iter_mut().zip(scale).for_each(|(f, s)| *f *= s),
            Some(_) => self.wrong("scale", "a scale is a finite number", "write e.g. `scale = 0.001`"),
            None => {
                let message = format!("{} factors are given for {width} columns", scale.len());
                self.wrong("scale", &message, "write one factor for all columns, or an array of one for each");
            }
        }
    }

    /// The dimension whose square is the dimension of a variance.
    fn root(&mut self, variance: Dimension) -> Dimension {
        let root = variance.power(1).filter(|root| root.power(1).is_some());
        root.unwrap_or_else(|| {
            let message = "with `variance = true` the unit is that of a variance";
            self.wrong("unit", message, "write e.g. `unit = \"m^2\"`");
            variance
        })
    }

    /// The offset added after unit and scale.
    fn offset(&mut self, dimension: Dimension, width: usize) -> Vec<f64> {
        let Some(offset) = &self.spec.offset else {
            return vec![0.0; width];
        };
        offset.si::<range::Finite>(&vec![dimension; width]).unwrap_or_else(|error| {
            self.wrong(&error.path("offset"), &error.to_string(), "");
            Vec::new()
        })
    }

    /// The dimension of the rate of an increment.
    fn rate(&mut self, increment: Dimension) -> Dimension {
        let per_second = Dimension::from_halves([0, 0, -2, 0, 0, 0]);
        increment.times(per_second).unwrap_or_else(|| {
            self.wrong("unit", "this unit cannot be divided by a time", "");
            increment
        })
    }

    fn rotation(&mut self, field: &str, spec: Option<&RotationSpec>) -> Option<Matrix3<f64>> {
        match matrix(spec?) {
            Ok(matrix) => Some(matrix),
            Err((key, message)) => {
                let help = "write e.g. `axes = [\"-x\", \"y\", \"-z\"]` or `rpy = [\"180 deg\", 0, 0]`";
                self.wrong(&format!("{field}{key}"), &message, help);
                None
            }
        }
    }

    /// The conversion of all numbers together.
    fn conversion(&mut self, form: Form, width: usize, units: &Units) -> Conversion {
        let spec = self.spec;
        let body = self.rotation("rotation", spec.rotation.as_ref());
        let navigation = self.rotation("navigation_rotation", spec.navigation_rotation.as_ref());
        if form == Form::Vector && body.is_some() && width != 3 {
            let message = format!("a rotation needs 3 columns, this channel has {width}");
            self.wrong("columns", &message, "name the columns of x, y and z, or leave `rotation` out");
        }
        let turn = |m: Option<Matrix3<f64>>| {
            let m = m.unwrap_or_else(Matrix3::identity);
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m))
        };
        let written = match form {
            Form::Vector => return Conversion::Vector { rotation: body },
            Form::Course => return Conversion::Course,
            Form::Geodetic => return Conversion::Geodetic(angles(units)),
            Form::Ecef => return Conversion::Ecef,
            Form::Local => return Conversion::Local { frame: None },
            Form::Utm => return self.checked("utm.zone", zone(spec)).map_or(Conversion::Ecef, Conversion::Utm),
            Form::Quaternion => Written::Quaternion,
            Form::Dcm => Written::Matrix,
            Form::Rpy => Written::Rpy,
            Form::Euler => self.checked("euler.order", turns(spec)).map_or(Written::Rpy, Written::Euler),
        };
        Conversion::Attitude {
            written,
            navigation: turn(navigation),
            sensor: turn(body).inverse(),
            inverse: spec.inverse,
        }
    }

    /// The value of a field, if it is valid; a mistake is noted.
    fn checked<T>(&mut self, field: &str, read: Option<Result<T, String>>) -> Option<T> {
        read?.map_err(|message| self.wrong(field, &message, "")).ok()
    }

    fn shape(&mut self, form: Form, dimension: Dimension) -> Shape {
        let is_angle = dimension == dim::Angle::KIND.dimension && !self.spec.variance;
        let shape = match form {
            Form::Vector if is_angle => Shape::Angle,
            Form::Vector | Form::Course => Shape::Vector,
            Form::Quaternion | Form::Dcm | Form::Rpy | Form::Euler => Shape::Quaternion,
            Form::Geodetic | Form::Ecef | Form::Utm | Form::Local => Shape::Geodetic,
        };
        if shape == Shape::Angle && self.spec.average {
            self.wrong("average", "angles that wrap have no plain mean", "");
        }
        shape
    }
}

/// How latitudes and longitudes are written.
fn angles(units: &Units) -> Angles {
    match units.across.as_deref() {
        Some(DEGREES_AND_MINUTES) => Angles::DegreesAndMinutes,
        unit => Angles::Of(unit.unwrap_or("rad").to_owned()),
    }
}

fn per_axis(values: &[f64], width: usize) -> Option<Vec<f64>> {
    match values {
        [one] => Some(vec![*one; width]),
        _ => (values.len() == width).then(|| values.to_vec()),
    }
}
