//! The ways to declare a channel.

use crate::source::decode::spec::ChannelSpec;

/// The ways to make a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Vector,
    Quaternion,
    Euler,
    Geodetic,
    Local,
}

pub(super) fn forms(spec: &ChannelSpec) -> Vec<Form> {
    let any = |keys: &[&Option<String>]| keys.iter().any(|key| key.is_some());
    let asked = [
        (spec.column.is_some(), Form::Vector),
        (spec.columns.is_some(), Form::Vector),
        (spec.quaternion.is_some(), Form::Quaternion),
        (spec.rpy.is_some(), Form::Euler),
        (any(&[&spec.latitude, &spec.longitude, &spec.height]), Form::Geodetic),
        (any(&[&spec.north, &spec.east, &spec.down, &spec.up]), Form::Local),
    ];
    asked.into_iter().filter(|(is_asked, _)| *is_asked).map(|(_, form)| form).collect()
}

impl Form {
    /// Field and column, or the field that is missing.
    pub(super) fn columns(self, spec: &ChannelSpec) -> Result<Vec<(&'static str, String)>, &'static str> {
        let named = |field: &'static str, column: &Option<String>| column.clone().map(|c| (field, c)).ok_or(field);
        let all = |field: &'static str, columns: &[String]| columns.iter().map(|c| (field, c.clone())).collect();
        match self {
            Self::Vector => match (&spec.column, &spec.columns) {
                (Some(column), _) => Ok(vec![("column", column.clone())]),
                (None, columns) => Ok(all("columns", columns.as_deref().unwrap_or_default())),
            },
            Self::Quaternion => Ok(all("quaternion", spec.quaternion.as_ref().map_or(&[][..], |q| q))),
            Self::Euler => {
                // Three angles make four numbers: the last cell is read twice.
                let [roll, pitch, yaw] = spec.rpy.clone().unwrap_or_default();
                Ok(all("rpy", &[roll, pitch, yaw.clone(), yaw]))
            }
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

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Vector => "a vector",
            Self::Quaternion => "a quaternion",
            Self::Euler => "roll, pitch and heading",
            Self::Geodetic | Self::Local => "a position",
        }
    }

    pub(super) const fn example(self) -> &'static str {
        match self {
            Self::Geodetic => "write e.g. `{ latitude = \"lat\", longitude = \"lon\", height = \"h\", unit = \"deg\" }`",
            _ => "write e.g. `{ north = \"n\", east = \"e\", down = \"d\" }`",
        }
    }

    /// Keys that are given and mean nothing for this form.
    pub(super) fn misfits(self, spec: &ChannelSpec) -> Vec<&'static str> {
        let (vector, euler) = (self == Self::Vector, self == Self::Euler);
        let quaternion = self == Self::Quaternion || euler;
        let keys = [
            ("unit", spec.unit.is_some(), self != Self::Quaternion),
            ("height_unit", spec.height_unit.is_some(), self == Self::Geodetic),
            ("scale", spec.scale.is_some(), vector),
            ("offset", spec.offset.is_some(), vector || euler),
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
