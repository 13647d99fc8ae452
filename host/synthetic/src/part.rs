//! Parts: primitives, placed and painted.

use crate::placement::Placement;
use crate::shape::Shape;
use crate::texture::Finish;

/// One primitive of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Its form.
    pub shape: Shape,
    /// Where it stands.
    pub placement: Placement,
    /// What it looks like.
    pub finish: Finish,
}
