//! The allowed values of a key, and the check of one value. Its error says what is allowed.

use super::keys::Key;

/// The allowed values of a key.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Any text.
    Text,
    /// One of these texts.
    Choice(&'static [&'static str]),
    /// True or false.
    Flag,
    /// True or false, also written as 1 and 0, as a board stores it.
    Switch,
    /// A whole number from the first to the second, both included.
    Whole(i64, i64),
    /// A number from the first to the second, both included.
    Number(f64, f64),
    /// A table of keys.
    Table(Vec<Key>),
    /// A list of tables of keys, and its maximum length.
    List(Vec<Key>, u8),
}

impl Shape {
    /// Why a value is not allowed; none if it is.
    pub(super) fn refusal(&self, path: &str, value: &toml::Value) -> Option<String> {
        let is_right_kind = match self {
            Self::Text | Self::Choice(_) => value.is_str(),
            Self::Flag => value.is_bool(),
            Self::Switch => value.is_bool() || value.is_integer(),
            Self::Whole(..) => value.is_integer(),
            Self::Number(..) => value.is_integer() || value.is_float(),
            Self::Table(_) | Self::List(..) => false,
        };
        let shown = shown(&value.to_string());
        if !is_right_kind {
            return Some(format!("{path} = {shown} does not fit: it must be {}", self.words(path)));
        }
        let is_within = match self {
            Self::Choice(names) => value.as_str().is_some_and(|text| names.contains(&text)),
            Self::Switch => value.as_integer().is_none_or(|number| (0..=1).contains(&number)),
            Self::Whole(least, most) => value.as_integer().is_some_and(|number| (*least..=*most).contains(&number)),
            Self::Number(least, most) => as_number(value).is_some_and(|number| (*least..=*most).contains(&number)),
            _ => true,
        };
        let range = match self {
            Self::Whole(least, most) => between(least, most),
            Self::Number(least, most) => between(least, most),
            _ => self.words(path),
        };
        (!is_within).then(|| format!("{path} = {shown} is out of range: it must be {range}"))
    }

    /// The allowed values, for people.
    pub(super) fn words(&self, path: &str) -> String {
        match self {
            Self::Text => "a text in quotes".into(),
            Self::Choice(names) => names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(" or "),
            Self::Flag | Self::Switch => "true or false".into(),
            Self::Whole(least, most) => format!("a whole number {}", between(least, most)),
            Self::Number(least, most) => format!("a number {}", between(least, most)),
            Self::Table(_) => format!("a table, [{path}]"),
            Self::List(_, most) => format!("a list of at most {most} tables, [[{path}]]"),
        }
    }
}

/// A value as a number, if it is one.
#[expect(clippy::cast_precision_loss, reason = "compared with ranges of some digits")]
pub(super) fn as_number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|number| number as f64))
}

fn between(least: impl std::fmt::Display, most: impl std::fmt::Display) -> String {
    format!("from {least} to {most}")
}

/// A text cut to a length that still identifies it.
pub(super) fn shown(text: &str) -> String {
    if text.chars().count() <= MAX_SHOWN {
        return text.into();
    }
    text.chars().take(MAX_SHOWN).chain("...".chars()).collect()
}

const MAX_SHOWN: usize = 60;
