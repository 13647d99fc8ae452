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
    for own in from {
        if !named.contains(own) {
            named.push(*own);
        }
    }
    let of = |own: From| -> Box<dyn Solver> {
        match own {
            From::Openmvg => Box::new(OpenMvg { program: openmvg() }),
            From::Colmap => Box::new(Colmap { program: colmap() }),
            From::Pycolmap => Box::new(PyColmap { python: python() }),
        }
    };
    named.into_iter().map(of).collect()
}
