//! The findings of a run so far, for rules that follow from others.

use super::Finding;

/// The findings so far.
#[derive(Default)]
pub(super) struct Found {
    findings: Vec<Finding>,
    /// The causes of errors, in the words that refer to them.
    causes: Vec<String>,
}

impl Found {
    pub(super) fn has(&self, rules: &[&str]) -> bool {
        self.findings.iter().any(|f| rules.contains(&f.rule.as_str()))
    }

    /// Whether one of these rules has a finding about this subject.
    pub(super) fn is_about(&self, rules: &[&str], subject: &str) -> bool {
        self.findings.iter().any(|f| f.about == subject && rules.contains(&f.rule.as_str()))
    }

    pub(super) fn causes(&self) -> &[String] {
        &self.causes
    }

    /// Adds a finding. If it is a cause of errors, `cause` refers to it.
    pub(super) fn add(&mut self, cause: Option<String>, finding: Finding) {
        self.causes.extend(cause.filter(|cause| !self.causes.contains(cause)));
        self.findings.push(finding);
    }

    pub(super) fn finish(self) -> Vec<Finding> {
        self.findings
    }
}
