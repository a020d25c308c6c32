//! Diagnostics: the mistake, its place in the text, and how to correct it.

pub use fusion_models::spelling::did_you_mean;

use super::proposal::Edit;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};

/// A text that diagnostics quote: a file, or an argument of the command line.
#[derive(Debug, PartialEq, Eq)]
pub struct Source {
    /// Its name: the file's path.
    pub name: String,
    /// Its whole content.
    pub text: String,
}

/// Where something was written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Place {
    /// Nowhere in particular.
    #[default]
    Nowhere,
    /// A file whose text is not at hand, such as a log of measurements.
    File {
        /// The file's path.
        path: String,
        /// The line, from 1.
        line: Option<usize>,
    },
    /// A stretch of a text that can be quoted.
    Text {
        /// The text.
        source: Arc<Source>,
        /// Bytes of it.
        span: Range<usize>,
    },
}

impl Place {
    /// Returns true if `inner` is within it.
    pub(crate) fn holds(&self, inner: &Self) -> bool {
        match (self, inner) {
            (Self::Text { source, span }, Self::Text { source: of, span: at }) => {
                source.name == of.name && span.start <= at.start && at.end <= span.end
            }
            _ => false,
        }
    }

    /// A line, from 1, of a data file.
    pub fn row(path: impl Into<String>, line: usize) -> Self {
        Self::File {
            path: path.into(),
            line: Some(line),
        }
    }

    /// The name of its file, and where known its line and column, from 1. The column counts characters.
    #[must_use]
    pub fn position(&self) -> (Option<&str>, Option<usize>, Option<usize>) {
        match self {
            Self::Nowhere => (None, None, None),
            Self::File { path, line } => (Some(path), *line, None),
            Self::Text { source, span } => {
                let before = source.text.get(..span.start).unwrap_or_default();
                let line = before.rsplit('\n').next().unwrap_or_default();
                let number = 1 + before.matches('\n').count();
                (Some(&source.name), Some(number), Some(1 + line.chars().count()))
            }
        }
    }

    /// The text that it is part of.
    pub(super) fn source(&self) -> Option<&Source> {
        match self {
            Self::Text { source, .. } => Some(source),
            _ => None,
        }
    }

    /// A stretch of `source`.
    pub(super) fn text(source: &Arc<Source>, span: Range<usize>) -> Self {
        Self::Text {
            source: Arc::clone(source),
            span,
        }
    }
}

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Nothing can be built.
    Error,
    /// The design can be built, but the user probably meant something else.
    Warning,
}

/// One mistake.
#[must_use]
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// How bad it is.
    pub severity: Severity,
    /// The mistake in one sentence.
    pub message: String,
    /// Where it was made.
    pub place: Place,
    /// A few words next to the underlined text.
    pub label: Option<Box<str>>,
    /// How to correct it.
    pub help: Option<String>,
    /// The rule of advice and its edits; `None` for a mistake of reading. It is in a box, since it is rare.
    pub(crate) advice: Option<Box<Advice>>,
}

/// The rule that found a mistake, and its edits.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Advice {
    rule: &'static str,
    edits: Vec<Edit>,
}

impl Diagnostic {
    /// An error, so far without a place.
    pub fn error(message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Error,
            message: message.into(),
            place: Place::Nowhere,
            label: None,
            help: None,
            advice: None,
        }
    }

    /// A warning, so far without a place.
    pub fn warning(message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Warning,
            ..Self::error(message)
        }
    }

    /// The same as a warning.
    pub fn into_warning(self) -> Self {
        Self {
            severity: Severity::Warning,
            ..self
        }
    }

    /// Sets the place of the mistake.
    pub fn at(self, place: &Place) -> Self {
        Self {
            place: place.clone(),
            ..self
        }
    }

    /// Puts a few words next to the underlined text.
    pub fn label(self, label: impl Into<String>) -> Self {
        Self {
            label: Some(label.into().into_boxed_str()),
            ..self
        }
    }

    /// Sets the help: how to correct the mistake.
    pub fn help(self, help: impl Into<String>) -> Self {
        Self {
            help: Some(help.into()),
            ..self
        }
    }

    /// Sets the rule of advice that found the mistake.
    pub fn rule(mut self, rule: &'static str) -> Self {
        self.advice.get_or_insert_default().rule = rule;
        self
    }

    /// Sets the edits that correct the mistake.
    pub fn edits(mut self, edits: Vec<Edit>) -> Self {
        self.advice.get_or_insert_default().edits = edits;
        self
    }

    /// The rule of advice that found the mistake; `None` for a mistake of reading.
    #[must_use]
    pub fn found_by(&self) -> Option<&'static str> {
        self.advice.as_ref().map(|advice| advice.rule)
    }

    /// The edits of the design that correct the mistake; empty if the correction is not certain.
    #[must_use]
    pub fn corrections(&self) -> &[Edit] {
        self.advice.as_ref().map_or(&[], |advice| &advice.edits)
    }

    /// Adds to the help.
    pub fn and_help(self, more: impl fmt::Display) -> Self {
        let help = match self.help.as_deref() {
            None => more.to_string(),
            Some(question) if question.ends_with('?') => format!("{question} {more}"),
            Some(help) => format!("{help}; {more}"),
        };
        self.help(help)
    }

    /// Suggests the name that was probably meant by `word`: next to the underlined text, or in the help if
    /// the place has no text.
    pub fn meant(self, word: &str, known: &[&str]) -> Self {
        let is_quoted = matches!(self.place, Place::Text { .. });
        match did_you_mean(word, known).map(|meant| format!("did you mean `{meant}`?")) {
            Some(question) if is_quoted => self.label(question),
            Some(question) => self.and_help(question),
            None => self,
        }
    }

    /// As [`meant`](Self::meant), and lists the known names.
    pub fn suggest(self, word: &str, known: &[&str], what: &str) -> Self {
        let diagnostic = self.meant(word, known);
        match known {
            [] => diagnostic,
            _ => diagnostic.and_help(format!("{what}: `{}`", known.join("`, `"))),
        }
    }

    /// It in one line: the place, the mistake and the help, such as `car.toml:3:7: no such block; write …`.
    #[must_use]
    pub fn line(&self) -> String {
        let (file, line, column) = self.place.position();
        let numbers = [line, column].into_iter().flatten().map(|n| n.to_string());
        let place: Vec<String> = file.map(str::to_owned).into_iter().chain(numbers).collect();
        let place = if place.is_empty() {
            String::new()
        } else {
            format!("{}: ", place.join(":"))
        };
        let help = self.help.iter().map(|help| format!("; {help}"));
        let told: String = [place, self.message.clone()].into_iter().chain(help).collect();
        told.replace('\n', " ")
    }

    fn render(&self, renderer: &Renderer) -> String {
        let level = match self.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
        };
        let title = level.primary_title(self.message.as_str());
        let title = match self.found_by() {
            Some(rule) => title.id(rule),
            None => title,
        };
        let mut group = match &self.place {
            Place::Nowhere => Group::with_title(title),
            Place::File { path, line } => {
                let origin = Origin::path(path.as_str());
                title.element(line.iter().fold(origin, |origin, line| origin.line(*line)))
            }
            Place::Text { source, span } => {
                let mark = AnnotationKind::Primary.span(span.clone());
                title.element(
                    Snippet::source(source.text.as_str())
                        .path(source.name.as_str())
                        .annotation(mark.label(self.label.as_deref())),
                )
            }
        };
        if let Some(help) = &self.help {
            group = group.element(Level::HELP.message(help.as_str()));
        }
        renderer.render(&[group])
    }
}

/// The mistakes found so far, in the order in which they were found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Diagnostics(Vec<Diagnostic>);

impl Diagnostics {
    /// No diagnostics yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a diagnostic. The same diagnostic from several blocks is kept once.
    pub fn push(&mut self, diagnostic: Diagnostic) {
        if !self.0.contains(&diagnostic) {
            self.0.push(diagnostic);
        }
    }

    /// Keeps the value of a result, or its diagnostic.
    pub fn keep<T>(&mut self, result: Result<T, Diagnostic>) -> Option<T> {
        result.map_err(|diagnostic| self.push(diagnostic)).ok()
    }

    /// Returns true if it contains neither errors nor warnings.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether any is an error.
    #[must_use]
    pub fn has_errors(&self) -> bool {
        self.iter().any(|found| found.severity == Severity::Error)
    }

    /// All of them, in order.
    pub fn iter(&self) -> impl Iterator<Item = &Diagnostic> {
        self.0.iter()
    }

    /// All of them, to be added to.
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Diagnostic> {
        self.0.iter_mut()
    }

    /// `value`, unless there are errors.
    ///
    /// # Errors
    /// All diagnostics, if there are errors among them.
    pub fn unless_errors<T>(self, value: T) -> Result<T, Self> {
        if self.has_errors() { Err(self) } else { Ok(value) }
    }

    /// The text to print; set `color` for a terminal.
    #[must_use]
    pub fn render(&self, color: bool) -> String {
        let renderer = if color { Renderer::styled() } else { Renderer::plain() };
        let texts: Vec<_> = self.iter().map(|found| found.render(&renderer)).collect();
        texts.join("\n\n")
    }
}

impl Extend<Diagnostic> for Diagnostics {
    fn extend<I: IntoIterator<Item = Diagnostic>>(&mut self, more: I) {
        self.0.extend(more);
    }
}

impl From<Diagnostic> for Diagnostics {
    fn from(one: Diagnostic) -> Self {
        Self(vec![one])
    }
}

/// The rendered text, without colour.
impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

impl std::error::Error for Diagnostics {}

#[cfg(test)]
mod tests {
    use super::*;

    fn quoted() -> Diagnostic {
        let source = Arc::new(Source {
            name: "filter.toml".to_owned(),
            text: "[gate]\nthreshold = 5\n".to_owned(),
        });
        Diagnostic::error("too strict").at(&Place::text(&source, 19..20))
    }

    #[test]
    fn text_is_quoted_and_underlined() {
        let rendered = Diagnostics::from(quoted().label("here").help("raise it")).to_string();
        let expected = "\
error: too strict
 --> filter.toml:2:13
  |
2 | threshold = 5
  |             ^ here
  |
  = help: raise it";
        assert_eq!(rendered, expected);
    }

    #[test]
    fn a_row_of_a_data_file_is_named_by_its_line() {
        let place = Place::row("imu.csv", 17);
        let found = Diagnostic::warning("time runs backwards").at(&place).help("sort the file");
        let expected = "\
warning: time runs backwards
--> imu.csv:17
 = help: sort the file";
        assert_eq!(Diagnostics::from(found).to_string(), expected);
    }

    #[test]
    fn colour_is_given_only_where_it_is_asked_for() {
        let diagnostics = Diagnostics::from(quoted());
        assert!(!diagnostics.render(false).contains('\u{1b}'));
        assert!(diagnostics.render(true).contains("\u{1b}["));
    }

    #[test]
    fn warnings_alone_do_not_stop_a_build() {
        let mut diagnostics = Diagnostics::from(Diagnostic::warning("odd"));
        assert_eq!(diagnostics.clone().unless_errors(7), Ok(7));
        diagnostics.push(Diagnostic::error("wrong"));
        assert!(!diagnostics.is_empty() && diagnostics.clone().unless_errors(7).is_err());
        assert_eq!(diagnostics.to_string(), "warning: odd\n\nerror: wrong");
    }
}
