//! Work that other threads do while the caller goes on; results come in the order of the work.

use rayon::Yield;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;
use std::time::Duration;

/// How long a thread of the pool without other work waits before it looks again.
const IDLE: Duration = Duration::from_micros(100);

/// Pieces of work on the threads of the pool in which they were added, the oldest first. Those that are left when it is
/// dropped are done nevertheless.
#[derive(Debug)]
pub struct Queue<T> {
    pieces: VecDeque<Receiver<thread::Result<T>>>,
}

impl<T> Default for Queue<T> {
    /// Without work.
    fn default() -> Queue<T> {
        Queue { pieces: VecDeque::new() }
    }
}

impl<T: Send + 'static> Queue<T> {
    /// Adds work, which begins as soon as a thread is free; in a pool of one thread when the caller, who runs on it,
    /// waits for a result.
    pub fn add(&mut self, work: impl FnOnce() -> T + Send + 'static) {
        let (sender, receiver) = channel();
        rayon::spawn_fifo(move || {
            // Nobody waits for it if the queue is gone.
            let _ = sender.send(catch_unwind(AssertUnwindSafe(work)));
        });
        self.pieces.push_back(receiver);
    }

    /// How many results were not taken yet.
    pub fn len(&self) -> usize {
        self.pieces.len()
    }

    /// Whether all results were taken.
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Waits for the oldest piece of work; `None` if there is none. Its panic is the caller's.
    pub fn next_result(&mut self) -> Option<T> {
        let outcome = wait(&self.pieces.pop_front()?)?;
        Some(outcome.unwrap_or_else(|panic| resume_unwind(panic)))
    }
}

/// The outcome of a piece of work, which always sends one. A thread of the pool does other work of it until then.
fn wait<T>(piece: &Receiver<T>) -> Option<T> {
    loop {
        match piece.try_recv() {
            Ok(outcome) => return Some(outcome),
            Err(TryRecvError::Disconnected) => return None,
            Err(TryRecvError::Empty) => match rayon::yield_now() {
                Some(Yield::Executed) => {}
                Some(Yield::Idle) => thread::sleep(IDLE),
                None => return piece.recv().ok(),
            },
        }
    }
}

/// How many pieces of work are done at the same time.
pub fn width() -> usize {
    rayon::current_num_threads()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn squares(count: u64) -> Vec<u64> {
        let mut queue = Queue::default();
        for index in 0..count {
            queue.add(move || {
                thread::sleep(Duration::from_micros(100 * (count - index)));
                index * index
            });
        }
        assert_eq!(queue.len() as u64, count);
        std::iter::from_fn(|| queue.next_result()).collect()
    }

    /// From outside of a pool, and in pools of one thread and of several.
    #[test]
    fn results_come_in_the_order_of_the_work() {
        let expected: Vec<u64> = (0..20).map(|index| index * index).collect();
        assert_eq!(squares(20), expected);
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            assert_eq!(pool.install(|| squares(20)), expected, "{threads} threads");
        }
    }

    #[test]
    fn a_panic_comes_through() {
        let mut queue = Queue::default();
        queue.add(|| 1);
        queue.add(|| panic!("two"));
        assert_eq!(queue.next_result(), Some(1));
        assert!(catch_unwind(AssertUnwindSafe(|| queue.next_result())).is_err());
        assert_eq!(queue.next_result(), None);
    }
}
