//! What a power cut leaves of bytes that the disk had not yet taken: a file cut short, a page of zeros, a page of something else.

use slamd_sim::random::Random;

const PAGE: usize = 4_096;
/// Only what is newer than this may be damaged: disks write in the order of minutes, not of hours.
const NEWEST: usize = 8 * PAGE;

pub fn tear(bytes: &mut Vec<u8>, random: &mut Random) {
    if bytes.is_empty() {
        return;
    }
    let from = bytes.len().saturating_sub(NEWEST);
    let place = from + random.below(bytes.len() - from);
    if random.chance(0.4) {
        return bytes.truncate(place);
    }
    let (page, is_zero) = (place / PAGE * PAGE, random.chance(0.5));
    let end = (page + PAGE).min(bytes.len());
    for byte in &mut bytes[page..end] {
        *byte = if is_zero { 0 } else { random.bits().to_le_bytes()[0] };
    }
}
