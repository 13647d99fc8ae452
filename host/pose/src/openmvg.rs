//! OpenMVG's crates, as a process of their own: `viewfuse-openmvg`, which is built from this crate's folder `openmvg`.

use crate::process::{GRACE, LOOK, end_of};
use crate::solution::{Features, MAX_ANSWER, PoseJob, Solution, Solver, SolverError};
use serde::Deserialize;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{ChildStderr, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel, sync_channel};
use std::thread;
use std::time::Instant;
use viewfuse_job::digest::sha256_of;
use viewfuse_job::process::Process;
use viewfuse_job::progress::Progress;

/// Most lines of progress: a hundred photographs have 4,950 pairs, and some stages for each.
const MAX_PROGRESS: usize = 1 << 18;

/// Lines that are read ahead.
const MAX_WAITING: usize = 16;

/// Most bytes of its standard error that are kept.
const MAX_COMPLAINT: u64 = 1 << 16;

/// Most characters of a stage's name and of a reason.
const MAX_WORDS: usize = 200;

/// Stages that a process goes through; some several times.
const STAGE_COUNT: usize = 8;

/// The program `viewfuse-openmvg`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpenMvg {
    /// Its file.
    pub program: PathBuf,
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
        let broken = |problem: String| SolverError::Broken(self.program.clone(), problem);
        let unread = |error: &dyn std::fmt::Display| broken(format!("its answer cannot be read: {error}"));
        let Started { process, lines, complaint } = self.start(job)?;
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
                Ok(Line::Solution(solution)) if solution.fits(job) => return Ok(solution),
                Ok(Line::Solution(_)) => return Err(broken("its answer does not fit the photographs".to_owned())),
                Ok(Line::Failed { reason }) => return Err(SolverError::Nothing(beginning(&reason))),
                Err(error) => return Err(unread(&error)),
            }
        }
        let ended = match end_of(&process, progress)? {
            Some(status) => format!("ended without an answer ({status})"),
            None => "closed its output without an answer, and stayed".to_owned(),
        };
        // Its standard error ends with it.
        drop(process);
        let words = complaint.recv_timeout(GRACE).unwrap_or_default();
        let words = beginning(words.lines().next().unwrap_or_default());
        Err(broken(format!("{ended}{}{words}", if words.is_empty() { "" } else { ": " })))
    }
}

/// As much of a text as a person reads.
fn beginning(text: &str) -> String {
    text.chars().take(MAX_WORDS).collect()
}

/// The lines of an answer, of which few wait to be taken.
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

/// A process at work, the lines of its answer, and what it complains of.
struct Started {
    process: Process,
    lines: Receiver<io::Result<String>>,
    complaint: Receiver<String>,
}

impl OpenMvg {
    /// Starts the process and gives it the job.
    fn start(&self, job: &PoseJob) -> Result<Started, SolverError> {
        let mut command = Command::new(&self.program);
        command.env("RAYON_NUM_THREADS", rayon::current_num_threads().to_string());
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let process = Process::start(&mut command);
        let process = process.map_err(|cause| SolverError::not_started(self.name(), &self.program, &cause))?;
        let (Some(mut input), Some(said), Some(complained)) = process.pipes() else {
            let problem = "has no input or output".to_owned();
            return Err(SolverError::Broken(self.program.clone(), problem));
        };
        let text = serde_json::to_vec(job).unwrap_or_default();
        // A process that does not take it, or has ended already, is noticed by its missing answer.
        thread::spawn(move || input.write_all(&text));
        Ok(Started { process, lines: lines_of(said), complaint: beginning_of(complained) })
    }
}
