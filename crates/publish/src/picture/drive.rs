//! When a drive was, and how sure its poses are, in words.

/// A day has so many seconds.
const DAY_S: u64 = 86_400;

/// What is known of a drive beside its path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Drive {
    /// Unix time of the session's start, microseconds.
    pub(crate) began_unix_us: Option<u64>,
    /// Seconds from the session's start to the newest pose.
    pub(crate) duration_s: f64,
    /// The true position is within this distance in 19 of 20 cases, metres: at the newest pose, and the greatest; poses that are called
    /// uncertain do not count.
    pub(crate) within_m: Option<[f64; 2]>,
    /// Seconds of uncertain poses.
    pub(crate) uncertain_s: f64,
    /// The newest pose is uncertain.
    pub(crate) is_lost: bool,
}

impl Drive {
    /// Date, time and duration.
    pub(super) fn when(&self) -> String {
        let lasted = match self.duration_s {
            short if short < 120.0 => format!("{short:.0} s"),
            long => format!("{:.0} min", long / 60.0),
        };
        self.began_unix_us.map_or_else(|| format!("{lasted}, date unknown"), |us| format!("{}, {lasted}", date(us)))
    }

    /// How sure the poses are.
    pub(super) fn certainty(&self) -> String {
        let within =
            self.within_m.map(|[last_m, greatest_m]| match (self.is_lost, length(last_m), length(greatest_m)) {
                (true, _, greatest) => format!("position within {greatest} while certain (95 %)"),
                (false, last, greatest) if last == greatest => format!("position within {last} (95 %)"),
                (false, last, greatest) => format!("position within {last}, at worst {greatest} (95 %)"),
            });
        let end = if self.is_lost { " to the end" } else { "" };
        let uncertain =
            (self.uncertain_s > 0.0).then(|| format!("uncertain for {:.0} s{end}", self.uncertain_s.ceil()));
        [within, uncertain].into_iter().flatten().collect::<Vec<_>>().join(", ")
    }
}

/// A length in the unit in which people say it.
fn length(length_m: f64) -> String {
    if length_m < 0.995 { format!("{:.0} cm", 100.0 * length_m) } else { format!("{length_m:.1} m") }
}

/// Date and time in UTC, from Unix time in microseconds. The calendar is counted from March, so that a leap day ends a year; 400 years have
/// 146,097 days (Hinnant, "chrono-Compatible Low-Level Date Algorithms").
fn date(unix_us: u64) -> String {
    let seconds = unix_us / 1_000_000;
    let day = seconds / DAY_S + 719_468;
    let (era, day_of_era) = (day / 146_097, day % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day_of_month = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    let (hour, minute) = (seconds % DAY_S / 3600, seconds % 3600 / 60);
    format!("{year}-{month:02}-{day_of_month:02} {hour:02}:{minute:02} UTC")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        // `date -u -d @SECONDS`
        for (seconds, expected) in [
            (0, "1970-01-01 00:00 UTC"),
            (951_782_400, "2000-02-29 00:00 UTC"),
            (1_709_251_199, "2024-02-29 23:59 UTC"),
            (1_735_689_599, "2024-12-31 23:59 UTC"),
            (4_107_542_400, "2100-03-01 00:00 UTC"),
        ] {
            assert_eq!(date(seconds * 1_000_000), expected);
        }
    }

    #[test]
    fn a_drive_is_told_in_words() {
        let drive = Drive { duration_s: 179.5, within_m: Some([0.081, 0.156]), uncertain_s: 3.2, ..Drive::default() };
        assert_eq!(drive.when(), "3 min, date unknown");
        assert_eq!(drive.certainty(), "position within 8 cm, at worst 16 cm (95 %), uncertain for 4 s");
        assert_eq!(Drive::default().certainty(), "");
        let lost = Drive { is_lost: true, ..drive };
        assert_eq!(lost.certainty(), "position within 16 cm while certain (95 %), uncertain for 4 s to the end");
        let same = Drive { within_m: Some([0.1, 0.104]), ..Drive::default() };
        assert_eq!(same.certainty(), "position within 10 cm (95 %)");
    }
}
