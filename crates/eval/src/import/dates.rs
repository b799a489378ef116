//! Stamps as dates and times of day: ISO 8601, as spreadsheets and loggers write them.

/// A day has so many seconds.
const DAY_S: f64 = 86_400.0;

/// Unix time of a stamp such as `2026-05-01T12:34:56.789Z`, `2026-05-01 12:34:56+02:00` or `01.05.2026 12:34`, seconds; of a time of day alone,
/// such as `12:34:56.789`, the seconds since midnight. Without an offset, the time is taken as UTC.
pub(super) fn seconds(stamp: &str) -> Option<f64> {
    let stamp = stamp.trim();
    let split = stamp.split_once(['T', 't', ' ']);
    match split {
        Some((date, time)) => Some(DAY_S * days(date)? + of_day(time.trim())?),
        None if stamp.contains(':') => of_day(stamp),
        None => None,
    }
}

/// Days from 1970-01-01 to a date. The calendar is counted from March, so that a leap day ends a year; 400 years have 146,097 days (Hinnant,
/// "chrono-Compatible Low-Level Date Algorithms").
fn days(date: &str) -> Option<f64> {
    let mut parts = date.split(['-', '/', '.']);
    let [first, month, last] = [parts.next()?, parts.next()?, parts.next()?];
    // With points the day comes first: 01.05.2026.
    let (year, day) = if date.contains('.') { (last, first) } else { (first, last) };
    let (month, day) = (number(month)?, number(day)?);
    if parts.next().is_some() || year.len() != 4 || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    let year = number(year)? - i64::from(month <= 2);
    let month = (month + 9) % 12;
    let (era, year_of_era) = (year.div_euclid(400), year.rem_euclid(400));
    let day_of_year = (153 * month + 2) / 5 + day - 1;
    let day_of_era = 365 * year_of_era + year_of_era / 4 - year_of_era / 100 + day_of_year;
    i32::try_from(146_097 * era + day_of_era - 719_468).ok().map(f64::from)
}

/// Seconds of a time of day with its offset from UTC: `12:34`, `12:34:56.789Z`, `12:34:56,789+02:00`.
fn of_day(time: &str) -> Option<f64> {
    let time = time.trim_end_matches(['Z', 'z']).trim_end_matches("UTC").trim();
    let (time, offset_s) = match time.rfind(['+', '-']) {
        Some(at) => {
            let (time, offset) = time.split_at_checked(at)?;
            let sign = if offset.starts_with('-') { -1.0 } else { 1.0 };
            let digits: String = offset.chars().filter(char::is_ascii_digit).collect();
            let (hours, minutes) = digits.split_at_checked(2)?;
            let minutes = if minutes.is_empty() { 0 } else { number(minutes)? };
            (time.trim(), sign * clock(number(hours)?, minutes, 0.0)?)
        }
        None => (time, 0.0),
    };
    let mut parts = time.split(':');
    let (hours, minutes) = (number(parts.next()?)?, number(parts.next()?)?);
    let seconds = parts.next().map_or(Some(0.0), |text| text.replace(',', ".").parse().ok())?;
    if parts.next().is_some() {
        return None;
    }
    Some(clock(hours, minutes, seconds)? - offset_s)
}

fn clock(hours: i64, minutes: i64, seconds: f64) -> Option<f64> {
    let is_clock = (0..=24).contains(&hours) && (0..60).contains(&minutes) && (0.0..61.0).contains(&seconds);
    let whole = i32::try_from(3600 * hours + 60 * minutes).ok()?;
    is_clock.then(|| f64::from(whole) + seconds)
}

fn number(text: &str) -> Option<i64> {
    let is_digits = (1..=4).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit());
    if is_digits { text.parse().ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_unix_time() {
        // `date -u -d STAMP +%s.%N`
        for (stamp, expected) in [
            ("1970-01-01T00:00:00Z", 0.0),
            ("2000-02-29 00:00", 951_782_400.0),
            ("2024-02-29T23:59:59.500Z", 1_709_251_199.5),
            ("2024/12/31 23:59:59", 1_735_689_599.0),
            ("2026-05-01T14:00:00.25+02:00", 1_777_636_800.25),
            ("2026-05-01T10:30:00-0130", 1_777_636_800.0),
            ("2026-05-01T12:00:00,5 UTC", 1_777_636_800.5),
            ("1.05.2026 12:00", 1_777_636_800.0),
            ("00:01:30.25", 90.25),
            ("23:59", 86_340.0),
        ] {
            assert_eq!(seconds(stamp), Some(expected), "{stamp}");
        }
        for wrong in [
            "",
            "12",
            "1.5",
            "2026-05-01",
            "2026-13-01T00:00",
            "26-05-01 00:00",
            "25:00",
            "1:2:3:4",
            "a:b",
            "T",
            "12:60",
            "-1:00",
        ] {
            assert_eq!(seconds(wrong), None, "{wrong}");
        }
    }
}
