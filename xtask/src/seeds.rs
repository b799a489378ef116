//! The option `--seeds FIRST-LAST`.

use std::ops::RangeInclusive;

/// Seeds of drives. Tune on 1-20, report on 101-120.
#[derive(Clone, Debug)]
pub(crate) struct Seeds(pub(crate) RangeInclusive<u64>);

impl std::str::FromStr for Seeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let seeds = text.split_once('-').and_then(|(first, last)| Some(first.parse().ok()?..=last.parse().ok()?));
        seeds.filter(|seeds| !seeds.is_empty()).map(Self).ok_or_else(|| "expected FIRST-LAST, such as 101-120".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_two_numbers_in_order() {
        assert_eq!("101-120".parse::<Seeds>().unwrap().0, 101..=120);
        for wrong in ["", "7", "9-3", "a-b", "1-2-3"] {
            assert!(wrong.parse::<Seeds>().is_err(), "{wrong}");
        }
    }
}
