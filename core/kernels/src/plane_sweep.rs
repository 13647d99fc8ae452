//! The training-free field for any scene: planes of equal disparity are swept through a camera's frustum, the source
//! views are compared on them, and a picture is blended from the planes on which they agree.
//!
//! The frustum is the target's, for a picture, or a source's, for its disparities. Stages, each a data-parallel kernel:
//!
//! ```text
//! frustum     the planes, and their points' image coordinates     FrustumBlock, SweptView, Track
//! evidence    what the views show there, compared by colour       Evidence
//! census      ... and by its structure: soft census                census_cost
//! window      means over windows of three sizes                    row_sums, window_cost
//! front       the first opaque plane of each ray, by the sources' surfaces  FrontBlock, plane_opacity, Front
//! path        semi-global regularisation along four directions     Line, joined_cost
//! disparity   a source's disparity and its confidence              pick_disparity
//! consistency ... by what other sources say of it                  ConfirmBlock, confirmed
//! blend       a target's pixel: softmax over planes                blend
//! ```
//!
//! Disparity is the inverse of the depth along the principal axis, in inverse world units; 0 is infinitely far. Planes
//! go from far to near. Volumes hold [`PLANES`] neighbouring planes in an element and are laid out `[row][column][group
//! of planes]`.
//!
//! Published ideas: plane sweeping (Collins 1996), census (Zabih and Woodfill 1994), semi-global matching (Hirschmüller
//! 2008), soft visibility and consensus (Penner and Zhang, "Soft 3D reconstruction", 2017), blending by relevance
//! (Buehler et al. 2001). The cameras' weights enter twice: in the pairs that are compared, and in the blend.

pub mod blend;
pub mod census;
pub mod consistency;
pub mod disparity;
pub mod evidence;
pub mod front;
pub mod frustum;
pub mod path;
pub mod window;

use viewfuse_core::math::min;

/// Neighbouring planes in an element of a volume.
pub const PLANES: usize = 16;
/// Most planes of a frustum.
pub const MAX_PLANES: usize = 128;
/// Most groups of planes of a frustum.
pub const MAX_GROUPS: usize = MAX_PLANES / PLANES;
/// Most views that are compared in a frustum.
pub const MAX_MATCHED: usize = 8;

/// A number for each plane of a group.
pub type Planes = [f32; PLANES];

/// Of each plane the smaller one of `least` and `costs`, in `least`.
#[inline(always)]
pub fn lessen(least: &mut Planes, costs: &Planes) {
    let mut plane = 0;
    while plane < PLANES {
        least[plane] = min(costs[plane], least[plane]);
        plane += 1;
    }
}

/// The least of a group's costs: halves are compared, then halves of these.
#[inline(always)]
pub fn least_of(costs: &Planes) -> f32 {
    let mut least = *costs;
    let mut half = PLANES / 2;
    while half > 0 {
        let mut plane = 0;
        while plane < half {
            least[plane] = min(least[plane + half], least[plane]);
            plane += 1;
        }
        half /= 2;
    }
    least[0]
}
