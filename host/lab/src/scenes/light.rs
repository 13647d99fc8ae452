//! The lamps that an object stands under.

use viewfuse_core::Vec3;

/// Two lamps infinitely far away, fixed to the world, and light from all around that is brighter from above (world z).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Towards the key lamp, in world coordinates (z up), of any length but 0.
    pub key: Vec3,
    /// What the key lamp gives a surface that faces it; 1 shows a surface in its own colour.
    pub key_light: f32,
    /// Towards the fill lamp, which casts no shadows.
    pub fill: Vec3,
    /// What the fill lamp gives.
    pub fill_light: f32,
    /// Light from straight below and straight above.
    pub around: [f32; 2],
}

impl Default for Light {
    /// A key lamp high on one side and a weak fill lamp low on the other.
    fn default() -> Light {
        Light {
            key: Vec3::new(0.45, 0.55, 1.0),
            key_light: 0.62,
            fill: Vec3::new(-0.7, -0.6, 0.35),
            fill_light: 0.2,
            around: [0.25, 0.46],
        }
    }
}
