//! A finding: what was seen, how bad it is, and what to do.

use super::SensorStatistics;
use serde::Serialize;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// As it should be.
    Ok,
    /// Worth knowing.
    Note,
    /// slamd copes; the map is worse for it.
    Warning,
    /// No map, or a wrong one.
    Problem,
}

impl Level {
    /// The word that begins the finding's line.
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

/// Something seen.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Which check found it, for programs.
    pub id: &'static str,
    /// How bad it is.
    pub level: Level,
    /// What was seen.
    pub text: String,
    /// What to do about it.
    pub fix: Option<String>,
}

impl Finding {
    /// All is well.
    #[must_use]
    pub fn ok(id: &'static str, text: impl Into<String>) -> Self {
        Self { id, level: Level::Ok, text: text.into(), fix: None }
    }

    /// Something to do.
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

/// How many findings of each level there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// As they should be.
    pub ok: usize,
    /// Worth knowing.
    pub note: usize,
    /// To be looked at.
    pub warning: usize,
    /// To be repaired.
    pub problem: usize,
}

/// All findings.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// In the order in which they are told.
    pub findings: Vec<Finding>,
    /// What each sensor gave, by id.
    pub sensors: Vec<SensorStatistics>,
    /// Their numbers.
    pub summary: Summary,
}

impl Report {
    /// Counts `findings`.
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
