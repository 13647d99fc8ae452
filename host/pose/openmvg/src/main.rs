//! Structure from motion for `viewfuse pose`, as a process of its own: one job as JSON from standard input, progress
//! and the answer as lines of JSON to standard output.
//!
//! ```text
//! job      photographs and what is known of their cameras
//! answer   poses, lenses, points, or why there are none
//! apart    whether photographs of one camera have one focal length
//! solve    OpenMVG's front end and its incremental engine
//! ```
//!
//! A process, because what it calls is a young library: what breaks it, or takes too much, ends here, and whoever
//! started it says so. It reads no environment variables and writes no files. Exit code 0 with an answer, also one
//! without poses; 1 for a job that cannot be read.

mod answer;
mod apart;
mod job;
mod solve;

use answer::Line;
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    if std::env::args().nth(1).as_deref() == Some("--version") {
        println!("{} {}, {}", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"), solve::SOLVER);
        return ExitCode::SUCCESS;
    }
    let job = match serde_json::from_reader(std::io::stdin().lock()) {
        Ok(job) => job,
        Err(error) => {
            eprintln!("viewfuse-openmvg works for `viewfuse pose`: a job as JSON on standard input: {error}");
            return ExitCode::FAILURE;
        }
    };
    let answer = match solve::solve(&job) {
        Ok(solution) => Line::Solution(solution),
        Err(error) => Line::Failed { reason: error.to_string() },
    };
    if say(&answer) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Writes a line; whether there is still somebody who reads it.
fn say(line: &Line) -> bool {
    let mut out = std::io::stdout().lock();
    serde_json::to_writer(&mut out, line).is_ok() && out.write_all(b"\n").is_ok() && out.flush().is_ok()
}
