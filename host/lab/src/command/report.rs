//! `viewfuse-lab report`.

use crate::report::{Evaluation, Report, Sweep, Training, page};
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse_cli::shared::{keep_others, refuse_extension, say};
use viewfuse_job::files::{check_writable, write_whole};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse-lab report runs/random runs/close runs/count -o report.html\n      three evaluations with their tables, \
    figures and pictures\n  viewfuse-lab report runs/count --pareto out/pareto.json --training trained -o \
    report.html\n      with error over run time, and the curves of a training\n\n\
    The page is a single file without scripts and without links to other files. Evaluations and trainings may still be \
    running.")]
pub(super) struct Arguments {
    /// Folders of `evaluate --protocol`
    #[arg(value_name = "DIR", required_unless_present_any = ["pareto", "training"])]
    evaluations: Vec<PathBuf>,
    /// A pareto.json, or its folder; may be given several times
    #[arg(long, value_name = "FILE")]
    pareto: Vec<PathBuf>,
    /// A folder of `train`; may be given several times
    #[arg(long, value_name = "DIR")]
    training: Vec<PathBuf>,
    /// Heading of the page
    #[arg(long, value_name = "TEXT", default_value = "View weighting")]
    title: String,
    /// The page
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// `640 bytes`, `38 kB`, `2.4 MB`.
fn size_words(bytes: usize) -> String {
    match bytes {
        0..=999 => format!("{bytes} bytes"),
        1000..=999_499 => format!("{:.0} kB", bytes as f64 / 1.0e3),
        _ => format!("{:.1} MB", bytes as f64 / 1.0e6),
    }
}

pub(super) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    refuse_extension(&arguments.output, "a page", &["html", "htm"])?;
    check_writable(&arguments.output)?;
    keep_others(&arguments.output)?;
    let report = Report {
        title: arguments.title.clone(),
        evaluations: arguments.evaluations.iter().map(|path| Evaluation::open(path)).collect::<Result<_, _>>()?,
        sweeps: arguments.pareto.iter().map(|path| Sweep::open(path)).collect::<Result<_, _>>()?,
        trainings: arguments.training.iter().map(|path| Training::open(path)).collect::<Result<_, _>>()?,
    };
    let page = page(&report)?;
    write_whole(&arguments.output, page.as_bytes())?;
    say(format_args!("{}: {}", arguments.output.display(), size_words(page.len())))?;
    Ok(ExitCode::SUCCESS)
}
