//! From the declaration of a channel to what is done with its cells.

use super::declaration::{ChannelSpec, OneOrMany, RotationSpec};
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::time::nanos;
use fusion_models::block::{BuildError, Channel, Shape, check_delay};
use fusion_models::earth::LocalFrame;
use fusion_models::units::{Dimension, Dimensional, dim, parse_unit};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3, Vector4};
use std::f64::consts::{FRAC_PI_2, TAU};

/// How far the norm of a quaternion may be from 1: a few digits in the file.
const NORM_TOLERANCE: f64 = 1e-2;

/// A channel, checked; columns are still names.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub(super) channel: Channel,
    pub(super) delay_ns: i64,
    /// Field of the declaration and column, in the order in which they are read.
    pub(super) columns: Vec<(&'static str, String)>,
    pub(super) increment: bool,
    average: bool,
    variance: bool,
    /// Value = factor · cell + add.
    factor: Vec<f64>,
    add: Vec<f64>,
    kind: Kind,
    previous: Option<Vec<f64>>,
}

/// What the numbers become.
#[derive(Clone, Debug)]
enum Kind {
    Vector {
        rotation: Option<Matrix3<f64>>,
    },
    Geodetic,
    /// North, east, down; the frame is given when the source is opened.
    Local {
        frame: Option<LocalFrame>,
    },
    Quaternion {
        navigation: UnitQuaternion<f64>,
        sensor: UnitQuaternion<f64>,
        inverse: bool,
    },
}

/// What is wrong with the values of a row.
pub(super) struct Wrong {
    pub(super) message: String,
    pub(super) help: Option<&'static str>,
}

impl Plan {
    /// Checks the declaration; all mistakes go to `errors`.
    pub(super) fn new(name: &str, spec: &ChannelSpec, errors: &mut Vec<BuildError>) -> Option<Self> {
        let before = errors.len();
        let mut wrong = |field: &str, message: &str, help: &str| {
            let dot = if field.is_empty() { "" } else { "." };
            let error = BuildError::at(format!("channels.{name}{dot}{field}"), message);
            errors.push(if help.is_empty() { error } else { error.help(help) });
        };
        let form = match forms(spec)[..] {
            [form] => form,
            ref forms => {
                let message = if forms.is_empty() {
                    "this channel names no columns"
                } else {
                    "this channel is made in two ways"
                };
                let help = "give one of `column`, `columns`, `quaternion`, `latitude` with `longitude` and `height`, \
                            or `north` with `east` and `down` or `up`";
                wrong("", message, help);
                return None;
            }
        };
        let columns = match form.columns(spec) {
            Ok(columns) => columns,
            Err(missing) => {
                wrong("", &format!("this channel misses `{missing}`"), form.example());
                return None;
            }
        };
        let width = columns.len();
        if width == 0 {
            wrong("columns", "this channel names no columns", "");
            return None;
        }
        form.misfits(spec)
            .into_iter()
            .for_each(|key| wrong(key, &format!("`{key}` does not apply to {}", form.name()), ""));

        let mut unit = |field: &str, text: &Option<String>, default: &str, wanted: Option<Dimension>| {
            let text = text.as_deref().unwrap_or(default);
            let read = if text.is_empty() {
                Ok((1.0, Dimension::NONE))
            } else {
                parse_unit(text)
            };
            match (read, wanted) {
                (Err(error), _) => wrong(field, &error.to_string(), ""),
                (Ok((_, found)), Some(wanted)) if found != wanted => {
                    wrong(
                        field,
                        &format!("{text:?} is the unit of {}; that of {} is wanted here", found.kind(), wanted.kind()),
                        "",
                    );
                }
                (Ok(read), _) => return read,
            }
            (1.0, wanted.unwrap_or(Dimension::NONE))
        };
        let (length, angle) = (dim::Length::KIND.dimension, dim::Angle::KIND.dimension);
        let (mut factor, mut dimension) = match form {
            Form::Vector => {
                let (factor, dimension) = unit("unit", &spec.unit, "", None);
                (vec![factor; width], dimension)
            }
            Form::Quaternion => (vec![1.0; 4], Dimension::NONE),
            Form::Geodetic => {
                let (across, up) = (
                    unit("unit", &spec.unit, "rad", Some(angle)).0,
                    unit("height_unit", &spec.height_unit, "m", Some(length)).0,
                );
                (vec![across, across, up], Dimension::NONE)
            }
            Form::Local => {
                let factor = unit("unit", &spec.unit, "m", Some(length)).0;
                (
                    vec![factor, factor, if spec.up.is_some() { -factor } else { factor }],
                    Dimension::NONE,
                )
            }
        };
        if form == Form::Geodetic && spec.unit.is_none() {
            wrong("", "a latitude needs its unit", "add `unit = \"deg\"` or `unit = \"rad\"`");
        }
        if let Some(scale) = &spec.scale {
            match per_axis(&scale.0, width) {
                Some(scale) if scale.iter().all(|s| s.is_finite()) => factor.iter_mut().zip(scale).for_each(|(f, s)| *f *= s),
                Some(_) => wrong("scale", "a scale is a finite number", ""),
                None => wrong("scale", &format!("{} factors are given for {width} columns", scale.0.len()), ""),
            }
        }
        if spec.variance {
            match dimension.power(1).filter(|root| root.power(1).is_some()) {
                Some(root) => dimension = root,
                None => wrong(
                    "unit",
                    "with `variance = true` the unit is that of a variance",
                    "write e.g. `unit = \"m^2\"`",
                ),
            }
        }
        let add = match &spec.offset {
            None => vec![0.0; width],
            Some(OneOrMany(offset)) => {
                let read: Result<Vec<f64>, _> = offset.iter().map(|q| q.expect(dimension)).collect();
                let fitted = read.map(|read| per_axis(&read, width));
                match fitted {
                    Ok(Some(add)) => add,
                    Ok(None) => {
                        wrong("offset", &format!("{} offsets are given for {width} columns", offset.len()), "");
                        Vec::new()
                    }
                    Err(error) => {
                        wrong("offset", &error.to_string(), "");
                        Vec::new()
                    }
                }
            }
        };
        if spec.increment {
            let per_second = Dimension::from_halves([0, 0, -2, 0, 0, 0]);
            match dimension.times(per_second) {
                Some(rate) => dimension = rate,
                None => wrong("unit", "this unit cannot be divided by a time", ""),
            }
        }
        let rotation_of = |spec: &Option<RotationSpec>| spec.as_ref().map(matrix).transpose();
        let mut rotation = |field: &str, spec: &Option<RotationSpec>| {
            rotation_of(spec).unwrap_or_else(|(key, message)| {
                wrong(
                    &format!("{field}{key}"),
                    &message,
                    "write e.g. `axes = [\"-x\", \"y\", \"-z\"]` or `rpy = [\"180 deg\", 0, 0]`",
                );
                None
            })
        };
        let (body, navigation) = (
            rotation("rotation", &spec.rotation),
            rotation("navigation_rotation", &spec.navigation_rotation),
        );
        if form == Form::Vector && body.is_some() && width != 3 {
            wrong("rotation", &format!("a rotation needs 3 columns, this channel has {width}"), "");
        }
        let kind = match form {
            Form::Vector => Kind::Vector { rotation: body },
            Form::Geodetic => Kind::Geodetic,
            Form::Local => Kind::Local { frame: None },
            Form::Quaternion => {
                let turn = |m: Option<Matrix3<f64>>| {
                    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m.unwrap_or_else(Matrix3::identity)))
                };
                Kind::Quaternion {
                    navigation: turn(navigation),
                    sensor: turn(body).inverse(),
                    inverse: spec.inverse,
                }
            }
        };
        let shape = match form {
            Form::Vector if dimension == angle && !spec.variance => Shape::Angle,
            Form::Vector => Shape::Vector,
            Form::Quaternion => Shape::Quaternion,
            Form::Geodetic | Form::Local => Shape::Geodetic,
        };
        if shape == Shape::Angle && spec.average {
            wrong("average", "angles that wrap have no plain mean", "");
        }
        let (average, variance, increment) = (spec.average, spec.variance, spec.increment);
        let channel = Channel {
            name: name.to_owned().into(),
            width,
            dimension,
            shape,
        };
        let latency = spec.latency.si();
        errors.extend(check_delay(format!("channels.{name}.latency"), latency).err());
        let delay_ns = nanos(latency);
        let plan = Self {
            channel,
            delay_ns,
            columns,
            increment,
            average,
            variance,
            factor,
            add,
            kind,
            previous: None,
        };
        (errors.len() == before).then_some(plan)
    }

    /// Whether a local position needs its origin.
    pub(super) const fn needs_origin(&self) -> bool {
        matches!(self.kind, Kind::Local { frame: None })
    }

    /// Gives a local position its origin.
    pub(super) fn set_origin(&mut self, origin: Geodetic) {
        if let Kind::Local { frame } = &mut self.kind {
            *frame = Some(LocalFrame::new(origin));
        }
    }

    /// Makes the channel's numbers of its cells; `interval` \[s\] is what increments cover.
    pub(super) fn convert(&mut self, cells: &[f64], interval: f64, out: &mut [f64]) -> Result<(), Wrong> {
        for (i, (out, cell)) in out.iter_mut().zip(cells).enumerate() {
            let mut value = self.factor[i] * cell;
            if self.variance {
                if value < 0.0 {
                    let message = format!("the variance {cell} in column `{}` is negative", self.columns[i].1);
                    return Err(Wrong { message, help: None });
                }
                value = value.sqrt();
            }
            value += self.add[i];
            *out = if self.increment { value / interval } else { value };
        }
        match &self.kind {
            Kind::Vector { rotation: None } => {}
            Kind::Vector { rotation: Some(rotation) } => {
                let turned = rotation * Vector3::new(out[0], out[1], out[2]);
                out.copy_from_slice(turned.as_slice());
            }
            Kind::Geodetic => {
                let help = Some("if the columns are in degrees, write `unit = \"deg\"`");
                if out[0].abs() > FRAC_PI_2 {
                    return Err(Wrong {
                        message: format!("the latitude {} rad lies beyond a pole", out[0]),
                        help,
                    });
                }
                if out[1].abs() > TAU {
                    return Err(Wrong {
                        message: format!("the longitude {} rad is more than a turn", out[1]),
                        help,
                    });
                }
            }
            Kind::Local { frame } => {
                if let Some(frame) = frame {
                    let p = frame.to_geodetic(&Vector3::new(out[0], out[1], out[2]));
                    out.copy_from_slice(&[p.lat, p.lon, p.height]);
                }
            }
            Kind::Quaternion {
                navigation,
                sensor,
                inverse,
            } => {
                let read = Vector4::from_column_slice(out);
                let norm = read.norm();
                if (norm - 1.0).abs() > NORM_TOLERANCE {
                    return Err(Wrong {
                        message: format!("the quaternion has norm {norm}, not 1"),
                        help: None,
                    });
                }
                let q = so3::from_scalar_first(&read);
                let q = navigation * if *inverse { q.inverse() } else { q } * sensor;
                out.copy_from_slice(so3::to_scalar_first(&q).as_slice());
            }
        }
        if self.average {
            let previous = self.previous.get_or_insert_with(|| out.to_vec());
            for (out, previous) in out.iter_mut().zip(previous) {
                let now = core::mem::replace(out, 0.5 * (*out + *previous));
                *previous = now;
            }
        }
        Ok(())
    }
}

/// The ways to make a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Vector,
    Quaternion,
    Geodetic,
    Local,
}

fn forms(spec: &ChannelSpec) -> Vec<Form> {
    let any = |keys: &[&Option<String>]| keys.iter().any(|key| key.is_some());
    let asked = [
        (spec.column.is_some(), Form::Vector),
        (spec.columns.is_some(), Form::Vector),
        (spec.quaternion.is_some(), Form::Quaternion),
        (any(&[&spec.latitude, &spec.longitude, &spec.height]), Form::Geodetic),
        (any(&[&spec.north, &spec.east, &spec.down, &spec.up]), Form::Local),
    ];
    asked.into_iter().filter(|(is_asked, _)| *is_asked).map(|(_, form)| form).collect()
}

impl Form {
    /// Field and column, or the field that is missing.
    fn columns(self, spec: &ChannelSpec) -> Result<Vec<(&'static str, String)>, &'static str> {
        let named = |field: &'static str, column: &Option<String>| column.clone().map(|c| (field, c)).ok_or(field);
        let all = |field: &'static str, columns: &[String]| columns.iter().map(|c| (field, c.clone())).collect();
        match self {
            Self::Vector => match (&spec.column, &spec.columns) {
                (Some(column), _) => Ok(vec![("column", column.clone())]),
                (None, columns) => Ok(all("columns", columns.as_deref().unwrap_or_default())),
            },
            Self::Quaternion => Ok(all("quaternion", spec.quaternion.as_ref().map_or(&[][..], |q| q))),
            Self::Geodetic => Ok(vec![
                named("latitude", &spec.latitude)?,
                named("longitude", &spec.longitude)?,
                named("height", &spec.height)?,
            ]),
            Self::Local => {
                let vertical = match (&spec.down, &spec.up) {
                    (Some(_), Some(_)) => return Err("down` or `up` (one of them, not both)"),
                    (down, None) => named("down", down)?,
                    (None, up) => named("up", up)?,
                };
                Ok(vec![named("north", &spec.north)?, named("east", &spec.east)?, vertical])
            }
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Vector => "a vector",
            Self::Quaternion => "a quaternion",
            Self::Geodetic | Self::Local => "a position",
        }
    }

    const fn example(self) -> &'static str {
        match self {
            Self::Geodetic => "write e.g. `{ latitude = \"lat\", longitude = \"lon\", height = \"h\", unit = \"deg\" }`",
            _ => "write e.g. `{ north = \"n\", east = \"e\", down = \"d\" }`",
        }
    }

    /// Keys that are given and mean nothing for this form.
    fn misfits(self, spec: &ChannelSpec) -> Vec<&'static str> {
        let (vector, quaternion) = (self == Self::Vector, self == Self::Quaternion);
        let keys = [
            ("unit", spec.unit.is_some(), !quaternion),
            ("height_unit", spec.height_unit.is_some(), self == Self::Geodetic),
            ("scale", spec.scale.is_some(), vector),
            ("offset", spec.offset.is_some(), vector),
            ("variance", spec.variance, vector),
            ("increment", spec.increment, vector),
            ("average", spec.average, vector),
            ("rotation", spec.rotation.is_some(), vector || quaternion),
            ("navigation_rotation", spec.navigation_rotation.is_some(), quaternion),
            ("inverse", spec.inverse, quaternion),
        ];
        keys.into_iter()
            .filter(|(_, is_given, fits)| *is_given && !fits)
            .map(|(key, ..)| key)
            .collect()
    }
}

fn per_axis(values: &[f64], width: usize) -> Option<Vec<f64>> {
    match values {
        [one] => Some(vec![*one; width]),
        _ => (values.len() == width).then(|| values.to_vec()),
    }
}

/// The matrix of a rotation; `Err` is the key below the rotation and the reason.
fn matrix(spec: &RotationSpec) -> Result<Matrix3<f64>, (&'static str, String)> {
    match (&spec.rpy, &spec.axes) {
        (Some(rpy), None) => {
            let [roll, pitch, yaw] = rpy.si();
            Ok(so3::rotation(&so3::from_rpy(roll, pitch, yaw)))
        }
        (None, Some(axes)) => {
            let mut m = Matrix3::zeros();
            for (row, axis) in axes.iter().enumerate() {
                let (sign, letter) = axis.strip_prefix('-').map_or((1.0, axis.as_str()), |letter| (-1.0, letter));
                let column = ["x", "y", "z"].into_iter().position(|known| known == letter);
                let column = column.ok_or_else(|| (".axes", format!("{axis:?} is not an axis: x, y, z, -x, -y or -z")))?;
                m[(row, column)] = sign;
            }
            match m.determinant() {
                d if d > 0.5 => Ok(m),
                d if d < -0.5 => Err((".axes", "these axes turn a right-handed frame into a left-handed one".to_owned())),
                _ => Err((".axes", "each of x, y and z occurs once".to_owned())),
            }
        }
        _ => Err(("", "a rotation is given by `rpy` or by `axes`".to_owned())),
    }
}
