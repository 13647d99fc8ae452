//! OpenMVG's crates, as a process of their own: `viewfuse-openmvg`, which is built from this crate's folder `openmvg`.

use crate::process::{LOOK, Process};
use crate::solution::{Features, Job, Solution, Solver, SolverError};
use serde::Deserialize;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use viewfuse_job::digest::sha256_of;
use viewfuse_job::progress::Progress;

/// Most bytes of an answer: what is longer is not one.
const MAX_ANSWER: u64 = 1 << 30;

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

    fn solve(&self, job: &Job, progress: &dyn Progress) -> Result<Solution, SolverError> {
        let broken = |problem: String| SolverError::Broken { program: self.program.clone(), problem };
        let mut process = self.start(job)?;
        let (Some(said), Some(complained)) = (process.0.stdout.take(), process.0.stderr.take()) else {
            return Err(broken("has no output".to_owned()));
        };
        let (to_here, lines) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(said.take(MAX_ANSWER)).lines() {
                let is_read = line.is_ok();
                if to_here.send(line).is_err() || !is_read {
                    break;
                }
            }
        });
        let complaint = std::thread::spawn(move || {
            let mut text = String::new();
            let _ = complained.take(1 << 16).read_to_string(&mut text);
            text
        });
        let mut begun = 0;
        loop {
            progress.check()?;
            let line = match lines.recv_timeout(LOOK) {
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => break,
                Ok(line) => line.map_err(|error| broken(format!("its answer cannot be read: {error}")))?,
            };
            match serde_json::from_str(&line) {
                Ok(Line::Progress { stage, of, done }) => {
                    if done > 0 {
                        progress.step();
                    } else {
                        let place = begun.min(STAGE_COUNT - 1);
                        progress.stage(&stage, place..place + 1, STAGE_COUNT);
                        progress.expect(of);
                        begun += 1;
                    }
                }
                Ok(Line::Solution(solution)) if solution.fits(job) => return Ok(solution),
                Ok(Line::Solution(_)) => return Err(broken("its answer does not fit the photographs".to_owned())),
                Ok(Line::Failed { reason }) => return Err(SolverError::Nothing(reason)),
                Err(error) => return Err(broken(format!("its answer cannot be read: {error}"))),
            }
        }
        let ended = process.0.wait().map_err(|error| broken(error.to_string()))?;
        let words = complaint.join().unwrap_or_default();
        let words = words.lines().next().unwrap_or_default();
        Err(broken(format!("ended without an answer ({ended}){}{words}", if words.is_empty() { "" } else { ": " })))
    }
}

impl OpenMvg {
    /// Starts the process and gives it the job.
    fn start(&self, job: &Job) -> Result<Process, SolverError> {
        let missing = |cause| SolverError::not_started(self.name(), &self.program, &cause);
        let threads = rayon::current_num_threads().to_string();
        let child = Command::new(&self.program)
            .env("RAYON_NUM_THREADS", threads)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(missing)?;
        let mut process = Process(child);
        let text = serde_json::to_vec(job).unwrap_or_default();
        if let Some(mut input) = process.0.stdin.take() {
            // A process that has ended already is noticed by its missing answer.
            let _ = input.write_all(&text);
        }
        Ok(process)
    }
}
