//! The files of a compiled design.

use crate::assemble::{Unwritten, body};
use crate::interface;
use crate::memory::Needs;
use fusion::assembly::{Plan, StreamLayout, declared_streams, plan};
use fusion::config::{Diagnostic, Diagnostics};
use fusion::design::{Design, OrderSpec};
use fusion::provenance::Provenance;
use fusion_core::state::Kind;
use fusion_models::plausible::Bounds;
use std::fs;
use std::io;
use std::path::Path;

/// A program of the host that replays rows.
const REPLAY: &str = include_str!("replay.rs.txt");

/// The use of the written crate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Target {
    /// A program in Rust.
    #[default]
    Rust,
    /// A library and a header for a program in C or C++.
    C,
}

/// A Rust crate that assembles the filter of a design.
#[derive(Clone, Debug)]
pub struct Program {
    /// The name of the crate.
    pub name: String,
    /// Each file: its path in the folder of the crate, and its text.
    pub files: Vec<(&'static str, String)>,
}

impl Program {
    /// Writes its files; creates the folder if necessary.
    ///
    /// # Errors
    /// The errors of the file system.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        for (path, text) in &self.files {
            let path = folder.join(path);
            fs::create_dir_all(path.parent().unwrap_or(folder))?;
            fs::write(path, text)?;
        }
        Ok(())
    }
}

/// Compiles a design. `crates` is the folder with the crates of this framework, for the dependency on `fusion-vehicle`.
/// The program states its memory if it was [measured](crate::measure).
///
/// # Errors
/// The mistakes of the design; each part of it that no program can be written for, with its place.
pub fn compile(design: &Design, name: &str, crates: &Path, target: Target, needs: Option<Needs>) -> Result<Program, Diagnostics> {
    let plan = plan(design, declared_streams(design)?)?;
    refuse(design, &plan)?;
    let body = body(&plan).map_err(|Unwritten { what, table, help }| {
        let path: Vec<&str> = table.split('.').collect();
        refusal(design, &path, format!("{what} cannot be compiled"), help)
    })?;
    let provenance = Provenance::of(design, None);
    let rows: String = plan
        .streams
        .iter()
        .enumerate()
        .map(|(number, stream)| row(number, stream))
        .collect();
    let streams: Vec<String> = plan.streams.iter().map(|s| format!("({:?}, {})", s.name, s.width())).collect();
    let library = format!(
        "//! {description}\n\
         //!\n\
         //! Written by `fusion compile` {version} from {file}, design {hash}. Changes are lost when it is written again.\n\
         \n\
         #![no_std]\n\
         #![{lint}(unsafe_code)]\n\
         #![allow(clippy::all, unused_imports)]\n\
         \n\
         extern crate alloc;\n\
         {interface}\
         \n\
         use alloc::boxed::Box;\n\
         use alloc::sync::Arc;\n\
         use fusion_vehicle::fusion_core::filter::{{Filter, Parts}};\n\
         use fusion_vehicle::fusion_core::model::{{Process, Size}};\n\
         use fusion_vehicle::fusion_core::runner::{{InitialiserUnit, Runner, Sensor, StageUnit}};\n\
         use fusion_vehicle::fusion_core::{{chart, covariance, filter}};\n\
         use fusion_vehicle::Vehicle;\n\
         use fusion_vehicle::fusion_models::plausible::{{Bounds, Possible}};\n\
         \n\
         /// The hash of the design.\n\
         pub const DESIGN: &str = {hash:?};\n\
         \n\
         /// The hash of what the design says of its filter: the checkpoints of this filter have it.\n\
         pub const FINGERPRINT: u64 = {fingerprint:#018x};\n\
         \n\
         /// The streams in order of their numbers: their names, and the count of numbers in a row. In SI, angles in radians:\n\
         ///\n\
         {rows}\
         pub const STREAMS: [(&str, usize); {count}] = [{streams}];\n\
         \n\
         {memory}\
         /// The possible numbers of the channels, for each stream.\n\
         const BOUNDS: [&[Bounds]; {count}] = [\n\
         {bounds}\
         ];\n\
         \n\
         /// The filter, before its first row.\n\
         #[must_use]\n\
         pub fn assemble() -> Vehicle {{\n\
         {body}\
         }}\n",
        description = design.run.description.lines().collect::<Vec<_>>().join("\n//! "),
        version = provenance.version,
        file = provenance.design,
        hash = provenance.hash,
        fingerprint = plan.fingerprint(),
        lint = if target == Target::C { "deny" } else { "forbid" },
        interface = if target == Target::C {
            "\n#[allow(unsafe_code)]\nmod interface;\n"
        } else {
            ""
        },
        count = streams.len(),
        memory = needs.map(memory).unwrap_or_default(),
        bounds = plan.streams.iter().map(bounds).collect::<String>(),
        streams = streams.join(", "),
    );
    let mut files = vec![("Cargo.toml", manifest(name, crates, target)), ("src/lib.rs", library)];
    match target {
        Target::Rust => files.push(("examples/replay.rs", REPLAY.replace("FILTER", &name.replace('-', "_")))),
        Target::C => files.extend(interface::files(design, &plan, name, &provenance, needs)),
    }
    Ok(Program {
        name: name.to_owned(),
        files,
    })
}

/// The manifest of the crate.
fn manifest(name: &str, crates: &Path, target: Target) -> String {
    let (core, models, vehicle, abi) = (
        crates.join("fusion-core"),
        crates.join("models"),
        crates.join("vehicle"),
        crates.join("abi"),
    );
    let (kind, dependency, of) = match target {
        Target::Rust => ("", String::new(), "fusion-vehicle"),
        // A library for C cannot unwind.
        Target::C => (
            "[lib]\n\
             crate-type = [\"staticlib\"]\n\
             \n\
             [profile.release]\n\
             panic = \"abort\"\n\
             lto = \"fat\"\n\
             codegen-units = 1\n\
             \n\
             # The products of matrices are fast, also if the rest is built for size.\n\
             [profile.release.package.fusion-kernels]\n\
             opt-level = 2\n\
             \n\
             [profile.dev]\n\
             panic = \"abort\"\n\
             \n",
            format!("fusion-abi = {{ path = {abi:?}, default-features = false }}\n"),
            "fusion-abi",
        ),
    };
    format!(
        "# Written by `fusion compile`.\n\
         [workspace]\n\
         \n\
         [package]\n\
         name = {name:?}\n\
         version = \"0.1.0\"\n\
         edition = \"2024\"\n\
         \n\
         {kind}\
         [dependencies]\n\
         {dependency}\
         fusion-core = {{ path = {core:?}, default-features = false }}\n\
         fusion-models = {{ path = {models:?}, default-features = false }}\n\
         fusion-vehicle = {{ path = {vehicle:?}, default-features = false }}\n\
         nalgebra = {{ version = \"0.35\", default-features = false, features = [\"alloc\"] }}\n\
         \n\
         [features]\n\
         default = [\"libm\"]\n\
         # Mathematics by the crate `libm`: the same bits on every platform.\n\
         libm = [\"{of}/libm\"]\n\
         # Mathematics of the standard library, as `fusion run` without its feature `libm`.\n\
         std = [\"{of}/std\"]\n",
    )
}

/// The constants of the memory.
fn memory(Needs { feed, all }: Needs) -> String {
    format!(
        "/// The bytes of memory that the filter needs to be assembled and fed with the rows of `rows.bin`, in an arena of\n\
         /// `fusion-abi`. Measured with 64 bits; a processor with 32 bits needs less.\n\
         pub const MEMORY: usize = {feed};\n\
         \n\
         /// The same, and to predict, to write a checkpoint and to continue from one.\n\
         pub const MEMORY_ALL: usize = {all};\n\
         \n"
    )
}

/// The line of the documentation that says what a row of a stream is.
fn row(number: usize, stream: &StreamLayout) -> String {
    format!("/// - {number}, `{}`: {}\n", stream.name, channels(stream))
}

/// The bounds of the channels of a stream, as a list in Rust.
fn bounds(stream: &StreamLayout) -> String {
    let of = |b: Bounds| {
        // The names of an enum as it prints itself are those of Rust.
        format!(
            "Bounds {{ first: {}, width: {}, numbers: Possible::{:?} }}",
            b.first, b.width, b.numbers
        )
    };
    let channels: Vec<String> = stream.bounds().into_iter().map(of).collect();
    format!("    &[{}],\n", channels.join(", "))
}

/// The channels of a row, in their order.
pub(crate) fn channels(stream: &StreamLayout) -> String {
    let channels: Vec<String> = stream.channels.iter().map(|c| format!("{} × `{}`", c.width, c.name)).collect();
    channels.join(", ")
}

/// An error at the place of a table or key, as far as the file has it.
fn refusal(design: &Design, path: &[&str], message: String, help: &str) -> Diagnostic {
    let node = path.iter().try_fold(design.document.root(), |node, key| node.get(key));
    let error = Diagnostic::error(message).help(help.to_owned());
    match node {
        Some(node) => error.at(node.place()),
        None => error,
    }
}

/// Refuses what no program can be written for.
fn refuse(design: &Design, plan: &Plan) -> Result<(), Diagnostics> {
    let at = |path: &[&str], message: String, help: &str| refusal(design, path, message, help);
    let mut d = Diagnostics::new();
    if design.filter.bank.is_some() {
        let help = "leave `bank` out in a variant for the vehicle: one hypothesis";
        d.push(at(&["filter", "bank"], "a bank of hypotheses cannot be compiled".to_owned(), help));
    }
    if design.run.order != OrderSpec::Hold {
        let help = "use `order = \"hold\"`, which holds rows back for late ones";
        d.push(at(
            &["run", "order"],
            "a filter that goes back for late rows cannot be compiled".to_owned(),
            help,
        ));
    }
    for block in plan.layout.blocks() {
        if let Kind::Custom(_) = block.kind {
            let message = format!("the state `{}` cannot be compiled: its manifold is of another crate", block.name);
            d.push(Diagnostic::error(message).help("use a block of this framework in a variant for the vehicle"));
        }
    }
    d.unless_errors(())
}
