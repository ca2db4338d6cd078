//! Work on all threads, item by item.
//!
//! What is found comes in the order of the items and does not depend on the number of threads. Rayon's own pipelines
//! are compiled anew for every closure, some 10 kB of code each; here rayon runs one closure, and what is compiled for
//! each use is a loop over a piece of its items. Few items are a piece each, and such a piece costs some 100 ns: items
//! that take less belong into one item of many. Pieces are put together in the end, so that for a moment all that was
//! found may be there twice: inner loops of kernels, and maps of pixels and texels, have rayon's pipelines still, which
//! write where it stays.

use std::{
    ops::Range,
    sync::{Mutex, MutexGuard, PoisonError},
};

use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};

/// Pieces that the items of a map are cut into, at most: enough that threads end together, few enough that a piece
/// costs nothing beside its work.
const PIECES: usize = 1024;

/// Does pieces 0 to `count` − 1 of work, each by itself.
pub fn each(count: usize, work: &(dyn Fn(usize) + Sync)) {
    match count {
        0 => {}
        1 => work(0),
        _ => (0..count).into_par_iter().with_max_len(1).for_each(work),
    }
}

/// What `of` says of 0 to `count` − 1.
pub fn map<R: Send>(count: usize, of: impl Fn(usize) -> R + Sync) -> Vec<R> {
    map_pieces(count, &|piece| piece.map(&of).collect())
}

/// What `of` says of every item.
pub fn map_all<'a, T: Sync, R: Send>(items: &'a [T], of: impl Fn(&'a T) -> R + Sync) -> Vec<R> {
    map_pieces(items.len(), &|piece| items[piece].iter().map(&of).collect())
}

/// [`map`] with something to work in, which says nothing of what was done before.
pub fn map_in<S, R: Send>(
    count: usize,
    scratch: impl Fn() -> S + Sync,
    of: impl Fn(&mut S, usize) -> R + Sync,
) -> Vec<R> {
    map_pieces(count, &|piece| {
        let mut scratch = scratch();
        piece.map(|n| of(&mut scratch, n)).collect()
    })
}

/// Changes every row of `length` values, given its number; the last may be shorter.
pub fn rows<T: Send>(values: &mut [T], length: usize, change: impl Fn(usize, &mut [T]) + Sync) {
    map_rows(values, length, change);
}

/// [`rows`], and what `change` says of each.
pub fn map_rows<T: Send, R: Send>(
    values: &mut [T],
    length: usize,
    change: impl Fn(usize, &mut [T]) -> R + Sync,
) -> Vec<R> {
    let count = values.len().div_ceil(length);
    let in_piece = items_in_piece(count);
    // Each is locked once, by the thread that has its rows.
    let pieces: Vec<Mutex<&mut [T]>> = values.chunks_mut(length * in_piece).map(Mutex::new).collect();
    map_pieces(count, &|piece| match pieces.get(piece.start / in_piece) {
        Some(rows) => piece.zip(lock(rows).chunks_mut(length)).map(|(n, row)| change(n, row)).collect(),
        None => Vec::new(),
    })
}

fn items_in_piece(count: usize) -> usize {
    count.div_ceil(PIECES).max(1)
}

fn map_pieces<R: Send>(count: usize, of: &(dyn Fn(Range<usize>) -> Vec<R> + Sync)) -> Vec<R> {
    let in_piece = items_in_piece(count);
    if count <= in_piece {
        return of(0..count);
    }
    let pieces: Vec<Mutex<Vec<R>>> = (0..count.div_ceil(in_piece)).map(|_| Mutex::default()).collect();
    each(pieces.len(), &|n| {
        let found = of(n * in_piece..count.min((n + 1) * in_piece));
        *lock(&pieces[n]) = found;
    });
    let mut all = Vec::with_capacity(count);
    for piece in pieces {
        all.append(&mut piece.into_inner().unwrap_or_else(PoisonError::into_inner));
    }
    all
}

/// A poisoned lock means that another thread panicked, which ends the work anyway.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts below, at and above whole pieces.
    const COUNTS: [usize; 7] = [0, 1, 2, PIECES - 1, PIECES, PIECES + 1, 5 * PIECES - 3];

    #[test]
    fn what_is_found_comes_in_order() {
        for count in COUNTS {
            let squares: Vec<usize> = (0..count).map(|n| n * n).collect();
            let items: Vec<usize> = (0..count).collect();
            assert_eq!(map(count, |n| n * n), squares);
            assert_eq!(map_all(&items, |n| n * n), squares);
            assert_eq!(
                map_in(count, Vec::new, |seen, n| {
                    seen.push(n);
                    n * n
                }),
                squares
            );
        }
    }

    #[test]
    fn rows_are_changed_by_number_and_the_last_may_be_short() {
        let mut values = vec![0; 10];
        rows(&mut values, 4, |n, row| row.fill(10 * n + row.len()));
        assert_eq!(values, [4, 4, 4, 4, 14, 14, 14, 14, 22, 22]);
        rows(&mut Vec::<u8>::new(), 4, |_, _| unreachable!());
        let mut many = vec![0; 3 * PIECES + 2];
        let lengths = map_rows(&mut many, 2, |n, row| {
            row.fill(n);
            row.len()
        });
        assert!((0..).zip(&many).all(|(at, n)| at / 2 == *n) && lengths == [2; 3 * PIECES / 2 + 1]);
    }
}
