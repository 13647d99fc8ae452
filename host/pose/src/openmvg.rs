//! OpenMVG's crates, as a process of their own: `viewfuse-openmvg`, which is built from this crate's folder `openmvg`.
//! It stays for the next job: features and matches are found once for all jobs with the same photographs.

use crate::process::{GRACE, LOOK, end_of};
use crate::solution::{Features, MAX_ANSWER, PoseJob, Solution, Solver, SolverError};
use serde::Deserialize;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Instant;
use viewfuse_job::digest::sha256_of;
use viewfuse_job::process::Process;
use viewfuse_job::progress::{Interrupted, Progress};

/// Most lines of progress: a hundred photographs have 4,950 pairs, and some stages for each.
const MAX_PROGRESS: usize = 1 << 18;

/// Lines that are read ahead.
const MAX_WAITING: usize = 16;

/// Most bytes of its standard error that are kept.
const MAX_COMPLAINT: u64 = 1 << 16;

/// Most characters of a stage's name and of a reason.
const MAX_WORDS: usize = 200;

/// What an earlier program is asked for that reads one job, up to the end of its input: this one gets more of them.
const ASKED: &str = "version";

/// Stages that a process goes through; some several times.
const STAGE_COUNT: usize = 8;

/// The program `viewfuse-openmvg`.
pub struct OpenMvg {
    program: PathBuf,
    /// A process that has answered, for the next job.
    idle: Mutex<Option<Started>>,
}

/// A line that it writes.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    Progress { stage: String, of: usize, done: usize },
    Solution(Solution),
    Failed { reason: String },
}

impl Solver for OpenMvg {
    fn name(&self) -> &'static str {
        "openmvg"
    }

    fn features(&self) -> &'static [Features] {
        &[Features::Alp, Features::Sift]
    }

    fn identity(&self, _: &dyn Progress) -> Option<String> {
        sha256_of(&self.program).ok()
    }

    fn solve(&self, job: &PoseJob, progress: &dyn Progress) -> Result<Solution, SolverError> {
        let idle = self.idle().take();
        // One that says more than it was asked is not asked again.
        if let Some(idle) = idle.filter(|idle| idle.lines.try_recv().is_err()) {
            match self.answer(&idle, job, progress) {
                // It ended behind its last answer.
                Ok(Answered::Not { has_spoken: false }) => {}
                answered => return self.with_idle(idle, answered, progress),
            }
        }
        let started = self.start()?;
        let answered = self.answer(&started, job, progress);
        self.with_idle(started, answered, progress)
    }

    fn rest(&self) {
        self.idle().take();
    }
}

/// What a process made of a job.
enum Answered {
    Solution(Solution),
    Nothing(String),
    /// It has nothing more to say.
    Not {
        has_spoken: bool,
    },
}

impl OpenMvg {
    /// Of this file.
    pub fn new(program: PathBuf) -> OpenMvg {
        OpenMvg { program, idle: Mutex::new(None) }
    }

    fn idle(&self) -> MutexGuard<'_, Option<Started>> {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn broken(&self, problem: String) -> SolverError {
        SolverError::Broken(self.program.clone(), problem)
    }

    /// What a process answered, which then waits for the next job; it ends where it has not answered.
    fn with_idle(
        &self,
        started: Started,
        answered: Result<Answered, SolverError>,
        progress: &dyn Progress,
    ) -> Result<Solution, SolverError> {
        let answer = match answered? {
            Answered::Solution(solution) => Ok(solution),
            Answered::Nothing(reason) => Err(SolverError::Nothing(reason)),
            Answered::Not { .. } => return Err(self.without_answer(started, progress)?),
        };
        *self.idle() = Some(started);
        answer
    }

    /// Gives a process a job and waits for its answer.
    fn answer(&self, started: &Started, job: &PoseJob, progress: &dyn Progress) -> Result<Answered, SolverError> {
        let Started { process, jobs, lines, .. } = started;
        let broken = |problem: String| self.broken(problem);
        let unread = |error: &dyn std::fmt::Display| broken(format!("its answer cannot be read: {error}"));
        let mut text = serde_json::to_vec(job).unwrap_or_default();
        text.push(b'\n');
        // A process that does not take it, or has ended already, is noticed by its missing answer.
        let _ = jobs.send(text);
        let (mut begun, mut told, mut has_ended) = (0, 0, None);
        loop {
            progress.check()?;
            let line = match lines.recv_timeout(LOOK) {
                // It has ended, and something that it started and nobody can end still holds its output.
                Err(RecvTimeoutError::Timeout) if has_ended.is_some_and(|at: Instant| at.elapsed() > GRACE) => break,
                Err(RecvTimeoutError::Timeout) => {
                    let status = process.try_wait().map_err(|error| broken(error.to_string()))?;
                    has_ended = has_ended.or(status.map(|_| Instant::now()));
                    continue;
                }
                Err(RecvTimeoutError::Disconnected) => break,
                Ok(line) => line.map_err(|error| unread(&error))?,
            };
            match serde_json::from_str(&line) {
                Ok(Line::Progress { .. }) if told == MAX_PROGRESS => {
                    return Err(broken(format!("says its progress without end, in more than {MAX_PROGRESS} lines")));
                }
                Ok(Line::Progress { stage, of, done }) => {
                    told += 1;
                    if done > 0 {
                        progress.step();
                    } else {
                        let place = begun.min(STAGE_COUNT - 1);
                        progress.stage(&beginning(&stage), place..place + 1, STAGE_COUNT);
                        progress.expect(of);
                        begun += 1;
                    }
                }
                Ok(Line::Solution(solution)) if solution.fits(job) => return Ok(Answered::Solution(solution)),
                Ok(Line::Solution(_)) => return Err(broken("its answer does not fit the photographs".to_owned())),
                Ok(Line::Failed { reason }) => return Ok(Answered::Nothing(beginning(&reason))),
                Err(_) if line.starts_with("viewfuse-openmvg ") => {
                    return Err(broken("is of an earlier version than this command: build it again".to_owned()));
                }
                Err(error) => return Err(unread(&error)),
            }
        }
        Ok(Answered::Not { has_spoken: told > 0 })
    }

    /// What is said of a process that has not answered.
    fn without_answer(&self, started: Started, progress: &dyn Progress) -> Result<SolverError, Interrupted> {
        let Started { process, complaint, .. } = started;
        let ended = match end_of(&process, progress)? {
            Some(status) => format!("ended without an answer ({status})"),
            None => "closed its output without an answer, and stayed".to_owned(),
        };
        // Its standard error ends with it.
        drop(process);
        let words = complaint.recv_timeout(GRACE).unwrap_or_default();
        let words = beginning(words.lines().next().unwrap_or_default());
        Ok(self.broken(format!("{ended}{}{words}", if words.is_empty() { "" } else { ": " })))
    }

    /// Starts the process.
    fn start(&self) -> Result<Started, SolverError> {
        let mut command = Command::new(&self.program);
        // An earlier program than this crate's says its version.
        command.arg(format!("--{ASKED}")).arg("jobs");
        command.env("RAYON_NUM_THREADS", rayon::current_num_threads().to_string());
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let process = Process::start(&mut command);
        let process = process.map_err(|cause| SolverError::not_started(self.name(), &self.program, &cause))?;
        let (Some(input), Some(said), Some(complained)) = process.pipes() else {
            return Err(self.broken("has no input or output".to_owned()));
        };
        Ok(Started { process, jobs: jobs_to(input), lines: lines_of(said), complaint: beginning_of(complained) })
    }
}

/// What takes jobs to a process, until it takes no more; its input ends with the last of them.
fn jobs_to(mut input: ChildStdin) -> Sender<Vec<u8>> {
    let (to_there, jobs) = channel::<Vec<u8>>();
    thread::spawn(move || jobs.iter().all(|job| input.write_all(&job).is_ok()));
    to_there
}

/// As much of a text as a person reads.
fn beginning(text: &str) -> String {
    text.chars().take(MAX_WORDS).collect()
}

/// The lines of answers, of which few wait to be taken; with its progress an answer has at most [`MAX_ANSWER`] bytes.
fn lines_of(said: ChildStdout) -> Receiver<io::Result<String>> {
    let (to_here, lines) = sync_channel(MAX_WAITING);
    thread::spawn(move || {
        let mut reader = BufReader::new(said.take(MAX_ANSWER));
        loop {
            let mut line = String::new();
            let line = match reader.read_line(&mut line) {
                Ok(_) if reader.get_ref().limit() == 0 => {
                    Err(io::Error::other(format!("it is longer than {MAX_ANSWER} bytes")))
                }
                Ok(0) => break,
                read => read.map(|_| line),
            };
            // Behind an answer comes that to the next job.
            if line.as_ref().is_ok_and(|line| !line.starts_with(r#"{"progress""#)) {
                reader.get_mut().set_limit(MAX_ANSWER);
            }
            let is_last = line.is_err();
            if to_here.send(line).is_err() || is_last {
                break;
            }
        }
    });
    lines
}

/// What stands at the beginning of a process's standard error, once that has ended or is longer. All of it is read: a
/// process ends that writes where nobody reads any more.
fn beginning_of(mut complained: ChildStderr) -> Receiver<String> {
    let (to_here, text) = channel();
    thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = complained.by_ref().take(MAX_COMPLAINT).read_to_end(&mut bytes);
        let _ = to_here.send(String::from_utf8_lossy(&bytes).into_owned());
        let _ = io::copy(&mut complained, &mut io::sink());
    });
    text
}

/// A process, what takes it jobs, the lines of its answers, and what it complains of.
struct Started {
    process: Process,
    jobs: Sender<Vec<u8>>,
    lines: Receiver<io::Result<String>>,
    complaint: Receiver<String>,
}
