//! Where a primitive stands in the world: a rotation and a translation.
//!
//! Not a [`viewfuse_core::pose::Pose`]: that one is a camera's, with axes named after an image.

use viewfuse_core::Vec3;
use viewfuse_core::math::sin_cos;

/// A rigid map from a primitive's own coordinates to the world's. Orthonormal by construction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    x_world: Vec3,
    y_world: Vec3,
    z_world: Vec3,
    origin_world: Vec3,
}

impl Placement {
    /// Unturned, with the local origin at this world point.
    pub const fn at(x: f32, y: f32, z: f32) -> Placement {
        Placement { x_world: Vec3::X, y_world: Vec3::Y, z_world: Vec3::Z, origin_world: Vec3::new(x, y, z) }
    }

    /// Turned about its own x axis by `angle` radians, y towards z.
    pub fn turned_about_x(self, angle: f32) -> Placement {
        let (y_world, z_world) = turned(self.y_world, self.z_world, angle);
        Placement { y_world, z_world, ..self }
    }

    /// Turned about its own y axis by `angle` radians, z towards x.
    pub fn turned_about_y(self, angle: f32) -> Placement {
        let (z_world, x_world) = turned(self.z_world, self.x_world, angle);
        Placement { z_world, x_world, ..self }
    }

    /// Turned about its own z axis by `angle` radians, x towards y.
    pub fn turned_about_z(self, angle: f32) -> Placement {
        let (x_world, y_world) = turned(self.x_world, self.y_world, angle);
        Placement { x_world, y_world, ..self }
    }

    /// The placement of a thing that is placed so in a group, when the group is placed by `group`.
    pub fn within(&self, group: &Placement) -> Placement {
        Placement {
            x_world: group.rotate_to_world(self.x_world),
            y_world: group.rotate_to_world(self.y_world),
            z_world: group.rotate_to_world(self.z_world),
            origin_world: group.rotate_to_world(self.origin_world) + group.origin_world,
        }
    }

    /// The local origin in world coordinates.
    pub fn origin_world(&self) -> Vec3 {
        self.origin_world
    }

    /// A world point in local coordinates.
    pub fn to_local(&self, point_world: Vec3) -> Vec3 {
        self.rotate_to_local(point_world - self.origin_world)
    }

    /// A world direction in local coordinates.
    pub fn rotate_to_local(&self, direction_world: Vec3) -> Vec3 {
        let d = direction_world;
        Vec3::new(self.x_world.dot(d), self.y_world.dot(d), self.z_world.dot(d))
    }

    /// A local direction in world coordinates.
    pub fn rotate_to_world(&self, direction_local: Vec3) -> Vec3 {
        self.x_world * direction_local.x + self.y_world * direction_local.y + self.z_world * direction_local.z
    }
}

/// Two perpendicular axes, turned in their plane, the first towards the second.
fn turned(first: Vec3, second: Vec3, angle: f32) -> (Vec3, Vec3) {
    let (sine, cosine) = sin_cos(angle);
    (first * cosine + second * sine, second * cosine - first * sine)
}
