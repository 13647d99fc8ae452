//! Splits: of a data set's scenes, or of a scene's views.

/// A split of the scenes of a data set, or of the views of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// For training.
    Train,
    /// For validation during training.
    Validation,
    /// For testing the result.
    Test,
}

viewfuse_job::named! {
    // The suffixes of folders.
    pub Split: "a split of a data set" {
        Train => "train",
        Validation => "val",
        Test => "test",
    }
}
