//! The ways to declare a channel.

use super::turns::Turns;
use crate::source::decode::OneOrMany;
use crate::source::decode::spec::{ChannelSpec, Hemisphere, OneColumn};
use fusion_models::block::Channel;
use fusion_models::earth::utm::Zone;

/// Prefix of the names of channels without their vertical part.
const HORIZONTAL: &str = "horizontal_";

/// The channel with a vertical part that this one would be: `position` of `horizontal_position`.
pub(super) fn whole(name: &str) -> Option<&str> {
    name.strip_prefix(HORIZONTAL)
        .filter(|whole| ["position", "velocity"].contains(whole))
}

/// The ways to make a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Vector,
    Course,
    Quaternion,
    Dcm,
    Rpy,
    Euler,
    Geodetic,
    Ecef,
    Utm,
    Local,
}

/// A number that a channel reads.
#[derive(Clone, Debug)]
pub(in super::super) struct Input {
    /// The field of the declaration.
    pub(in super::super) field: &'static str,
    /// The columns to add, as written: each may have a minus sign.
    pub(in super::super) columns: Vec<String>,
    /// A separate unit, if declared.
    pub(super) unit: Option<String>,
    /// The sign of the sum is reversed.
    pub(in super::super) is_reversed: bool,
}

impl Input {
    fn new(field: &'static str, column: &str) -> Self {
        Self::sum(field, core::slice::from_ref(&column.to_owned()))
    }

    fn sum(field: &'static str, columns: &[String]) -> Self {
        Self {
            field,
            columns: columns.to_vec(),
            unit: None,
            is_reversed: false,
        }
    }

    fn one(field: &'static str, column: &OneColumn) -> Self {
        Self {
            unit: column.unit.clone(),
            ..Self::new(field, &column.column)
        }
    }

    /// Its columns as messages name them.
    pub(super) fn name(&self) -> String {
        self.columns.join("` + `")
    }
}

pub(super) fn forms(spec: &ChannelSpec) -> Vec<Form> {
    let any = |keys: &[&Option<String>]| keys.iter().any(|key| key.is_some());
    let is_course = spec.speed.is_some() || spec.course.is_some();
    let is_local = any(&[&spec.north, &spec.east]) || !is_course && (spec.down.is_some() || spec.up.is_some());
    let asked = [
        (spec.column.is_some(), Form::Vector),
        (spec.columns.is_some(), Form::Vector),
        (spec.enu.is_some(), Form::Vector),
        (is_course, Form::Course),
        (spec.quaternion.is_some(), Form::Quaternion),
        (spec.dcm.is_some(), Form::Dcm),
        (spec.rpy.is_some(), Form::Rpy),
        (spec.euler.is_some(), Form::Euler),
        (any(&[&spec.latitude, &spec.longitude]), Form::Geodetic),
        (spec.ecef.is_some(), Form::Ecef),
        (spec.utm.is_some(), Form::Utm),
        (is_local, Form::Local),
    ];
    let asked: Vec<Form> = asked.into_iter().filter(|(is_asked, _)| *is_asked).map(|(_, form)| form).collect();
    // A height alone: the latitude is missing.
    if asked.is_empty() && spec.height.is_some() {
        vec![Form::Geodetic]
    } else {
        asked
    }
}

impl Form {
    /// The inputs, or the field that is missing. The name of a channel shows if it is a 1σ, which has no
    /// direction.
    pub(super) fn inputs(self, name: &str, spec: &ChannelSpec) -> Result<Vec<Input>, &'static str> {
        let named = |field: &'static str, column: &Option<String>| column.as_deref().map(|c| Input::new(field, c)).ok_or(field);
        let all = |field: &'static str, columns: Option<&[String]>| {
            let columns = columns.unwrap_or_default();
            columns.iter().map(|column| Input::new(field, column)).collect()
        };
        let one = |field: &'static str, column: &Option<OneColumn>| column.as_ref().map(|c| Input::one(field, c)).ok_or(field);
        let with_height = |across: [Input; 2], height: &dyn Fn() -> Result<Input, &'static str>| {
            let height = if whole(name).is_some() { None } else { Some(height()?) };
            Ok(across.into_iter().chain(height).collect())
        };
        let vertical = || match (&spec.down, &spec.up) {
            (Some(_), Some(_)) => Err("down` or `up` (one of them, not both)"),
            (down, None) => one("down", down),
            (None, up) => one("up", up),
        };
        match self {
            Self::Vector => Ok(vector(name, spec)),
            Self::Course => with_height([one("speed", &spec.speed)?, one("course", &spec.course)?], &vertical),
            Self::Quaternion => Ok(all("quaternion", spec.quaternion.as_ref().map(|q| &q[..]))),
            Self::Dcm => Ok(all("dcm", spec.dcm.as_ref().map(|m| &m[..]))),
            Self::Rpy => Ok(all("rpy", spec.rpy.as_ref().map(|angles| &angles[..]))),
            Self::Euler => Ok(all("euler.columns", spec.euler.as_ref().map(|euler| &euler.columns[..]))),
            Self::Geodetic => {
                let across = [named("latitude", &spec.latitude)?, named("longitude", &spec.longitude)?];
                with_height(across, &|| named("height", &spec.height))
            }
            Self::Ecef => Ok(all("ecef", spec.ecef.as_ref().map(|axes| &axes[..]))),
            Self::Utm => {
                let utm = spec.utm.as_ref().ok_or("utm")?;
                let across = [Input::new("utm.easting", &utm.easting), Input::new("utm.northing", &utm.northing)];
                with_height(across, &|| named("height", &spec.height))
            }
            Self::Local => with_height([named("north", &spec.north)?, named("east", &spec.east)?], &vertical),
        }
    }

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Vector => "a vector",
            Self::Course => "a speed with its course",
            Self::Quaternion => "a quaternion",
            Self::Dcm => "a rotation matrix",
            Self::Rpy => "roll, pitch and heading",
            Self::Euler => "Euler angles",
            Self::Geodetic | Self::Ecef | Self::Utm | Self::Local => "a position",
        }
    }

    pub(super) const fn example(self) -> &'static str {
        match self {
            Self::Geodetic => "write e.g. `{ latitude = \"lat\", longitude = \"lon\", height = \"h\", unit = \"deg\" }`",
            Self::Utm => "write e.g. `{ utm = { easting = \"e\", northing = \"n\", zone = 32, hemisphere = \"north\" }, height = \"h\" }`",
            Self::Course => {
                "write e.g. `{ speed = { column = \"SOG\", unit = \"kn\" }, course = { column = \"COG\", unit = \"deg\" }, down = \"vd\" }`"
            }
            Self::Vector => "write e.g. `{ columns = [\"x\", \"y\", \"z\"] }`, or `{ column = \"speed\" }` for one number",
            _ => "write e.g. `{ north = \"n\", east = \"e\", down = \"d\" }`",
        }
    }

    /// Whether it makes an attitude from angles.
    pub(super) const fn is_angles(self) -> bool {
        matches!(self, Self::Rpy | Self::Euler)
    }

    /// Whether it makes an attitude.
    pub(super) const fn is_attitude(self) -> bool {
        matches!(self, Self::Quaternion | Self::Dcm) || self.is_angles()
    }

    /// Keys that are given but have no meaning for this form.
    pub(super) fn misfits(self, name: &str, spec: &ChannelSpec) -> Vec<&'static str> {
        let (vector, attitude) = (self == Self::Vector, self.is_attitude());
        let is_turned = vector && spec.enu.is_none();
        let is_horizontal = whole(name).is_some();
        let has_height = matches!(self, Self::Geodetic | Self::Utm) && !is_horizontal;
        let keys = [
            ("unit", spec.unit.is_some(), !matches!(self, Self::Quaternion | Self::Dcm)),
            ("height", spec.height.is_some(), has_height),
            ("height_unit", spec.height_unit.is_some(), has_height),
            ("down", spec.down.is_some(), !is_horizontal),
            ("up", spec.up.is_some(), !is_horizontal),
            ("scale", spec.scale.is_some(), vector),
            ("offset", spec.offset.is_some(), vector || self.is_angles()),
            ("variance", spec.variance, vector),
            ("increment", spec.increment, vector),
            ("average", spec.average, vector),
            ("rotation", spec.rotation.is_some(), is_turned || attitude),
            ("navigation_rotation", spec.navigation_rotation.is_some(), attitude),
            ("inverse", spec.inverse, attitude),
        ];
        keys.into_iter()
            .filter(|(_, is_given, fits)| *is_given && !fits)
            .map(|(key, ..)| key)
            .collect()
    }
}

/// The inputs of a vector.
fn vector(name: &str, spec: &ChannelSpec) -> Vec<Input> {
    if let Some(OneOrMany(columns)) = &spec.column {
        return vec![Input::sum("column", columns)];
    }
    if let Some([east, north, up]) = &spec.enu {
        let down = Input {
            is_reversed: !(spec.variance || Channel::is_sigma(name)),
            ..Input::new("enu", up)
        };
        return vec![Input::new("enu", north), Input::new("enu", east), down];
    }
    let columns = spec.columns.as_deref().unwrap_or_default();
    columns.iter().map(|OneOrMany(columns)| Input::sum("columns", columns)).collect()
}

/// The turns of Euler angles; `Err` describes the mistake in their order.
pub(super) fn turns(spec: &ChannelSpec) -> Option<Result<Turns, String>> {
    spec.euler.as_ref().map(|euler| Turns::new(&euler.order))
}

/// The zone of a position on the grid; `Err` if no zone has this number.
pub(super) fn zone(spec: &ChannelSpec) -> Option<Result<Zone, String>> {
    let utm = spec.utm.as_ref()?;
    let zone = Zone::new(utm.zone, utm.hemisphere == Hemisphere::South);
    Some(zone.ok_or_else(|| format!("there are zones 1 to 60, not {}", utm.zone)))
}
