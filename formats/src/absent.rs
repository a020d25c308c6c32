//! Formats whose feature is off: their logs are recognised, and the error says what to do.

use crate::signature::Signature;
use fusion::models::block::BuildError;
use fusion::rows::DataError;

/// The error at the `type` of a source.
pub(crate) fn declared(of: &Signature) -> BuildError {
    let message = format!("this program was built without the feature `{}`", of.name);
    BuildError::at("type", message).help(help(of))
}

/// The error about a file.
pub(crate) fn file(of: &Signature, path: &std::path::Path) -> DataError {
    let message = format!(
        "this is a log of the format `{0}`, and this program was built without the feature `{0}`",
        of.name
    );
    DataError::new(path.display().to_string(), message).help(help(of))
}

/// The error about estimates in this format.
pub(crate) fn unwritable(of: &Signature) -> String {
    format!("this program was built without the feature `{}`: {}", of.name, help(of))
}

fn help(of: &Signature) -> String {
    format!(
        "build it with the feature: `cargo build --release --features {}`, or with all formats: `--features logs`",
        of.name
    )
}

/// Declares a format whose feature is off.
#[allow(unused_macros, reason = "a program may be built with all formats")]
macro_rules! absent_format {
    ($Spec:ident, $name:tt, $signature:path) => {
        /// A source whose format needs a feature of this crate. Its keys are not read.
        #[derive(Debug, serde::Deserialize, schemars::JsonSchema)]
        struct $Spec {
            /// The file.
            path: std::path::PathBuf,
        }

        fusion::models::register! { Source, $name, $Spec, "path = \"log\"" }

        static FORMAT: fusion::source::LogFormat = fusion::source::LogFormat {
            name: $signature.name,
            clock: None,
            endings: $signature.endings,
            recognises: $signature.recognises,
            read: |path| Err($crate::absent::file(&$signature, path).into()),
        };

        fusion::inventory::submit! { FORMAT }

        #[typetag::deserialize(name = $name)]
        impl fusion::source::SourceSpec for $Spec {
            fn files(&self) -> Vec<std::path::PathBuf> {
                vec![self.path.clone()]
            }

            fn channels(&self) -> Result<Vec<fusion::rows::ProvidedChannel>, Vec<fusion::models::block::BuildError>> {
                Err(vec![$crate::absent::declared(&$signature)])
            }

            fn open(&self, _context: &fusion::source::OpenContext) -> Result<Box<dyn fusion::rows::RowStream>, fusion::rows::SourceError> {
                Err($crate::absent::declared(&$signature).into())
            }
        }
    };
}

#[allow(unused_imports, reason = "a program may be built with all formats")]
pub(crate) use absent_format;
