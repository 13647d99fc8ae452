//! Structure from motion for `viewfuse pose`, as a process of its own: jobs as lines of JSON from standard input, to
//! each progress and the answer as lines of JSON to standard output, until there are no more.
//!
//! ```text
//! job          photographs and what is known of their cameras
//! answer       poses, lenses, points, or why there are none
//! apart        whether photographs of one camera have one focal length
//! remembered   features and matches, for the next job with the same photographs
//! solve        OpenMVG's front end and its incremental engine
//! ```
//!
//! A process, because what it calls is a young library: what breaks it, or takes too much, ends here, and whoever
//! started it says so. It reads no environment variables and writes no files. Exit code 0 behind the last answer, also
//! one without poses; 1 for a job that cannot be read.

mod answer;
mod apart;
mod job;
mod remembered;
mod solve;

use answer::Line;
use remembered::Remembered;
use std::io::{BufRead, Write};
use std::process::ExitCode;

fn main() -> ExitCode {
    // `viewfuse pose` says `--version jobs`. An earlier program, which reads one job up to the end of its input, says its
    // version then and ends: that end would not come.
    if std::env::args().skip(1).eq(["--version"]) {
        println!("{} {}, {}", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"), solve::SOLVER);
        return ExitCode::SUCCESS;
    }
    let mut remembered = Remembered::default();
    for line in std::io::stdin().lock().lines() {
        let job = line.map_err(|error| error.to_string());
        let job = match job.and_then(|line| serde_json::from_str(&line).map_err(|error| error.to_string())) {
            Ok(job) => job,
            Err(error) => {
                eprintln!("viewfuse-openmvg works for `viewfuse pose`: jobs as lines of JSON: {error}");
                return ExitCode::FAILURE;
            }
        };
        let answer = match solve::solve(&job, &mut remembered) {
            Ok(solution) => Line::Solution(solution),
            Err(error) => Line::Failed { reason: error.to_string() },
        };
        if !say(&answer) {
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

/// Writes a line; whether there is still somebody who reads it.
fn say(line: &Line) -> bool {
    let mut out = std::io::stdout().lock();
    serde_json::to_writer(&mut out, line).is_ok() && out.write_all(b"\n").is_ok() && out.flush().is_ok()
}
