//! The open connections: how many there may be, and which one is closed for a newer one.
//!
//! Each has a thread. A connection that was refused makes way first, then one that never asked with the token, the
//! oldest before the others; one that waits for a picture stays. A new one has a moment to ask for something before it
//! makes way.

use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Most connections at a time. A browser opens six.
pub(crate) const MAX_CONNECTIONS: usize = 64;

/// Most threads: those of connections that were closed for newer ones are about to end.
const MAX_THREADS: usize = 2 * MAX_CONNECTIONS;

/// Time that a new connection has to say what it wants. Until then a newer one waits with the system.
const GRACE: Duration = Duration::from_millis(100);

/// What a connection is known for; those that are less make way first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Standing {
    /// What it sent was no request.
    Refused,
    /// It never asked with the token.
    Stranger,
    /// It belongs to the page.
    OfPage,
    /// It belongs to the page, which waits for a picture.
    Waits,
}

/// All of them.
#[derive(Default)]
pub(crate) struct Connections {
    state: Mutex<State>,
    ended: Condvar,
}

#[derive(Default)]
struct State {
    /// In the order of their arrival.
    open: Vec<Open>,
    threads: usize,
    next_number: u64,
    is_closed: bool,
}

struct Open {
    number: u64,
    stream: Arc<TcpStream>,
    since: Instant,
    standing: Standing,
}

/// An open connection, until this is dropped.
pub(crate) struct Admission<'a> {
    connections: &'a Connections,
    number: u64,
}

impl Connections {
    /// No work is done while it is held, so it cannot be poisoned.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a new connection; another one may be closed for it. `None` if all of them wait for pictures, or if it is
    /// over.
    pub(crate) fn admit(&self, stream: &Arc<TcpStream>) -> Option<Admission<'_>> {
        let mut state = self.state();
        loop {
            if state.is_closed {
                return None;
            }
            let wait = match state.wait_for_place() {
                _ if state.threads >= MAX_THREADS => GRACE,
                Some(wait) => wait,
                None => return None,
            };
            if wait.is_zero() {
                break;
            }
            state = self.ended.wait_timeout(state, wait).unwrap_or_else(PoisonError::into_inner).0;
        }
        if state.open.len() >= MAX_CONNECTIONS {
            state.close_least();
        }
        let number = state.next_number;
        state.next_number += 1;
        state.threads += 1;
        let (stream, since) = (Arc::clone(stream), Instant::now());
        state.open.push(Open { number, stream, since, standing: Standing::Stranger });
        Some(Admission { connections: self, number })
    }

    /// Closes one, because the system has no more.
    pub(crate) fn make_way(&self) {
        self.state().close_least();
    }

    /// Admits no other. Those that are open read nothing more; whatever is still on its way to a client after
    /// `patience` is cut off.
    pub(crate) fn close(&self, patience: Duration) {
        let mut state = self.state();
        state.is_closed = true;
        self.ended.notify_all();
        // A connection that is gone already cannot be shut down, which is no error.
        let shut_down =
            |state: &State, how| state.open.iter().for_each(|connection| drop(connection.stream.shutdown(how)));
        shut_down(&state, Shutdown::Read);
        let waited = self.ended.wait_timeout_while(state, patience, |state| !state.open.is_empty());
        shut_down(&waited.unwrap_or_else(PoisonError::into_inner).0, Shutdown::Both);
    }
}

impl State {
    /// The connection that is known for the least, the oldest of those, unless all wait for pictures.
    fn least(&self) -> Option<usize> {
        let least = self.open.iter().enumerate().min_by_key(|(_, connection)| connection.standing);
        least.filter(|(_, connection)| connection.standing < Standing::Waits).map(|(place, _)| place)
    }

    /// The time until there is a place for another one; `None` if all wait for pictures.
    fn wait_for_place(&self) -> Option<Duration> {
        if self.open.len() < MAX_CONNECTIONS {
            return Some(Duration::ZERO);
        }
        let least = &self.open[self.least()?];
        let is_new = least.standing == Standing::Stranger;
        Some(if is_new { GRACE.saturating_sub(least.since.elapsed()) } else { Duration::ZERO })
    }

    /// Closes the connection that is known for the least.
    fn close_least(&mut self) {
        if let Some(place) = self.least() {
            // One that is gone already cannot be shut down, which is no error.
            self.open.remove(place).stream.shutdown(Shutdown::Both).ok();
        }
    }
}

impl Admission<'_> {
    /// From now on it is known for this.
    pub(crate) fn stands(&self, standing: Standing) {
        let mut state = self.connections.state();
        state
            .open
            .iter_mut()
            .filter(|connection| connection.number == self.number)
            .for_each(|connection| connection.standing = standing);
    }
}

impl Drop for Admission<'_> {
    fn drop(&mut self) {
        let mut state = self.connections.state();
        state.open.retain(|connection| connection.number != self.number);
        state.threads -= 1;
        drop(state);
        self.connections.ended.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::{Connections, MAX_CONNECTIONS, Standing};
    use std::io::{ErrorKind, Read};
    use std::net::{TcpListener, TcpStream};
    use std::sync::Arc;
    use std::time::Duration;

    fn is_open(client: &TcpStream) -> bool {
        client.set_nonblocking(true).expect("no waiting");
        (&*client).read(&mut [0]).is_err_and(|error| error.kind() == ErrorKind::WouldBlock)
    }

    #[test]
    fn strangers_make_way_first_and_the_oldest_of_them() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address");
        let connections = Connections::default();
        let open = || {
            let client = TcpStream::connect(address).expect("a connection");
            let stream = Arc::new(listener.accept().expect("a connection").0);
            (client, connections.admit(&stream))
        };
        let mut all: Vec<_> = (0..MAX_CONNECTIONS).map(|_| open()).collect();
        let known = |all: &[(TcpStream, Option<super::Admission<'_>>)], index: usize, standing| {
            all[index].1.as_ref().expect("it is admitted").stands(standing);
        };
        known(&all, 0, Standing::OfPage);
        known(&all, 1, Standing::Waits);
        all.push(open());
        let closed = |all: &[(TcpStream, Option<super::Admission<'_>>)]| -> Vec<usize> {
            (0..all.len()).filter(|index| !is_open(&all[*index].0)).collect()
        };
        assert_eq!(closed(&all), [2]);
        // One that leaves makes room.
        all[3].1 = None;
        all.push(open());
        assert_eq!(closed(&all), [2, 3]);
        // One that was refused is the first.
        known(&all, 9, Standing::Refused);
        all.push(open());
        assert_eq!(closed(&all), [2, 3, 9]);
        (4..all.len()).for_each(|index| known(&all, index, Standing::Waits));
        all.push(open());
        assert_eq!(closed(&all), [0, 2, 3, 9], "the page's own, before those that wait for pictures");
        known(&all, MAX_CONNECTIONS + 3, Standing::Waits);
        let (client, refused) = open();
        assert!(refused.is_none());
        drop(client);
        connections.close(Duration::ZERO);
        assert_eq!(closed(&all).len(), all.len());
        assert!(open().1.is_none());
    }
}
