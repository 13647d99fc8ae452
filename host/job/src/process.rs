//! Processes that end with their owner, and with this process where that ends at once.
//!
//! On Unix each leads a group of its own, and what it started ends with it. What a process says is read while the owner
//! does other things, so that one that stays, or whose descendant holds its output, keeps nobody waiting.

use std::io;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, ExitStatus};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Time between two looks whether a process has ended.
const LOOK: Duration = Duration::from_millis(5);

/// The processes that this one has started and that may still run.
static STARTED: Mutex<Vec<Arc<Mutex<Running>>>> = Mutex::new(Vec::new());

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends every [`Process`]. This process must end next: from here on each start of another one waits forever.
pub fn end_all() {
    let started = lock(&STARTED);
    started.iter().for_each(|running| lock(running).end());
    std::mem::forget(started);
}

#[derive(Debug)]
struct Running {
    child: Child,
    /// Whether its end is known: then its number may be another process's.
    has_ended: bool,
}

impl Running {
    /// What it started ends, too.
    fn end_descendants(&self) {
        #[cfg(unix)]
        if let Ok(group) = i32::try_from(self.child.id()) {
            use nix::{sys::signal, unistd::Pid};
            // The group is gone where the process was alone in it.
            let _ = signal::killpg(Pid::from_raw(group), signal::Signal::SIGKILL);
        }
    }

    /// Whether it has ended, told without reaping it: until then its number is nobody else's. `None` where the system
    /// does not tell.
    #[cfg(any(target_os = "android", target_os = "freebsd", all(target_os = "linux", not(target_env = "uclibc"))))]
    fn has_exited(&self) -> Option<bool> {
        use nix::{errno::Errno, sys::wait, unistd::Pid};
        let number = Pid::from_raw(i32::try_from(self.child.id()).ok()?);
        let look = wait::WaitPidFlag::WEXITED | wait::WaitPidFlag::WNOHANG | wait::WaitPidFlag::WNOWAIT;
        match wait::waitid(wait::Id::Pid(number), look) {
            Ok(status) => Some(status != wait::WaitStatus::StillAlive),
            // It was ended by a signal that has no name.
            Err(Errno::EINVAL) => Some(true),
            Err(_) => None,
        }
    }

    #[cfg(not(any(
        target_os = "android",
        target_os = "freebsd",
        all(target_os = "linux", not(target_env = "uclibc"))
    )))]
    fn has_exited(&self) -> Option<bool> {
        None
    }

    fn try_wait(&mut self) -> io::Result<Option<ExitStatus>> {
        if self.has_ended {
            return self.child.try_wait();
        }
        let has_exited = self.has_exited();
        match has_exited {
            Some(true) => self.end_descendants(),
            Some(false) => return Ok(None),
            None => {}
        }
        let status = self.child.try_wait()?;
        if status.is_some() {
            // Where only reaping tells that it has ended, its number has been free for a moment.
            if has_exited.is_none() {
                self.end_descendants();
            }
            self.has_ended = true;
        }
        Ok(status)
    }

    fn end(&mut self) {
        if !self.has_ended {
            self.end_descendants();
            // It may have ended by itself.
            let _ = self.child.kill();
            let _ = self.child.wait();
            self.has_ended = true;
        }
    }
}

/// A process, killed when it is dropped, with what it started.
#[derive(Debug)]
pub struct Process(Arc<Mutex<Running>>);

impl Process {
    /// Starts a command.
    ///
    /// # Errors
    /// What the system says.
    pub fn start(command: &mut Command) -> io::Result<Process> {
        let mut started = lock(&STARTED);
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(command, 0);
        let running = Running { child: command.spawn()?, has_ended: false };
        let running = Arc::new(Mutex::new(running));
        started.push(Arc::clone(&running));
        Ok(Process(running))
    }

    /// Its pipes, those that were asked for, each once.
    pub fn pipes(&self) -> (Option<ChildStdin>, Option<ChildStdout>, Option<ChildStderr>) {
        let child = &mut lock(&self.0).child;
        (child.stdin.take(), child.stdout.take(), child.stderr.take())
    }

    /// How it ended, if it has; what it started ends then.
    ///
    /// # Errors
    /// What the system says.
    pub fn try_wait(&self) -> io::Result<Option<ExitStatus>> {
        lock(&self.0).try_wait()
    }

    /// How it ended, once it has; what it started ends then.
    ///
    /// # Errors
    /// What the system says.
    pub fn wait(&self) -> io::Result<ExitStatus> {
        loop {
            match self.try_wait()? {
                Some(status) => return Ok(status),
                None => std::thread::sleep(LOOK),
            }
        }
    }

    /// Ends it, if it has not ended.
    pub fn end(&self) {
        lock(&self.0).end();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.end();
        lock(&STARTED).retain(|other| !Arc::ptr_eq(other, &self.0));
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::Process;
    #[cfg(target_os = "linux")]
    use super::{LOOK, lock};
    use std::io::{BufRead, BufReader, Read};
    use std::process::{Command, Stdio};

    #[test]
    fn what_a_process_started_ends_with_it() {
        let mut command = Command::new("sh");
        command.args(["-c", "sleep 100 & echo started; exit 3"]).stdout(Stdio::piped());
        let process = Process::start(&mut command).expect("a shell");
        let (_, said, _) = process.pipes();
        let mut said = BufReader::new(said.expect("a pipe"));
        let mut line = String::new();
        said.read_line(&mut line).expect("a line");
        let status = process.wait().expect("a process");
        // The pipe has an end only once nobody holds it.
        said.read_to_string(&mut line).expect("the end");
        assert_eq!((line.as_str(), status.code()), ("started\n", Some(3)));
    }

    /// What it started is ended by its number, which must be its own until then.
    #[cfg(target_os = "linux")]
    #[test]
    fn an_end_is_known_before_the_number_is_free() {
        let process = Process::start(Command::new("sh").args(["-c", "exit 3"])).expect("a shell");
        while lock(&process.0).has_exited() == Some(false) {
            std::thread::sleep(LOOK);
        }
        let number = lock(&process.0).child.id();
        let status = std::fs::read_to_string(format!("/proc/{number}/stat")).expect("a process that is not reaped");
        assert!(status.contains(") Z "), "{status}");
        assert_eq!(process.wait().expect("a process").code(), Some(3));
    }
}
