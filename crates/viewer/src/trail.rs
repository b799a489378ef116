//! A path in pieces. Only the newest piece is sent repeatedly, so the cost per second does not grow
//! with the path.

use slamd_core::Point;
use std::collections::VecDeque;

/// A path.
#[derive(Clone, Debug, Default)]
pub(super) struct Trail {
    /// Pieces that are complete, the oldest first.
    past: VecDeque<Vec<[f32; 3]>>,
    piece: Vec<[f32; 3]>,
    /// The number of pieces ever completed.
    completed: usize,
    /// Value of `completed` when the new pieces were last taken.
    taken: usize,
    is_new: bool,
}

/// Minimum distance between two points, metres.
const SPACING_M: f64 = 0.04;
/// Points per piece.
const PIECE: usize = 128;
/// Maximum number of pieces kept: more than a kilometre.
pub(super) const MAX_PIECES: usize = 256;
/// Height above the map.
const HEIGHT_M: f32 = 0.012;

impl Trail {
    /// Appends a point.
    #[expect(clippy::cast_possible_truncation, reason = "for display")]
    pub(super) fn push(&mut self, point: Point) {
        let corner = [point.x as f32, point.y as f32, HEIGHT_M];
        let apart = |last: &[f32; 3]| f64::from((last[0] - corner[0]).hypot(last[1] - corner[1]));
        if self.piece.last().is_some_and(|last| apart(last) < SPACING_M) {
            return;
        }
        self.is_new = true;
        self.piece.push(corner);
        if self.piece.len() == PIECE {
            self.past.push_back(std::mem::replace(&mut self.piece, vec![corner]));
            self.completed += 1;
            if self.past.len() == MAX_PIECES {
                self.past.pop_front();
            }
        }
    }

    /// The pieces that changed since the last call, with their numbers. Numbers are reused after the
    /// oldest pieces are dropped.
    pub(super) fn take_new(&mut self) -> impl Iterator<Item = (usize, &[[f32; 3]])> {
        let begun = self.completed - std::mem::replace(&mut self.taken, self.completed);
        let count = if std::mem::take(&mut self.is_new) { begun + 1 } else { 0 };
        self.newest(count)
    }

    /// Every piece.
    pub(super) fn all(&self) -> impl Iterator<Item = (usize, &[[f32; 3]])> {
        self.newest(MAX_PIECES)
    }

    /// The newest pieces: the incomplete one, and complete ones before it.
    fn newest(&self, count: usize) -> impl Iterator<Item = (usize, &[[f32; 3]])> {
        let numbered = (self.completed - self.past.len()..).zip(self.past.iter().chain([&self.piece]));
        let skipped = (self.past.len() + 1).saturating_sub(count);
        numbered.skip(skipped).map(|(number, piece)| (number % MAX_PIECES, &piece[..]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pieces_form_the_path() {
        let mut trail = Trail::default();
        let mut shown = std::collections::BTreeMap::new();
        for step in 0..1_000 {
            trail.push(Point::new(0.05 * f64::from(step), 1.0));
            if step % 100 == 99 {
                shown.extend(trail.take_new().map(|(number, piece)| (number, piece.to_vec())));
            }
        }
        assert_eq!(trail.take_new().count(), 0, "nothing new");
        let all: Vec<_> = trail.all().map(|(number, piece)| (number, piece.to_vec())).collect();
        assert_eq!(all, shown.into_iter().collect::<Vec<_>>());
        assert!(all.windows(2).all(|pair| pair[0].1.last() == pair[1].1.first()), "without gaps");
        assert!((all.last().unwrap().1.last().unwrap()[0] - 49.95).abs() < 1e-3);
    }

    #[test]
    fn the_memory_of_an_endless_path_is_bounded() {
        let mut trail = Trail::default();
        for step in 0..200_000 {
            trail.push(Point::new(0.05 * f64::from(step), 0.0));
        }
        assert_eq!(trail.all().count(), MAX_PIECES);
        let numbers: std::collections::BTreeSet<usize> = trail.all().map(|(number, _)| number).collect();
        assert_eq!(numbers.len(), MAX_PIECES);
    }
}
