//! A symmetric matrix that grows and shrinks row by row: the walls' covariance. Only the lower triangle is kept, and as one run of numbers,
//! so that a rank-one update is one pass over it.

/// A symmetric matrix up to a size that its maker has chosen; rows beyond those in use hold anything.
#[derive(Clone, Debug)]
pub(super) struct Symmetric {
    /// Row i is its i + 1 entries up to the diagonal.
    entries: Vec<f64>,
}

const fn begin(row: usize) -> usize {
    row * (row + 1) / 2
}

impl Symmetric {
    /// Zeros for up to `most` rows.
    pub(super) fn new(most: usize) -> Self {
        Self { entries: vec![0.0; begin(most)] }
    }

    /// The entry in a row and a column.
    pub(super) fn get(&self, row: usize, column: usize) -> f64 {
        self.entries[begin(row.max(column)) + row.min(column)]
    }

    /// Replaces an entry.
    pub(super) fn set(&mut self, row: usize, column: usize, entry: f64) {
        self.entries[begin(row.max(column)) + row.min(column)] = entry;
    }

    /// A row up to the diagonal.
    pub(super) fn row(&self, row: usize) -> &[f64] {
        &self.entries[begin(row)..=begin(row) + row]
    }

    /// The same, to be changed.
    pub(super) fn row_mut(&mut self, row: usize) -> &mut [f64] {
        &mut self.entries[begin(row)..=begin(row) + row]
    }

    /// Zero everywhere.
    pub(super) fn clear(&mut self) {
        self.entries.fill(0.0);
    }

    /// Takes `factor · column · columnᵀ` from the first rows, as many as `column` is long.
    pub(super) fn subtract_outer(&mut self, column: &[f64], factor: f64) {
        for (row, value) in column.iter().enumerate() {
            let gain = factor * value;
            for (entry, other) in self.row_mut(row).iter_mut().zip(column) {
                *entry -= gain * other;
            }
        }
    }

    /// Moves the row and column `from` to `to`, which is before it.
    pub(super) fn replace(&mut self, to: usize, from: usize) {
        for other in 0..from {
            let entry = if other == to { self.get(from, from) } else { self.get(from, other) };
            self.set(to, other, entry);
        }
    }
}
