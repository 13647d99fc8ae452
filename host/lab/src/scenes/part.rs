//! Parts: primitives, placed and painted; and boxes around them, which say what a ray may meet.
//!
//! Every part has a box with world axes, and so has every run of eight parts in the list: where neighbours in the
//! list are neighbours in the world, a ray passes by eight at a time. The boxes are a little larger than the
//! parts, so that which parts are met never depends on rounding here.

use crate::scenes::placement::Placement;
use crate::scenes::shape::Shape;
use crate::scenes::texture::Finish;
use core::ops::Range;
use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, max, min};

/// Parts of a cluster.
const CLUSTER_SIZE: usize = 8;

/// How much larger a box is taken, in world units: more than tracing takes a part's own box.
const MARGIN: f32 = 2.0e-3;

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

/// A box with world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cuboid {
    low: Vec3,
    high: Vec3,
}

impl Cuboid {
    /// The box around a part.
    fn around(part: &Part) -> Cuboid {
        let half = part.shape.half_box();
        let reach = |axis: Vec3| {
            let local = part.placement.rotate_to_local(axis);
            Vec3::new(abs(local.x), abs(local.y), abs(local.z)).dot(half) + MARGIN
        };
        let reach = Vec3::new(reach(Vec3::X), reach(Vec3::Y), reach(Vec3::Z));
        let centre = part.placement.origin_world();
        Cuboid { low: centre - reach, high: centre + reach }
    }

    /// The box around boxes.
    fn around_all(boxes: &[Cuboid]) -> Cuboid {
        let nothing = Cuboid { low: Vec3::splat(f32::MAX), high: Vec3::splat(f32::MIN) };
        boxes.iter().fold(nothing, |all, one| Cuboid { low: all.low.min(one.low), high: all.high.max(one.high) })
    }
}

/// A ray that is held against many boxes.
#[derive(Clone, Copy, Debug)]
pub struct Probe {
    origin: Vec3,
    inverse: Vec3,
}

impl Probe {
    /// The ray from here in this direction.
    pub fn new(origin_world: Vec3, direction_world: Vec3) -> Probe {
        // Finite also across the direction, so that nothing becomes 0 times infinity.
        let inverse = |step: f32| if abs(step) > 1.0e-30 { 1.0 / step } else { 1.0e30 };
        let d = direction_world;
        Probe { origin: origin_world, inverse: Vec3::new(inverse(d.x), inverse(d.y), inverse(d.z)) }
    }

    /// Whether the ray passes through the box before `limit`.
    fn meets(&self, cuboid: &Cuboid, limit: f32) -> bool {
        let to_low = (cuboid.low - self.origin) * self.inverse;
        let to_high = (cuboid.high - self.origin) * self.inverse;
        let enter = max(max(min(to_low.x, to_high.x), min(to_low.y, to_high.y)), min(to_low.z, to_high.z));
        let leave = min(min(max(to_low.x, to_high.x), max(to_low.y, to_high.y)), max(to_low.z, to_high.z));
        max(enter, 0.0) <= min(leave, limit)
    }
}

/// The boxes around an object's parts, in their order.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    parts: Vec<Cuboid>,
    clusters: Vec<Cuboid>,
}

impl Bounds {
    /// Boxes around these parts.
    pub fn new(parts: &[Part]) -> Bounds {
        let parts: Vec<Cuboid> = parts.iter().map(Cuboid::around).collect();
        let clusters = parts.chunks(CLUSTER_SIZE).map(Cuboid::around_all).collect();
        Bounds { parts, clusters }
    }

    /// How many clusters there are.
    pub fn cluster_count(&self) -> usize {
        self.clusters.len()
    }

    /// Indices of the parts of a cluster, none if the ray passes it by or reaches it only after `limit`.
    pub fn parts_of(&self, cluster: usize, probe: &Probe, limit: f32) -> Range<usize> {
        let first = cluster * CLUSTER_SIZE;
        let met = self.clusters.get(cluster).is_some_and(|cuboid| probe.meets(cuboid, limit));
        if met { first..(first + CLUSTER_SIZE).min(self.parts.len()) } else { first..first }
    }

    /// Whether the ray may meet the part before `limit`.
    pub fn may_meet(&self, part: usize, probe: &Probe, limit: f32) -> bool {
        self.parts.get(part).is_some_and(|cuboid| probe.meets(cuboid, limit))
    }
}
