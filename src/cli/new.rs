//! `fusion new`: a first design, and the parts that it includes, as files.

use super::{Failure, builtin, print};
use clap::{Args, ValueEnum};
use fusion::config::{Diagnostic, Diagnostics, Document, Value};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The kind of vehicle of a design.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Vehicle {
    /// Inertial unit, GNSS, odometer, motion constraints.
    Car,
    /// Inertial unit, GNSS, barometer, magnetometer; take-off, hover, landing.
    Drone,
    /// A boat in current and waves: inertial unit, GNSS, magnetometer, water log.
    Boat,
    /// Skid steering: inertial unit, RTK, track speeds; steered by its estimate.
    Rover,
    /// Under water: inertial unit, Doppler log, depth, USBL.
    Auv,
    /// Inertial unit on a foot, zero-velocity updates.
    Person,
}

impl Vehicle {
    /// Its template: the text of `configs/templates/NAME.toml`.
    const fn template(self) -> &'static str {
        match self {
            Self::Car => include_str!("../../configs/templates/car.toml"),
            Self::Drone => include_str!("../../configs/templates/drone.toml"),
            Self::Boat => include_str!("../../configs/templates/boat.toml"),
            Self::Rover => include_str!("../../configs/templates/rover.toml"),
            Self::Auv => include_str!("../../configs/templates/auv.toml"),
            Self::Person => include_str!("../../configs/templates/person.toml"),
        }
    }
}

#[derive(Debug, Args)]
pub(super) struct NewArgs {
    /// The design to write: NAME.toml, and its parts in the folder `parts` next to it.
    #[arg(required_unless_present_any = ["list", "part"])]
    name: Option<PathBuf>,
    /// The vehicle of the design.
    #[arg(
        long,
        value_enum,
        value_name = "VEHICLE",
        required_unless_present_any = ["list", "part"],
        hide_possible_values = true
    )]
    from: Option<Vehicle>,
    /// Writes a part of the library into the folder `parts`, to include in a design: `gnss/neo-m8`.
    #[arg(long, value_name = "PART", conflicts_with_all = ["name", "from"])]
    part: Vec<String>,
    /// Lists the vehicles and the parts.
    #[arg(long, conflicts_with_all = ["name", "from", "part"])]
    list: bool,
}

/// Writes a design that runs in simulation without changes.
pub(super) fn new(args: &NewArgs) -> Result<(), Failure> {
    if !args.part.is_empty() {
        return add(&args.part);
    }
    let (Some(name), Some(vehicle)) = (&args.name, args.from) else {
        return print(&list());
    };
    let mut path = name.clone();
    if path.extension().is_none_or(|e| e != "toml") {
        path.as_mut_os_string().push(".toml");
    }
    let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
    let shown = path.display().to_string();
    let design = design(vehicle, &shown);
    if path.exists() {
        let help = "give another name; a design is never overwritten";
        return Err(Failure::Mistakes(Diagnostic::error(format!("`{shown}` exists")).help(help).into()));
    }
    let mut parts = BTreeMap::new();
    collect(Path::new(""), &design, &mut parts);
    let absent = write_parts(&folder, &parts)?;
    write(&path, &design)?;
    print(&next_steps(&shown, &folder, absent))
}

/// Writes parts of the library, and the parts that they include, below the current folder.
fn add(names: &[String]) -> Result<(), Failure> {
    let mut parts = BTreeMap::new();
    for name in names {
        let path = part_path(name);
        let Some((_, text)) = builtin::parts().find(|(known, _)| *known == path) else {
            let known: Vec<&str> = builtin::parts().map(|(path, _)| part_name(path)).collect();
            let unknown = Diagnostic::error(format!("there is no part `{name}`"));
            return Err(Failure::Mistakes(unknown.suggest(name, &known, "parts").into()));
        };
        parts.insert(PathBuf::from(&path), *text);
        collect(Path::new(&path).parent().unwrap_or(Path::new("")), text, &mut parts);
    }
    write_parts(Path::new(""), &parts)?;
    let lines: String = names.iter().map(|name| format!("  \"{}\"\n", part_path(name))).collect();
    print(&format!("To include, as in `include = [\"parts/…\"]`:\n{lines}"))
}

/// The path of a part from configs/, for its short name.
fn part_path(name: &str) -> String {
    format!("parts/{name}.toml")
}

fn part_name(path: &str) -> &str {
    let path = path.strip_prefix("parts/").unwrap_or(path);
    path.strip_suffix(".toml").unwrap_or(path)
}

/// Writes the parts that do not exist yet; returns their number.
fn write_parts(folder: &Path, parts: &BTreeMap<PathBuf, &'static str>) -> Result<usize, Diagnostics> {
    let absent = absent(folder, parts)?;
    for part in &absent {
        write(&folder.join(part), parts[part])?;
    }
    Ok(absent.len())
}

/// Every vehicle with its components, and every part.
fn list() -> String {
    let line = |vehicle: &Vehicle| {
        let value = vehicle.to_possible_value()?;
        let help = value.get_help().map(ToString::to_string).unwrap_or_default();
        Some(format!("  {:<7}{help}\n", value.get_name()))
    };
    let lines: String = Vehicle::value_variants().iter().filter_map(line).collect();
    let mut parts: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (kind, name) in builtin::parts().filter_map(|(path, _)| part_name(path).split_once('/')) {
        parts.entry(kind).or_default().push(name);
    }
    let parts: String = parts
        .iter()
        .map(|(kind, names)| format!("  {kind:<13}{}\n", names.join(", ")))
        .collect();
    format!(
        "Vehicles\n{lines}\nParts\n{parts}\n\
         fusion new NAME --from VEHICLE writes NAME.toml and the parts that it includes\n\
         fusion new --part gnss/neo-m8 writes another part, to include in its place\n"
    )
}

/// The template with the paths of the place where it is written.
fn design(vehicle: Vehicle, name: &str) -> String {
    vehicle.template().replace("\"../parts/", "\"parts/").replace("NAME.toml", name)
}

/// The parts that a text at `folder` includes, directly or through other parts: their paths from configs/ with their
/// texts.
fn collect(folder: &Path, text: &str, parts: &mut BTreeMap<PathBuf, &'static str>) {
    let document = Document::parse("", text).0;
    let Some(Value::Array(paths)) = document.root().get("include").map(|list| list.value()) else {
        return;
    };
    for included in paths.iter().filter_map(|path| path.as_str()) {
        let path = folder.join(included);
        let Some((_, text)) = builtin::parts().find(|(name, _)| Path::new(name) == path) else {
            continue;
        };
        if parts.insert(path.clone(), text).is_none() {
            collect(path.parent().unwrap_or(Path::new("")), text, parts);
        }
    }
}

/// The parts that do not exist yet; an existing part must be the same.
fn absent(folder: &Path, parts: &BTreeMap<PathBuf, &'static str>) -> Result<Vec<PathBuf>, Diagnostics> {
    let (mut absent, mut d) = (Vec::new(), Diagnostics::new());
    for (part, text) in parts {
        let path = folder.join(part);
        match std::fs::read(&path) {
            Ok(there) if there == text.as_bytes() => {}
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => absent.push(part.clone()),
            Ok(_) => d.extend([Diagnostic::error(format!("`{}` exists and is another one", path.display()))
                .help("begin in another folder; a part is never overwritten")]),
            Err(e) => d.extend([Diagnostic::error(format!("`{}` cannot be read: {e}", path.display()))]),
        }
    }
    d.unless_errors(absent)
}

/// Writes a new file, and the folders around it.
fn write(path: &Path, text: &str) -> Result<(), Diagnostics> {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty());
    folder
        .map_or(Ok(()), std::fs::create_dir_all)
        .and_then(|()| std::fs::File::create_new(path))
        .and_then(|mut file| file.write_all(text.as_bytes()))
        .map_err(|e| {
            let message = format!("`{}` cannot be written: {e}", path.display());
            Diagnostic::error(message).help("name a folder that you may write to").into()
        })
}

fn next_steps(design: &str, folder: &Path, parts: usize) -> String {
    let quoted = if design.contains(char::is_whitespace) {
        format!("'{design}'")
    } else {
        design.to_owned()
    };
    let parts = match parts {
        0 => String::new(),
        n => format!(", and {n} parts in {}", folder.join("parts").display()),
    };
    format!(
        "Wrote {design}{parts}.\n\nNext\n  \
         fusion run {quoted} --out results     simulated; open results/report.html\n  \
         fusion montecarlo {quoted} -n 20      is the 1σ of the filter true, over many seeds\n  \
         fusion check {quoted} --resolved      every value with its file and line\n\
         The comments in {design} say what to change for your own vehicle and log.\n"
    )
}
