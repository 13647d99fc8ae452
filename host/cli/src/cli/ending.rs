//! The end of a process that was told to end: work stops between its pieces; where a piece takes long (a decoder, a
//! pipe that nobody writes), the process is ended here. Outputs are whole or not there in both cases.

use std::process::exit;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};
use viewfuse_job::files::remove_all;
use viewfuse_job::process::end_all;

/// The exit code of an interrupted process.
pub(crate) const INTERRUPTED: u8 = 130;

/// CPU time of all threads after the signal that work may take to stop by itself.
const MAX_CPU: Duration = Duration::from_millis(1500);
/// Whether work may take as long as it needs.
static IS_PATIENT: AtomicBool = AtomicBool::new(false);

/// From here on work that is told to end may finish its piece, however long that takes: what it writes then is worth
/// more than a quick end. A second signal ends the process at once.
pub fn be_patient() {
    IS_PATIENT.store(true, Ordering::Relaxed);
}

/// Time without any CPU time after which the process counts as blocked.
const BLOCKED: Duration = Duration::from_millis(1000);
/// CPU time that a blocked process may take: the progress bar and this thread.
const IDLE_CPU: Duration = Duration::from_millis(20);
/// Time between looks at the clock.
const LOOK: Duration = Duration::from_millis(50);

/// Waits until the work has had its time to stop, then ends the process.
pub(crate) fn watch() -> ! {
    let (start, first) = (Instant::now(), cpu_time(Instant::now()));
    let (is_patient, mut is_told) = (IS_PATIENT.load(Ordering::Relaxed), false);
    let (mut since, mut before) = (start, first);
    loop {
        sleep(LOOK);
        let now = cpu_time(start);
        if now.saturating_sub(before) > IDLE_CPU {
            (since, before) = (Instant::now(), now);
        }
        if now.saturating_sub(first) <= MAX_CPU && since.elapsed() <= BLOCKED {
            continue;
        }
        if !is_patient {
            end();
        }
        if !is_told {
            super::printing::complain("what was done is kept when this piece of work ends; once more ends it at once");
            is_told = true;
        }
    }
}

/// Ends the process at once, and those that it started; unfinished files are removed.
pub(crate) fn end() -> ! {
    end_all();
    remove_all();
    super::printing::complain(viewfuse_job::progress::Interrupted);
    exit(INTERRUPTED.into())
}

/// CPU time of the process so far, of all threads; where the system does not say it, the time since `start`.
fn cpu_time(start: Instant) -> Duration {
    // Behind the name in parentheses: state, 10 numbers, then user and system time in ticks of 1/100 s.
    let ticks = || {
        let text = std::fs::read_to_string("/proc/self/stat").ok()?;
        let mut numbers = text.rsplit_once(") ")?.1.split(' ').skip(11);
        Some(numbers.next()?.parse::<u64>().ok()? + numbers.next()?.parse::<u64>().ok()?)
    };
    ticks().map_or_else(|| start.elapsed(), |ticks| Duration::from_millis(10 * ticks))
}
