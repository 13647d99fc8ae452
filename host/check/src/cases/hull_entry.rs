//! [`Kernel::HullEntry`]: every pixel of every view of a small world. A dispatch for each view finds its part.

use super::*;
use crate::hull_oracle::{Scene, hull_entry};
use crate::world::{World, change_texels};

impl Case for HullEntry {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "up to 60 additions of a step to a depth of 3";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("object", |case| case.object[0].high[0] *= 1.01),
        ("views", |case| case.views[1].intrinsics[0] *= 1.01),
        ("texels", |case| change_texels(&mut case.texels[case.views[1].first_texel as usize..])),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<HullEntry> {
        let World { object, views, texels, .. } = World::of_size(seed, size);
        let of_view = |(view, camera): (u32, &CameraBlock)| HullEntry {
            view,
            pixel_count: camera.width * camera.height,
            object: vec![object],
            views: views.clone(),
            texels: texels.clone(),
            entries: part_of_output(view as usize, texels.len()),
        };
        (0..).zip(&views).map(of_view).collect()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let scene = Scene { object: &self.object[0], views: &self.views, texels: &self.texels };
        map(self.pixel_count as usize, 1, |pixel| hull_entry(&scene, self.view, pixel as u32))
    }
}
