//! The declaration of a source that reads a table of columns.

/// Declares the sources of a format of columns: the table `[source.NAME]`, its block and its
/// [`LogFormat`](fusion::source::LogFormat).
macro_rules! column_format {
    (
        $(#[$about:meta])*
        $Spec:ident opens $open:ident as $name:tt;
        signature $signature:path;
        example $example:literal;
    ) => {
        fusion::format_spec! {
            $(#[$about])*
            pub struct $Spec {
                /// The file, relative to the data directory.
                path: std::path::PathBuf,
                /// The clock: the column of the stamps and their meaning.
                time: fusion::source::decode::TimeSpec,
            }
        }

        fusion::models::register! { Source, $name, $Spec, $example }

        static FORMAT: fusion::source::LogFormat = fusion::source::LogFormat {
            name: $signature.name,
            clock: None,
            endings: $signature.endings,
            recognises: $signature.recognises,
            read: |path| {
                let context = fusion::source::OpenContext::default();
                let rows = $open(&fusion::source::DataFile::new(path, &context))?;
                Ok(vec![rows.table(path, &FORMAT)?])
            },
        };

        fusion::inventory::submit! { FORMAT }

        #[typetag::deserialize(name = $name)]
        impl fusion::source::SourceSpec for $Spec {
            fn files(&self) -> Vec<std::path::PathBuf> {
                vec![self.path.clone()]
            }

            fn channels(&self) -> Result<Vec<fusion::rows::ProvidedChannel>, Vec<fusion::models::block::BuildError>> {
                Ok(self.rows().checked()?.provided())
            }

            fn time_zero(&self) -> Option<i64> {
                self.rows().time_zero()
            }

            fn open(
                &self,
                context: &fusion::source::OpenContext,
            ) -> Result<Box<dyn fusion::rows::RowStream>, fusion::rows::SourceError> {
                let plan = self.rows().checked()?;
                let file = fusion::source::DataFile::new(&self.path, context);
                plan.decode($open(&file)?, &file, context)
            }

            fn open_rows(
                &self,
                rows: Box<dyn fusion::source::decode::RawRows>,
                context: &fusion::source::OpenContext,
            ) -> Result<Box<dyn fusion::rows::RowStream>, fusion::rows::SourceError> {
                let file = fusion::source::DataFile::new(&self.path, context);
                self.rows().checked()?.decode(rows, &file, context)
            }
        }
    };
}

pub(super) use column_format;
