//! A report: evaluations, sweeps of run time and trainings on one HTML page that holds everything it shows.
//!
//! The page needs no network and no scripts, and states so in its content security policy, which allows only its own
//! styles and pictures. It shows tables as papers print them (what is best as far as the intervals decide is bold),
//! figures as SVG, pictures, and the records of the runs.
//!
//! ```text
//! evaluation   a folder of `evaluate --protocol`: its tables, pictures, record
//! figure       a metric over the number of sources
//! table        tables of results
//! pictures     sources with weights, every scheme's prediction, the truth
//! sweep        error against run time
//! training     curves and records of `train`
//! page         the whole
//! ```

mod evaluation;
mod figure;
mod page;
mod pictures;
mod sweep;
mod table;
mod training;

pub use evaluation::Evaluation;
pub use page::page;
pub use sweep::Sweep;
pub use training::Training;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::path::{Path, PathBuf};
use viewfuse_evaluate::gallery::GalleryError;
use viewfuse_evaluate::pareto::plot::PlotError;
use viewfuse_evaluate::run_folder::FolderError;
use viewfuse_job::files::read_at_most;
use viewfuse_scene::SceneError;

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error(transparent)]
    Gallery(#[from] GalleryError),
    #[error("{}: cannot be read: {cause}", path.display())]
    Read { path: PathBuf, cause: std::io::Error },
    #[error("{}: is not a record of viewfuse {command}: {cause}", path.display())]
    Json { path: PathBuf, command: &'static str, cause: serde_json::Error },
    #[error("{}: is not the curve of a training", path.display())]
    NoCurve { path: PathBuf },
    #[error(transparent)]
    Picture(#[from] SceneError),
    #[error(transparent)]
    Plot(#[from] PlotError),
    #[error("a figure cannot be drawn: {0}")]
    Figure(String),
}

/// Everything that a page shows.
#[derive(Debug, Default)]
pub struct Report {
    /// Its heading.
    pub title: String,
    /// Evaluations, in the order in which they are shown.
    pub evaluations: Vec<Evaluation>,
    /// Sweeps of run time.
    pub sweeps: Vec<Sweep>,
    pub trainings: Vec<Training>,
}

/// Most bytes of a record or a curve.
const LONGEST_RECORD: u64 = 256 << 20;

fn read(path: &Path) -> Result<Vec<u8>, ReportError> {
    read_at_most(path, LONGEST_RECORD).map_err(|cause| ReportError::Read { path: path.to_path_buf(), cause })
}

/// Bytes as a data URL.
fn data_address(kind: &str, bytes: &[u8]) -> String {
    format!("data:{kind};base64,{}", STANDARD.encode(bytes))
}

/// `1 scene`, `2 scenes`.
fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}
