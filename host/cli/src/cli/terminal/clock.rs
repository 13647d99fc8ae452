//! Something that is done again and again beside the work.

use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Time from one to the next.
const BEAT: Duration = Duration::from_millis(200);

/// Does it until it is dropped.
pub(super) struct Clock {
    /// Whether it has to end, and what tells so.
    end: Arc<(Mutex<bool>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl Clock {
    /// Without a thread to spare, nothing is done.
    pub(super) fn start(work: impl Fn() + Send + 'static) -> Clock {
        let end = Arc::new((Mutex::new(false), Condvar::new()));
        let shared = Arc::clone(&end);
        let beat = move || {
            let (ended, told) = &*shared;
            let mut is_over = ended.lock().unwrap_or_else(PoisonError::into_inner);
            while !*is_over {
                is_over = told.wait_timeout(is_over, BEAT).unwrap_or_else(PoisonError::into_inner).0;
                if !*is_over {
                    work();
                }
            }
        };
        Clock { end, thread: std::thread::Builder::new().name("clock".to_owned()).spawn(beat).ok() }
    }
}

impl Drop for Clock {
    fn drop(&mut self) {
        *self.end.0.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.end.1.notify_all();
        if let Some(thread) = self.thread.take() {
            // A panic of it was its own.
            thread.join().ok();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Clock;
    use std::sync::mpsc::channel;

    #[test]
    fn it_goes_until_it_is_dropped() {
        let (sender, beats) = channel();
        let clock = Clock::start(move || sender.send(()).expect("a receiver"));
        for _ in 0..2 {
            beats.recv().expect("a beat");
        }
        drop(clock);
        // The work is gone with its thread: the beats come to an end.
        beats.into_iter().for_each(drop);
    }
}
