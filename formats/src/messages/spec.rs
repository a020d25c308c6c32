//! The declaration of a source that reads a log of messages.

/// Declares the sources of a format of messages: the table `[source.NAME]`, its block and its [`LogFormat`].
///
/// [`LogFormat`]: fusion::source::LogFormat
#[allow(unused_macros, reason = "a program may be built without any format")]
macro_rules! message_format {
    (
        $(#[$about:meta])*
        $Spec:ident reads $Reader:ty as $name:tt;
        stamps in $stamp:literal, unit $unit:literal, since $origin:expr;
        signature $signature:path;
        example $example:literal;
    ) => {
        fusion::format_spec! {
            $(#[$about])*
            pub struct $Spec {
                /// The file, relative to the data directory; gzip is recognised by its content.
                path: std::path::PathBuf,
                /// The topic, as `fusion inspect` shows it. A log with one topic needs no name.
                topic: Option<String>,
                /// A list of messages in each message, such as `transforms`: its elements are the rows. `valid`
                /// selects among them.
                each: Option<String>,
                /// The clock. The format defines the unit and the zero point of its stamps.
                #[serde(default)]
                time: fusion::source::decode::OwnTimeSpec,
            }
        }

        fusion::models::register! { Source, $name, $Spec, $example }

        const CLOCK: fusion::source::OwnClock = fusion::source::OwnClock {
            unit: $unit,
            counts_from: $origin,
        };

        static FORMAT: fusion::source::LogFormat = fusion::source::LogFormat {
            name: $signature.name,
            clock: Some(CLOCK),
            endings: $signature.endings,
            recognises: $signature.recognises,
            read: |path| $crate::messages::tables::<$Reader>(path, &FORMAT),
        };

        fusion::inventory::submit! { FORMAT }

        impl $Spec {
            fn plan(&self) -> Result<fusion::source::decode::Plan<'_>, Vec<fusion::models::block::BuildError>> {
                self.rows().of_own_clock($stamp, CLOCK).checked()
            }
        }

        #[typetag::deserialize(name = $name)]
        impl fusion::source::SourceSpec for $Spec {
            fn files(&self) -> Vec<std::path::PathBuf> {
                vec![self.path.clone()]
            }

            fn channels(&self) -> Result<Vec<fusion::rows::ProvidedChannel>, Vec<fusion::models::block::BuildError>> {
                Ok(self.plan()?.provided())
            }

            fn time_zero(&self) -> Option<i64> {
                self.rows().of_own_clock($stamp, CLOCK).time_zero()
            }

            fn open(
                &self,
                context: &fusion::source::OpenContext,
            ) -> Result<Box<dyn fusion::rows::RowStream>, fusion::rows::SourceError> {
                let file = fusion::source::DataFile::new(&self.path, context);
                let rows = $crate::messages::open::<$Reader>(&file, context, self.topic.as_deref(), self.each.as_deref())?;
                self.plan()?.decode(rows, &file, context)
            }

            fn open_rows(
                &self,
                rows: Box<dyn fusion::source::decode::RawRows>,
                context: &fusion::source::OpenContext,
            ) -> Result<Box<dyn fusion::rows::RowStream>, fusion::rows::SourceError> {
                self.plan()?
                    .decode(rows, &fusion::source::DataFile::new(&self.path, context), context)
            }
        }
    };
}

#[allow(unused_imports, reason = "a program may be built without any format")]
pub(crate) use message_format;
