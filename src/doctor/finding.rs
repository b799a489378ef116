//! A finding: observation, severity and remedy.

use super::SensorStatistics;
use serde::Serialize;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// No problem.
    Ok,
    /// Worth knowing.
    Note,
    /// slamd works, but the map gets worse.
    Warning,
    /// No map, or a wrong one.
    Problem,
}

impl Level {
    /// The level's name, which begins the finding's line.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Problem => "problem",
        }
    }
}

/// A finding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Id of the check, for programs.
    pub id: &'static str,
    /// Severity.
    pub level: Level,
    /// The observation.
    pub text: String,
    /// The remedy.
    pub fix: Option<String>,
}

impl Finding {
    /// A finding without a problem.
    #[must_use]
    pub fn ok(id: &'static str, text: impl Into<String>) -> Self {
        Self { id, level: Level::Ok, text: text.into(), fix: None }
    }

    /// A finding with a remedy.
    #[must_use]
    pub fn new(level: Level, id: &'static str, text: impl Into<String>, fix: impl Into<String>) -> Self {
        Self { id, level, text: text.into(), fix: Some(fix.into()) }
    }
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:<8} {}", self.level.word(), self.text)?;
        match &self.fix {
            Some(fix) => write!(f, "\n         -> {fix}"),
            None => Ok(()),
        }
    }
}

/// Number of findings of each level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Without a problem.
    pub ok: usize,
    /// Worth knowing.
    pub note: usize,
    /// Warnings.
    pub warning: usize,
    /// Problems.
    pub problem: usize,
}

/// All findings.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The findings in order of output.
    pub findings: Vec<Finding>,
    /// Statistics of each sensor, by id.
    pub sensors: Vec<SensorStatistics>,
    /// Number of findings of each level.
    pub summary: Summary,
}

impl Report {
    /// Builds the report and its summary.
    #[must_use]
    pub fn new(findings: Vec<Finding>, sensors: Vec<SensorStatistics>) -> Self {
        let count = |level| findings.iter().filter(|finding| finding.level == level).count();
        let summary = Summary {
            ok: count(Level::Ok),
            note: count(Level::Note),
            warning: count(Level::Warning),
            problem: count(Level::Problem),
        };
        Self { findings, sensors, summary }
    }
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for finding in &self.findings {
            writeln!(f, "{finding}")?;
        }
        let Summary { ok, note, warning, problem } = self.summary;
        write!(f, "problems {problem}, warnings {warning}, notes {note}, ok {ok}")
    }
}
