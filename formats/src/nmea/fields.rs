//! The fields of the types of sentences.

use super::sentence::Sentence;
use crate::messages::Cells;

/// The columns of a type of sentences, with the names of `pynmeagps`. A column is a number, unless it is one of
/// [`TEXTS`]; the unit is after a colon. A latitude and a longitude take their sign from the next field.
const KINDS: [(&str, &str); 20] = [
    (
        "GGA",
        "utc lat:deg NS lon:deg EW quality numSV HDOP alt:m altUnit sep:m sepUnit diffAge:s diffStation",
    ),
    ("GLL", "lat:deg NS lon:deg EW utc status posMode"),
    (
        "GNS",
        "utc lat:deg NS lon:deg EW posMode numSV HDOP alt:m sep:m diffAge:s diffStation navStatus",
    ),
    (
        "GSA",
        "opMode navMode svid_01 svid_02 svid_03 svid_04 svid_05 svid_06 svid_07 svid_08 svid_09 svid_10 svid_11 svid_12 PDOP HDOP VDOP systemId",
    ),
    ("GST", "utc rangeRms:m stdMajor:m stdMinor:m orient:deg stdLat:m stdLong:m stdAlt:m"),
    ("HDT", "headingT:deg headingTu"),
    ("HDM", "headingM:deg headingMag"),
    ("HDG", "headingM:deg deviation:deg deviationEW variation:deg variationEW"),
    (
        "RMC",
        "utc status lat:deg NS lon:deg EW spd:kn cog:deg date mv:deg mvEW posMode navStatus",
    ),
    ("THS", "headt:deg mi"),
    (
        "VTG",
        "cogt:deg cogtUnit cogm:deg cogmUnit sogn:kn sognUnit sogk:km/h sogkUnit posMode",
    ),
    ("ZDA", "utc day month year ltzh ltzn"),
    ("ROT", "rot:deg/min valid"),
    (
        "VBW",
        "longwaterspd:kn transwaterspd:kn waterspdstatus longgroundspd:kn transgroundspd:kn groundspdstatus sterntranswaterspd:kn sternwaterspdstatus sterntransgroundspd:kn sterngroundspdstatus",
    ),
    ("VHW", "hdgT:deg hgdTu hdgM:deg hgdMu spdN:kn spdNu spdK:km/h spdKu"),
    ("DPT", "depth:m offset:m rangescale:m"),
    ("DBT", "depthf:ft depthfu depthm:m depthmu depthfath depthfathu"),
    ("MWV", "angle:deg reference speed speedu status"),
    ("TXT", "numMsg msgNum msgType text"),
    ("GBS", "utc errLat:m errLon:m errAlt:m svid prob bias:m stddev:m systemId signalId"),
];

/// The columns with text.
const TEXTS: [&str; 37] = [
    "utc",
    "NS",
    "EW",
    "altUnit",
    "sepUnit",
    "status",
    "posMode",
    "navStatus",
    "opMode",
    "systemId",
    "signalId",
    "headingTu",
    "headingMag",
    "deviationEW",
    "variationEW",
    "date",
    "mvEW",
    "mi",
    "cogtUnit",
    "cogmUnit",
    "sognUnit",
    "sogkUnit",
    "valid",
    "waterspdstatus",
    "groundspdstatus",
    "sternwaterspdstatus",
    "sterngroundspdstatus",
    "hgdTu",
    "hgdMu",
    "spdNu",
    "spdKu",
    "depthfu",
    "depthmu",
    "depthfathu",
    "reference",
    "speedu",
    "text",
];

/// The column of the stamps \[ns\] of GPS time.
pub(crate) const STAMP: &str = "time";

/// The columns of a type of sentences.
#[derive(Clone, Debug)]
pub(crate) struct Columns {
    pub(crate) names: Vec<String>,
    units: Vec<Option<&'static str>>,
    forms: Vec<Form>,
}

/// The form of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Text,
    Number,
    /// Degrees and minutes.
    Angle,
}

impl Columns {
    /// The columns of an address. The fields of a type that is not known are texts.
    pub(crate) fn of(sentence: &Sentence<'_>) -> Self {
        let kind = Sentence::kind(sentence.address);
        let mut columns = Self {
            names: vec![STAMP.to_owned()],
            units: vec![None],
            forms: Vec::new(),
        };
        let Some((_, known)) = KINDS.iter().find(|(name, _)| *name == kind) else {
            for k in 1..=sentence.fields().count() {
                columns.add(&format!("field_{k:02}"), None, Form::Text);
            }
            return columns;
        };
        for field in known.split(' ') {
            let (name, unit) = field.split_once(':').map_or((field, None), |(name, unit)| (name, Some(unit)));
            let form = match name {
                "lat" | "lon" => Form::Angle,
                _ if TEXTS.contains(&name) => Form::Text,
                _ => Form::Number,
            };
            columns.add(name, unit, form);
        }
        columns
    }

    fn add(&mut self, name: &str, unit: Option<&'static str>, form: Form) {
        self.names.push(name.to_owned());
        self.units.push(unit);
        self.forms.push(form);
    }

    /// A column with its unit.
    pub(crate) fn label(&self, column: usize) -> Option<String> {
        let unit = (*self.units.get(column)?)?;
        Some(format!("{} [{unit}]", self.names[column]))
    }

    /// Adds the cells of a sentence after its stamp.
    pub(crate) fn decode(&self, sentence: &Sentence<'_>, cells: &mut Cells) -> Result<(), String> {
        let mut fields = sentence.fields();
        for (form, name) in self.forms.iter().zip(&self.names[1..]) {
            let Some(field) = fields.next() else { break };
            let wrong = || format!("its `{name}` is `{}`", String::from_utf8_lossy(field));
            match form {
                _ if field.is_empty() => cells.empty(),
                Form::Text => cells.text(field),
                Form::Number => cells.number(number(field).ok_or_else(wrong)?),
                Form::Angle => {
                    let side = fields.clone().next().unwrap_or_default();
                    cells.number(angle(field, side).ok_or_else(wrong)?);
                }
            }
        }
        Ok(())
    }
}

fn number(field: &[u8]) -> Option<f64> {
    let text = core::str::from_utf8(field).ok()?;
    text.trim().parse().ok().filter(|number: &f64| number.is_finite())
}

/// An angle \[deg\] of degrees and minutes, negative in the south and in the west.
fn angle(field: &[u8], side: &[u8]) -> Option<f64> {
    let point = field.iter().position(|byte| *byte == b'.').unwrap_or(field.len());
    // The minutes have two digits before the point; a small angle may lack the degrees.
    let (degrees, minutes) = field.split_at(point.saturating_sub(2));
    let degrees = if degrees.is_empty() { 0.0 } else { number(degrees)? };
    let minutes = number(minutes).filter(|minutes| (0.0..60.0).contains(minutes))?;
    let size = degrees + minutes / 60.0;
    match side {
        b"N" | b"E" => Some(size),
        b"S" | b"W" => Some(-size),
        _ => None,
    }
}
