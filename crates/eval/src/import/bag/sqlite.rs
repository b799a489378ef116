//! The tables of an SQLite database, as far as a ROS 2 bag needs them: whole tables, without indices and without a write-ahead log.
//! <https://www.sqlite.org/fileformat.html>

/// A value of a row.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Null,
    Whole(i64),
    Float(f64),
    Bytes(Vec<u8>),
}

impl Value {
    pub(super) fn text(&self) -> String {
        match self {
            Self::Bytes(bytes) => String::from_utf8_lossy(bytes).into_owned(),
            _ => String::new(),
        }
    }
}

/// A database file in memory.
pub(super) struct Database<'a> {
    bytes: &'a [u8],
    page_size: usize,
    /// Bytes of a page that hold content.
    usable: usize,
}

/// A page of a tree.
struct Node<'a> {
    page: &'a [u8],
    header: &'a [u8],
    is_leaf: bool,
    cells: usize,
}

/// What of a table cannot be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Lost {
    /// Pages, each with the rows below it.
    pages: u32,
    /// Single rows.
    rows: u32,
}

impl Lost {
    /// What is missing, in words; nothing if nothing is. `stamps_ns` are the times of the rows that could be read, in order.
    pub(super) fn sentences(self, stamps_ns: &[i64]) -> Vec<String> {
        let Self { pages, rows } = self;
        if pages == 0 && rows == 0 {
            return Vec::new();
        }
        let first_ns = stamps_ns.first().copied().unwrap_or_default();
        let seconds = |at_ns: i64| 1e-9 * at_ns.saturating_sub(first_ns) as f64;
        let gap_s = |pair: &&[i64]| pair.iter().rev().copied().reduce(i64::saturating_sub).unwrap_or_default();
        let widest = stamps_ns.windows(2).max_by_key(gap_s).unwrap_or_default();
        let (count, last_s) = (stamps_ns.len(), stamps_ns.last().map_or(0.0, |last| seconds(*last)));
        let gap = match widest {
            [from, to] => format!(", the widest gap is from {:.1} s to {:.1} s", seconds(*from), seconds(*to)),
            _ => String::new(),
        };
        vec![format!(
            "damaged or cut off: {pages} pages and {rows} single messages of the database cannot be read; the {count} messages that could be read go to {last_s:.1} s of the bag{gap}"
        )]
    }
}

/// Trees are not deeper.
const MAX_DEPTH: u32 = 30;
const FILE_HEADER: usize = 100;
const MAGIC: &[u8] = b"SQLite format 3\0";

impl<'a> Database<'a> {
    /// None if it is no database.
    pub(super) fn new(bytes: &'a [u8]) -> Option<Self> {
        let rest = bytes.strip_prefix(MAGIC)?;
        let page_size = match usize::from(u16::from_be_bytes(*rest.first_chunk()?)) {
            1 => 1 << 16,
            size => size,
        };
        let usable = page_size.checked_sub(usize::from(*bytes.get(20)?)).filter(|usable| *usable >= 480)?;
        Some(Self { bytes, page_size, usable })
    }

    /// The rows of a table, the columns that are asked for, and what of it cannot be read. The primary key of a table is its row's number. None
    /// if there is no such table or column.
    pub(super) fn table(&self, name: &str, columns: &[&str]) -> Option<(Vec<Vec<Value>>, Lost)> {
        let (schema, _) = self.rows(1);
        let (root, sql) = schema.into_iter().find_map(|(_, row)| match row.as_slice() {
            [kind, _, table, Value::Whole(root), sql, ..] if kind.text() == "table" && table.text() == name => {
                Some((*root, sql.text()))
            }
            _ => None,
        })?;
        let body = sql.split_once('(')?.1;
        let names: Vec<String> = body
            .split(',')
            .map(|column| {
                column.split_whitespace().next().unwrap_or_default().trim_matches(['"', '`', '[', ']']).to_lowercase()
            })
            .collect();
        let wanted: Vec<usize> =
            columns.iter().map(|wanted| names.iter().position(|name| name == wanted)).collect::<Option<_>>()?;
        let pick = |(number, row): (i64, Vec<Value>)| {
            let value = |column: &usize| match row.get(*column) {
                Some(Value::Null) if *column == 0 => Value::Whole(number),
                value => value.cloned().unwrap_or(Value::Null),
            };
            wanted.iter().map(value).collect()
        };
        let (rows, lost) = self.rows(u32::try_from(root).ok()?);
        Some((rows.into_iter().map(pick).collect(), lost))
    }

    fn page(&self, number: u32) -> Option<&'a [u8]> {
        let start = usize::try_from(number.checked_sub(1)?).ok()?.checked_mul(self.page_size)?;
        self.bytes.get(start..start.checked_add(self.usable)?)
    }

    /// The rows of the tree at a page, with their numbers, and what of it cannot be read.
    fn rows(&self, root: u32) -> (Vec<(i64, Vec<Value>)>, Lost) {
        let (mut rows, mut lost, mut pages) = (Vec::new(), Lost::default(), self.bytes.len() / self.page_size + 1);
        self.walk(root, MAX_DEPTH, &mut pages, &mut rows, &mut lost);
        (rows, lost)
    }

    /// `pages` is how many may still be read: a damaged tree may have a loop.
    fn walk(&self, number: u32, depth: u32, pages: &mut usize, rows: &mut Vec<(i64, Vec<Value>)>, lost: &mut Lost) {
        let node = pages.checked_sub(1).zip(depth.checked_sub(1)).zip(self.node(number));
        let Some(((left, depth), Node { page, header, is_leaf, cells })) = node else {
            lost.pages += 1;
            return;
        };
        *pages = left;
        let pointers = header.get(if is_leaf { 8 } else { 12 }..).unwrap_or_default();
        for cell in 0..cells {
            let at =
                pointers.get(2 * cell..).and_then(<[u8]>::first_chunk).map(|at| usize::from(u16::from_be_bytes(*at)));
            let cell = at.and_then(|at| page.get(at..)).unwrap_or_default();
            if is_leaf {
                match self.leaf(cell) {
                    Some(row) => rows.push(row),
                    None => lost.rows += 1,
                }
            } else {
                let below = cell.first_chunk().map_or(0, |number| u32::from_be_bytes(*number));
                self.walk(below, depth, pages, rows, lost);
            }
        }
        if !is_leaf {
            let last = header.get(8..).and_then(<[u8]>::first_chunk).map_or(0, |number| u32::from_be_bytes(*number));
            self.walk(last, depth, pages, rows, lost);
        }
    }

    /// The page of a tree; none if it is no such page.
    fn node(&self, number: u32) -> Option<Node<'a>> {
        let page = self.page(number)?;
        let header = page.get(if number == 1 { FILE_HEADER } else { 0 }..)?;
        let is_leaf = match header.first()? {
            0x0d => true,
            0x05 => false,
            _ => return None,
        };
        let cells = usize::from(u16::from_be_bytes(*header.get(3..)?.first_chunk()?));
        // A cell takes two bytes at least, and its pointer two.
        (4 * cells <= page.len()).then_some(Node { page, header, is_leaf, cells })
    }

    fn leaf(&self, cell: &[u8]) -> Option<(i64, Vec<Value>)> {
        let (length, cell) = varint(cell)?;
        let (number, cell) = varint(cell)?;
        let length = usize::try_from(length).ok().filter(|length| *length <= self.bytes.len())?;
        let most = self.usable - 35;
        let local = if length <= most {
            length
        } else {
            let least = (self.usable - 12) * 32 / 255 - 23;
            let rest = least + (length - least) % (self.usable - 4);
            if rest <= most { rest } else { least }
        };
        let mut payload = cell.get(..local)?.to_vec();
        if local < length {
            let mut next = u32::from_be_bytes(*cell.get(local..)?.first_chunk()?);
            while payload.len() < length {
                let page = self.page(next)?;
                let (number, content) = page.split_first_chunk()?;
                payload.extend(content.get(..content.len().min(length - payload.len()))?);
                next = u32::from_be_bytes(*number);
            }
        }
        Some((number, record(&payload)?))
    }
}

/// The values of a record.
fn record(payload: &[u8]) -> Option<Vec<Value>> {
    let (header, _) = varint(payload)?;
    let header = usize::try_from(header).ok()?;
    let mut kinds = payload.get(payload.len() - varint(payload)?.1.len()..header)?;
    let mut content = payload.get(header..)?;
    let mut values = Vec::new();
    while !kinds.is_empty() {
        let (kind, rest) = varint(kinds)?;
        kinds = rest;
        let size = match kind {
            0 | 8 | 9 => 0,
            1..=4 => usize::try_from(kind).ok()?,
            5 => 6,
            6 | 7 => 8,
            12.. => usize::try_from((kind - 12) / 2).ok()?,
            _ => return None,
        };
        let (bytes, rest) = content.split_at_checked(size)?;
        content = rest;
        values.push(match kind {
            0 => Value::Null,
            7 => Value::Float(f64::from_be_bytes(*bytes.first_chunk()?)),
            8 | 9 => Value::Whole(kind - 8),
            1..=6 => {
                let sign = if bytes.first()? & 0x80 == 0 { 0 } else { -1 };
                Value::Whole(bytes.iter().fold(sign, |value, byte| (value << 8) | i64::from(*byte)))
            }
            _ => Value::Bytes(bytes.to_vec()),
        });
    }
    Some(values)
}

/// A number of one to nine bytes, and what follows it.
fn varint(bytes: &[u8]) -> Option<(i64, &[u8])> {
    let mut value: i64 = 0;
    for (index, byte) in bytes.iter().take(9).enumerate() {
        if index == 8 {
            return Some(((value << 8) | i64::from(*byte), bytes.get(9..)?));
        }
        value = (value << 7) | i64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            return Some((value, bytes.get(index + 1..)?));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_one_to_nine_bytes() {
        assert_eq!(varint(&[0x7f, 1]), Some((127, &[1][..])));
        assert_eq!(varint(&[0x81, 0x00]), Some((128, &[][..])));
        assert_eq!(varint(&[0xff; 9]), Some((-1, &[][..])));
        assert_eq!(varint(&[0xff; 3]), None);
        assert_eq!(
            record(&[4, 1, 2, 19, 0xff, 1, 0, b'a', b'b', b'c']),
            Some(vec![Value::Whole(-1), Value::Whole(256), Value::Bytes(b"abc".to_vec())])
        );
    }

    #[test]
    fn damaged_databases_are_none() {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([0x10, 0, 1, 1, 0]);
        bytes.resize(4096, 0);
        let database = Database::new(&bytes).unwrap();
        assert!(database.table("topics", &["id"]).is_none());
        // A tree that leads back to itself.
        bytes[100] = 0x05;
        bytes[100 + 11] = 1;
        assert!(Database::new(&bytes).unwrap().table("topics", &["id"]).is_none());
        assert!(Database::new(&bytes).unwrap().rows(1).1.pages > 0);
        assert!(Database::new(b"SQLite format 3\0").is_none());
    }
}
