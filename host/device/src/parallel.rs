//! The one driver under all parallel loops: compiled once, for work behind a `dyn Fn`.
//!
//! Loops hand out parts of a slice, or indices, under a lock; the threads of the current pool take one after the other
//! until none is left. The result of a part does not depend on the thread that computes it, so results are the same
//! bits for any number of threads. A part should be 20 µs of work or more: handing it out takes well below 1 µs, waking
//! a thread a few. Work of a single part runs on the calling thread.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};
use viewfuse_kernels::store::Part;

/// Parts for each thread, where there is enough work: many, so that the threads finish at about the same time.
const PARTS_PER_THREAD: usize = 16;

/// Runs `worker` on as many threads of the current pool as there are parts, and returns when all have returned.
fn drive(part_count: usize, worker: &(dyn Fn() + Sync)) {
    let threads = rayon::current_num_threads().min(part_count);
    if threads <= 1 {
        return worker();
    }
    rayon::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(|_| worker());
        }
        worker();
    });
}

/// The lock. No work runs while it is held, so it cannot be poisoned.
fn take<T>(parts: &Mutex<T>) -> MutexGuard<'_, T> {
    parts.lock().unwrap_or_else(PoisonError::into_inner)
}

/// `work(index, part)` for the parts of `values`, each of `part_len` values, the last one of fewer.
pub fn for_each_part<T: Send>(values: &mut [T], part_len: usize, work: &(dyn Fn(usize, &mut [T]) + Sync)) {
    let part_len = part_len.max(1);
    let part_count = values.len().div_ceil(part_len);
    let parts = Mutex::new(values.chunks_mut(part_len).enumerate());
    drive(part_count, &|| {
        loop {
            let next = take(&parts).next();
            let Some((index, part)) = next else { return };
            work(index, part);
        }
    });
}

/// `work(first row, rows)` for some rows of `values` at a time, each of `row_len` values; `least` values are enough
/// work for a part.
pub fn for_each_rows<T: Send>(values: &mut [T], row_len: usize, least: usize, work: &(dyn Fn(usize, &mut [T]) + Sync)) {
    let row_len = row_len.max(1);
    let rows = rows_at_once(values.len().div_ceil(row_len), row_len, least);
    for_each_part(values, rows * row_len, &|part, values| work(part * rows, values));
}

/// `work(row, values)` for every row of `values`, each of `row_len` values; `least` values are enough work for a part.
pub fn for_each_row<T: Send>(values: &mut [T], row_len: usize, least: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    let row_len = row_len.max(1);
    for_each_rows(values, row_len, least, &|first, rows| {
        for (row, values) in (first..).zip(rows.chunks_mut(row_len)) {
            work(row, values);
        }
    });
}

/// `work(index, value)` for every value; `least` values are enough work for a part.
pub fn for_each<T: Send>(values: &mut [T], least: usize, work: impl Fn(usize, &mut T) + Sync) {
    for_each_rows(values, 1, least, &|first, values| {
        for (index, value) in (first..).zip(values) {
            work(index, value);
        }
    });
}

/// `work(elements, part)` for some of `elements` at a time; `take(elements)` gives each of these their part of what
/// they write, in order. `least` elements are enough work for a part.
pub fn for_each_piece<P: Send>(
    elements: Range<u32>,
    least: usize,
    take: impl FnMut(Range<u32>) -> P + Send,
    work: impl Fn(Range<u32>, P) + Sync,
) {
    let piece_len = rows_at_once(elements.len(), 1, least);
    let piece_count = elements.len().div_ceil(piece_len);
    let rest = Mutex::new((elements, take));
    drive(piece_count, &|| {
        loop {
            let mut rest = self::take(&rest);
            let (elements, take) = &mut *rest;
            if elements.start >= elements.end {
                return;
            }
            let end = elements.start + piece_len.min(elements.len()) as u32;
            let piece = elements.start..end;
            elements.start = end;
            let part = take(piece.clone());
            drop(rest);
            work(piece, part);
        }
    });
}

/// What is left of an array while [`for_each_piece`] takes its parts.
pub struct Rest<'a, T> {
    values: &'a mut [T],
    first: usize,
}

impl<'a, T> Rest<'a, T> {
    /// All of it.
    pub fn new(values: &'a mut [T]) -> Rest<'a, T> {
        Rest { values, first: 0 }
    }

    /// The values `start..end`, as far as there are such; those before them are gone.
    pub fn take(&mut self, start: usize, end: usize) -> Part<'a, T> {
        let all = std::mem::take(&mut self.values);
        let end = (end - self.first).min(all.len());
        let (taken, rest) = all.split_at_mut(end);
        let before = start - self.first;
        (self.values, self.first) = (rest, self.first + end);
        Part { values: &mut taken[before..], first: start }
    }
}

/// The results of `work` for `0..count`, in order; `least` results are enough work for a part.
pub fn map<R: Send>(count: usize, least: usize, work: impl Fn(usize) -> R + Sync) -> Vec<R> {
    let part_len = rows_at_once(count, 1, least);
    let mut parts: Vec<Vec<R>> = (0..count.div_ceil(part_len)).map(|_| Vec::new()).collect();
    for_each_part(&mut parts, 1, &|index, part| {
        let first = index * part_len;
        part[0] = (first..count.min(first + part_len)).map(&work).collect();
    });
    let mut parts = parts.into_iter();
    let mut results = parts.next().unwrap_or_default();
    results.reserve_exact(count - results.len());
    parts.for_each(|mut part| results.append(&mut part));
    results
}

/// As [`map`] with parts of one result, until one fails: of the errors, the one of the lowest index is returned.
///
/// # Errors
/// The error of `work`.
pub fn try_map<R: Send, E: Send>(count: usize, work: impl Fn(usize) -> Result<R, E> + Sync) -> Result<Vec<R>, E> {
    let has_failed = std::sync::atomic::AtomicBool::new(false);
    let mut results: Vec<Option<Result<R, E>>> = (0..count).map(|_| None).collect();
    for_each_part(&mut results, 1, &|index, part| {
        if !has_failed.load(std::sync::atomic::Ordering::Relaxed) {
            let result = work(index);
            has_failed.fetch_or(result.is_err(), std::sync::atomic::Ordering::Relaxed);
            part[0] = Some(result);
        }
    });
    results.into_iter().flatten().collect()
}

/// How many rows are a part: as few as are enough work, more if there are many.
fn rows_at_once(row_count: usize, row_len: usize, least: usize) -> usize {
    let share = row_count.div_ceil(rayon::current_num_threads() * PARTS_PER_THREAD);
    share.max(least.div_ceil(row_len)).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewfuse_kernels::store::Store;

    /// Every row once, with its own number, whatever the lengths.
    #[test]
    fn every_row_is_visited_once() {
        for (count, row_len, least) in [(0, 3, 1), (1, 1, 1), (7, 3, 1), (1000, 7, 1), (1000, 7, 100), (1000, 1, 5000)]
        {
            let mut values = vec![usize::MAX; count];
            for_each_row(&mut values, row_len, least, |row, values| {
                values.iter_mut().for_each(|value| *value = row);
            });
            let expected: Vec<usize> = (0..count).map(|index| index / row_len).collect();
            assert_eq!(values, expected);
        }
    }

    /// Every element once, each with the values that are its own: here three, behind the first seven.
    #[test]
    fn pieces_get_their_parts() {
        for (elements, least) in [(0..0, 1), (0..1, 1), (5..1000, 1), (5..1000, 100), (5..1000, 5000)] {
            let place = |element: u32| 7 + 3 * element as usize;
            let mut values = vec![0; place(elements.end) + 4];
            let mut rest = Rest::new(&mut values);
            let take = |piece: Range<u32>| rest.take(place(piece.start), place(piece.end));
            for_each_piece(elements.clone(), least, take, |piece, mut part| {
                for element in piece {
                    part.store(place(element) + 2, element);
                }
            });
            let expected = |index: usize| match index.checked_sub(9) {
                Some(behind) if behind % 3 == 0 && elements.contains(&((behind / 3) as u32)) => behind as u32 / 3,
                _ => 0,
            };
            assert!(values.iter().enumerate().all(|(index, value)| *value == expected(index)), "{elements:?}, {least}");
        }
    }

    #[test]
    fn results_keep_their_order_and_the_first_error_is_kept() {
        assert_eq!(map(100, 7, |index| index * index), (0..100).map(|index| index * index).collect::<Vec<_>>());
        assert_eq!(
            try_map(100, |index| if index < 100 { Ok(index) } else { Err(index) }).map(|all| all.len()),
            Ok(100)
        );
        assert_eq!(try_map(1, |index| if index > 0 { Ok(index) } else { Err(index) }), Err(0));
    }

    /// The pool that is installed does the work, also one of a single thread.
    #[test]
    fn the_installed_pool_does_the_work() {
        for count in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("a pool");
            let threads = pool.install(|| map(64, 1, |_| rayon::current_num_threads()));
            assert_eq!(threads, vec![count; 64]);
        }
    }

    #[test]
    fn a_panic_comes_through() {
        let outcome = std::panic::catch_unwind(|| map(100, 1, |index| assert!(index != 50, "fifty")));
        assert!(outcome.is_err());
    }
}
