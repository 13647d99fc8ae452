//! What helps a person on from an error, as a code: a library does not know the words and options of the program that
//! shows the error, and that program does not take errors apart.

use std::error::Error;

/// What helps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hint {
    /// The list of views is to be written another way: the fault is in the option itself, whatever the scene is.
    ViewList,
    /// A view is to be a source or a target, not both.
    SourceOrTarget,
    /// Fewer sources.
    FewerSources,
    /// A choice of targets.
    Targets,
    /// Targets that are views: the cameras span no orbit.
    NoOrbit,
    /// Another path: the cameras span no spiral.
    NoSpiral,
    /// The colour of the background.
    Background,
    /// What masks mean.
    Masks,
    /// Poses that meet in an object, or another background: there is nothing that all silhouettes show.
    NoObject,
    /// Another size of the pictures.
    PictureSize,
    /// Another folder, or that the files of the earlier run may go.
    OtherRun,
    /// A shard of its own for each process.
    Shard,
    /// A build that reads TIFF.
    BuildWithTiff,
    /// Poses for the photographs.
    Poses,
    /// Fewer photographs: every so many of them.
    FewerPhotographs,
    /// The program that this solver works with.
    Solver(&'static str),
    /// Another port.
    Port,
}

/// An error that may have a hint. An error that stands for another one has its hint.
pub trait Hinted: Error {
    /// The hint, if there is one.
    fn hint(&self) -> Option<Hint>;
}
