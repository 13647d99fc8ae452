//! Requests for pictures on their way to the render loop: of each tab only the newest waits.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// What the mailbox has to know of a request.
pub(crate) trait Queued {
    /// Which tab it comes from.
    fn tab(&self) -> &str;

    /// Whether it is for a coarse picture, which goes before full ones.
    fn is_urgent(&self) -> bool;

    /// It is not needed any more, because the tab sent a newer one.
    fn drop_as_stale(self);
}

/// Requests that wait; those of one tab replace each other.
pub(crate) struct Mailbox<L> {
    state: Mutex<State<L>>,
    arrived: Condvar,
}

struct State<L> {
    /// In the order of their arrival, at most one of a tab.
    waiting: Vec<L>,
    /// The tab whose full picture is being rendered.
    at_work: Option<String>,
    /// A newer request of that tab has arrived.
    is_superseded: bool,
    /// Nobody takes requests any more.
    is_closed: bool,
}

impl<L: Queued> Mailbox<L> {
    pub(crate) fn new() -> Mailbox<L> {
        let state = State { waiting: Vec::new(), at_work: None, is_superseded: false, is_closed: false };
        Mailbox { state: Mutex::new(state), arrived: Condvar::new() }
    }

    /// No work is done while it is held, so it cannot be poisoned.
    fn state(&self) -> MutexGuard<'_, State<L>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a request in; an older one of the same tab is dropped. After the end it is forgotten.
    pub(crate) fn put(&self, message: L) {
        let mut state = self.state();
        if state.is_closed {
            return;
        }
        state.is_superseded |= state.at_work.as_deref() == Some(message.tab());
        let older = state.waiting.iter().position(|other| other.tab() == message.tab());
        let older = older.map(|place| state.waiting.remove(place));
        state.waiting.push(message);
        drop(state);
        self.arrived.notify_one();
        if let Some(older) = older {
            older.drop_as_stale();
        }
    }

    /// Nobody takes requests any more: those that wait are forgotten.
    pub(crate) fn close(&self) {
        let mut state = self.state();
        state.is_closed = true;
        state.waiting.clear();
    }

    /// The next request: coarse pictures first, then in the order of arrival. Waits at most so long.
    pub(crate) fn take(&self, patience: Duration) -> Option<L> {
        let mut state = self.state();
        if state.waiting.is_empty() {
            state = self.arrived.wait_timeout(state, patience).unwrap_or_else(PoisonError::into_inner).0;
        }
        let place = state.waiting.iter().position(Queued::is_urgent).or((!state.waiting.is_empty()).then_some(0))?;
        let message = state.waiting.remove(place);
        state.at_work = Some(message.tab().to_owned());
        state.is_superseded = false;
        Some(message)
    }

    /// Whether the full picture at work should make way: for a newer request of its own tab, or a coarse picture of
    /// another one.
    pub(crate) fn is_pressing(&self) -> bool {
        let state = self.state();
        state.is_superseded || state.waiting.iter().any(Queued::is_urgent)
    }

    /// Whether a request waits.
    pub(crate) fn is_waiting(&self) -> bool {
        !self.state().waiting.is_empty()
    }

    /// The request that was taken last is answered.
    pub(crate) fn finish(&self) {
        self.state().at_work = None;
    }

    /// Puts the request that was taken last back behind the others, unless its tab sent a newer one.
    pub(crate) fn put_back(&self, message: L) {
        let mut state = self.state();
        state.at_work = None;
        if state.waiting.iter().any(|other| other.tab() == message.tab()) {
            drop(state);
            message.drop_as_stale();
        } else {
            state.waiting.push(message);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Mailbox, Queued};
    use std::sync::mpsc::{Receiver, Sender, channel};
    use std::time::Duration;

    struct Note {
        tab: &'static str,
        number: u32,
        is_urgent: bool,
        stale: Sender<u32>,
    }

    impl Queued for Note {
        fn tab(&self) -> &str {
            self.tab
        }

        fn is_urgent(&self) -> bool {
            self.is_urgent
        }

        fn drop_as_stale(self) {
            self.stale.send(self.number).expect("a receiver");
        }
    }

    fn office() -> (Mailbox<Note>, impl Fn(&'static str, u32, bool) -> Note, Receiver<u32>) {
        let (stale, dropped) = channel();
        let note = move |tab, number, is_urgent| Note { tab, number, is_urgent, stale: stale.clone() };
        (Mailbox::new(), note, dropped)
    }

    fn taken(mailbox: &Mailbox<Note>) -> Option<u32> {
        mailbox.take(Duration::ZERO).map(|note| note.number)
    }

    #[test]
    fn the_newest_of_a_tab_wins_and_coarse_goes_first() {
        let (mailbox, note, dropped) = office();
        assert_eq!(taken(&mailbox), None);
        mailbox.put(note("a", 1, false));
        mailbox.put(note("b", 2, false));
        mailbox.put(note("c", 3, true));
        mailbox.put(note("a", 4, false));
        assert_eq!(dropped.try_iter().collect::<Vec<_>>(), [1]);
        assert_eq!(
            [taken(&mailbox), taken(&mailbox), taken(&mailbox), taken(&mailbox)],
            [Some(3), Some(2), Some(4), None]
        );
    }

    #[test]
    fn after_the_end_everything_is_forgotten() {
        let (mailbox, note, dropped) = office();
        mailbox.put(note("a", 1, false));
        mailbox.close();
        mailbox.put(note("b", 2, true));
        assert_eq!(taken(&mailbox), None);
        drop(note);
        assert_eq!(dropped.iter().count(), 0, "and with them whoever waits: all senders are gone");
    }

    #[test]
    fn a_full_picture_makes_way_and_is_not_lost() {
        let (mailbox, note, dropped) = office();
        mailbox.put(note("a", 1, false));
        let first = mailbox.take(Duration::ZERO).expect("a note");
        assert!(!mailbox.is_pressing());
        mailbox.put(note("b", 2, false));
        assert!(!mailbox.is_pressing(), "another tab's full picture waits");
        mailbox.put(note("b", 3, true));
        assert!(mailbox.is_pressing());
        mailbox.put_back(first);
        assert_eq!(taken(&mailbox), Some(3));
        mailbox.finish();
        let first = mailbox.take(Duration::ZERO).expect("the first again");
        mailbox.put(note("a", 4, false));
        assert!(mailbox.is_pressing(), "its own tab wants another");
        mailbox.put_back(first);
        assert_eq!(dropped.try_iter().collect::<Vec<_>>(), [2, 1]);
        assert_eq!((taken(&mailbox), taken(&mailbox)), (Some(4), None));
    }
}
