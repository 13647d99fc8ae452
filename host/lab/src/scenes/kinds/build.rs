//! Putting parts together, in world coordinates.

use crate::scenes::part::Part;
use crate::scenes::placement::Placement;
use crate::scenes::prism::{Prism, Width};
use crate::scenes::shape::Shape;
use crate::scenes::texture::Finish;
use viewfuse_core::Vec3;
use viewfuse_core::math::{angle_from_components, max, min, sqrt};

/// The parts so far.
#[derive(Default)]
pub(crate) struct Build {
    pub(crate) parts: Vec<Part>,
}

impl Build {
    pub(crate) fn add(&mut self, shape: Shape, placement: Placement, finish: Finish) {
        self.parts.push(Part { shape, placement, finish });
    }

    /// A block around a point; its edges are as round as its size allows.
    pub(crate) fn block(&mut self, centre: [f32; 3], half_size: [f32; 3], rounding: f32, finish: Finish) {
        let half_size = Vec3::from_array(half_size);
        let rounding = min(rounding, min(min(half_size.x, half_size.y), half_size.z));
        self.add(Shape::Block { half_size, rounding }, place(centre), finish);
    }

    pub(crate) fn ellipsoid(&mut self, centre: [f32; 3], radii: [f32; 3], finish: Finish) {
        self.add(Shape::Ellipsoid { radii: Vec3::from_array(radii) }, place(centre), finish);
    }

    /// A rod with round ends between two points.
    pub(crate) fn rod(&mut self, from: Vec3, to: Vec3, radius: f32, finish: Finish) {
        let along = to - from;
        let middle = (from + to) * 0.5;
        // The local z axis is turned first about world z, then down.
        let level = sqrt(along.x * along.x + along.y * along.y);
        let turn = signed_angle(along.y, along.x);
        let placement = Placement::at(middle.x, middle.y, middle.z)
            .turned_about_z(turn)
            .turned_about_y(signed_angle(level, along.z));
        self.add(Shape::Capsule { half_length: along.length() * 0.5, radius }, placement, finish);
    }

    /// A prism whose outline and width are given in world coordinates; its own coordinates are the world's.
    pub(crate) fn prism(&mut self, corners: &[[f32; 2]], width: Width, finish: Finish) {
        self.add(Shape::Prism(Prism::new(corners, width)), Placement::at(0.0, 0.0, 0.0), finish);
    }

    /// As [`Build::prism`], with the local origin in the middle of the outline: for small ones, whose boxes are then
    /// small. It does not narrow towards the ends.
    pub(crate) fn small_prism(&mut self, corners: &[[f32; 2]], width: Width, finish: Finish) {
        let bounds = |axis: usize| {
            let ends = corners
                .iter()
                .fold([f32::MAX, f32::MIN], |[low, high], corner| [min(low, corner[axis]), max(high, corner[axis])]);
            0.5 * (ends[0] + ends[1])
        };
        let [x, z] = [bounds(0), bounds(1)];
        let moved: Vec<[f32; 2]> = corners.iter().map(|corner| [corner[0] - x, corner[1] - z]).collect();
        let width = Width { waist: width.waist - z, nose: 0.0, shoulder: 0.0, ..width };
        self.add(Shape::Prism(Prism::new(&moved, width)), Placement::at(x, 0.0, z), finish);
    }
}

/// Unturned, at a point.
pub(crate) fn place(centre: [f32; 3]) -> Placement {
    Placement::at(centre[0], centre[1], centre[2])
}

/// The angle of `(x, y)` from the x axis, in `[-pi, pi]`.
fn signed_angle(y: f32, x: f32) -> f32 {
    if y >= 0.0 { angle_from_components(y, x) } else { -angle_from_components(-y, x) }
}
