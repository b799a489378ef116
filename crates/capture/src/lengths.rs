//! The lengths within MCAP's records. The library reserves memory for a text before it knows whether the text is there: four bytes of a
//! damaged file cost 4 GiB.

use mcap::McapError;
use mcap::records::Record;
use std::io::{Error, ErrorKind};

/// A part of a record.
#[derive(Clone, Copy)]
enum Field {
    /// So many bytes.
    Fixed(usize),
    /// Bytes behind their number, which has four bytes.
    Text,
    /// Pairs of texts, behind the number of their bytes.
    Texts,
    /// Entries of so many bytes each, behind the number of all their bytes.
    Entries(usize),
}
use Field::{Entries, Fixed, Text, Texts};

/// The parts of a record up to the last one with a length, by the record's type.
const fn layout(opcode: u8) -> &'static [Field] {
    match opcode {
        0x01 => &[Text, Text],
        0x03 => &[Fixed(2), Text, Text, Text],
        0x04 => &[Fixed(4), Text, Text, Texts],
        0x06 => &[Fixed(28), Text],
        0x07 => &[Fixed(2), Entries(16)],
        0x08 => &[Fixed(32), Entries(10), Fixed(8), Text],
        0x09 => &[Fixed(16), Text, Text],
        0x0A => &[Fixed(40), Text, Text],
        0x0B => &[Fixed(42), Entries(10)],
        0x0C => &[Text, Texts],
        0x0D => &[Fixed(16), Text],
        _ => &[],
    }
}

/// What follows on a text; none if the text is longer than the bytes.
fn behind_text(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)
}

/// True if each length in a record is within it. A list that ends within an entry counts as too long: the library reads that entry from
/// what follows on the list, and then takes any four bytes for the next length.
fn fit(opcode: u8, body: &[u8]) -> bool {
    let walk = |rest: &mut &[u8], field: Field| -> Option<()> {
        match field {
            Fixed(length) => *rest = rest.get(length..)?,
            Text => *rest = behind_text(rest)?.1,
            Texts => {
                let (mut texts, behind) = behind_text(rest)?;
                while !texts.is_empty() {
                    texts = behind_text(behind_text(texts)?.1)?.1;
                }
                *rest = behind;
            }
            Entries(length) => {
                let (entries, behind) = behind_text(rest)?;
                *rest = entries.len().is_multiple_of(length).then_some(behind)?;
            }
        }
        Some(())
    };
    let mut rest = body;
    layout(opcode).iter().all(|field| walk(&mut rest, *field).is_some())
}

/// Parses a record of an MCAP file that may be damaged. Its memory is bounded by the record's own length.
///
/// # Errors
/// When it is no record of its type.
pub fn parse_record(opcode: u8, body: &[u8]) -> Result<Record<'_>, McapError> {
    if fit(opcode, body) {
        return mcap::parse_record(opcode, body);
    }
    Err(McapError::Io(Error::new(ErrorKind::InvalidData, "a length that is longer than its record")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_that_is_longer_than_its_record_reserves_nothing() {
        // What fuzzing found: a topic of 3.7 GB.
        let channel = [&[1, 0, 0, 0][..], &3_685_744_640_u32.to_le_bytes(), b"/topic"].concat();
        assert!(matches!(parse_record(0x04, &channel), Err(McapError::Io(_))));
        let sound = [&[1, 0, 0, 0, 2, 0, 0, 0][..], b"/t", &[0; 8]].concat();
        assert!(parse_record(0x04, &sound).is_ok());
        // A text in a list of texts.
        let list = [&1_u32.to_le_bytes()[..], b"n", &4_u32.to_le_bytes(), &u32::MAX.to_le_bytes()].concat();
        assert!(!fit(0x0C, &list));
        // What fuzzing found: a list of the channels of a chunk that ends within an entry.
        let index = |list: &[u8]| {
            [&[0; 32][..], &[u8::try_from(list.len()).unwrap(), 0, 0, 0], list, &[0; 8], &[3, 0, 0, 0], b"lz4"].concat()
        };
        assert!(fit(0x08, &index(&[0; 20])) && !fit(0x08, &index(&[0; 13])));
        let odd = [
            &1_u32.to_le_bytes()[..],
            b"n",
            &6_u32.to_le_bytes(),
            &2_u32.to_le_bytes(),
            b"on",
            &u32::MAX.to_le_bytes(),
        ]
        .concat();
        assert!(!fit(0x0C, &odd));
        assert!(fit(0x05, &[]) && fit(0xFF, &[]) && !fit(0x0B, &[]));
    }
}
