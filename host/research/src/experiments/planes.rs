//! A target's planes, as the last kernel of the plane sweep gets them: what better depths, visibility or blending would gain
//! is measured on them.
//!
//! ```text
//! keeping    a device that keeps them
//! samples    what the sources show on them
//! visit      the targets of a protocol, with theirs
//! ```

mod keeping;
pub(crate) mod samples;
pub(crate) mod visit;

use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::blend::BlendBlock;
use viewfuse_kernels::plane_sweep::frustum::SweptView;
use viewfuse_scene::photographs::SourceImage;

/// The arguments of [`viewfuse_kernels::plane_sweep::blend::blend`] for a target.
#[derive(Clone, Debug)]
pub(crate) struct TargetPlanes {
    /// The target and its planes.
    pub(crate) block: BlendBlock,
    /// The views that are blended, the greatest weights first.
    pub(crate) views: Vec<SweptView>,
    /// Of all sources, at the size of the pictures: premultiplied red, green, blue, and alpha. `[source][row][column]`.
    pub(crate) texels: Vec<[f32; 4]>,
    /// Of all sources, at the size of the comparison: disparity in inverse world units, and confidence.
    pub(crate) disparities: Vec<[f32; 2]>,
    /// Costs of the planes, at the size of the comparison: `[row][column][group]`.
    pub(crate) costs: Vec<Planes>,
}

impl TargetPlanes {
    /// The index of each blended view in the sources, whose texels lie one behind the other.
    pub(crate) fn sources(&self, images: &[SourceImage]) -> Vec<usize> {
        let starts: Vec<usize> = images
            .iter()
            .scan(0, |end, image| {
                let start = *end;
                *end += image.texels.len();
                Some(start)
            })
            .collect();
        let source = |view: &SweptView| starts.iter().position(|start| *start == view.camera.first_texel as usize);
        self.views.iter().filter_map(source).collect()
    }
}
