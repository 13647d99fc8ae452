//! The solvers of `viewfuse pose`, by name.

use crate::cli::environment::{colmap, openmvg, python};
use clap::ValueEnum;
use viewfuse_pose::{Colmap, OpenMvg, PyColmap, Solver};

/// What finds poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum From {
    /// OpenMVG's crates, as the program viewfuse-openmvg
    Openmvg,
    /// Your own COLMAP, as the program colmap
    Colmap,
    /// Your own pycolmap, by python3
    Pycolmap,
}

/// The solvers, each once.
pub(super) fn solvers(from: &[From]) -> Vec<Box<dyn Solver>> {
    let mut named: Vec<From> = Vec::new();
    for solver in from {
        if !named.contains(solver) {
            named.push(*solver);
        }
    }
    let opened = |solver: From| -> Box<dyn Solver> {
        match solver {
            From::Openmvg => Box::new(OpenMvg::new(openmvg())),
            From::Colmap => Box::new(Colmap { program: colmap() }),
            From::Pycolmap => Box::new(PyColmap { python: python() }),
        }
    };
    named.into_iter().map(opened).collect()
}
