//! The visual hull at its ends: beyond an image, at any focal length and at any distance.

use viewfuse::check::world::World;
use viewfuse_kernels::visual_hull::NO_SURFACE;
use viewfuse_kernels::visual_hull::hull::{hull_alpha, hull_entry};
use viewfuse_kernels::visual_hull::shade::{EMPTY, sample};

/// A point beyond the right border of the first image, inside the others.
#[test]
fn beyond_an_image_its_border_goes_on() {
    let mut world = World::new(1);
    let middle = world.object.middle();
    world.texels.fill([1.0; 4]);
    // Every pixel's surface is as far away as the point.
    for view in &world.views {
        let first = view.first_texel as usize;
        world.depths[first..first + (view.width * view.height) as usize].fill(view.project(middle).depth);
    }
    let first = world.views[0];
    world.views[0].intrinsics[2] += 2.0 * first.width as f32;
    let alpha = |world: &World| hull_alpha(&world.object, &world.views[..], &world.texels[..], middle, 0.3);
    let shade = |world: &World| {
        sample(
            &world.object,
            &world.views[..],
            &world.footprints,
            &world.texels[..],
            &world.depths[..],
            &world.weights,
            middle,
        )
    };
    assert!(!world.views[0].project(middle).in_image && world.views[0].project(middle).in_front);
    // The border shows the object: the image cuts it off, and says nothing of what is beyond.
    assert_eq!(alpha(&world), 1.0);
    assert!(shade(&world) != EMPTY);
    let texels = first.first_texel as usize..(first.first_texel + first.width * first.height) as usize;
    let last_column = texels.skip(first.width as usize - 1).step_by(first.width as usize);
    last_column.for_each(|texel| world.texels[texel] = [0.0; 4]);
    // The border shows background: the object ends inside the image.
    assert_eq!(alpha(&world), 0.0);
    assert_eq!(shade(&world), EMPTY);
}

#[test]
fn hull_entry_ends_at_any_focal_length() {
    let mut world = World::new(1);
    world.views.iter_mut().for_each(|view| view.intrinsics[0] = 1.0e9);
    // Enough for a pixel to ask, too little for any point to belong to the hull.
    world.texels.iter_mut().for_each(|texel| texel[3] = 0.15);
    let World { object, views, texels, .. } = &world;
    let pixel = views[0].width * views[0].height / 2;
    assert_eq!(hull_entry(object, &views[..], &texels[..], 0, pixel), NO_SURFACE);
}

/// Cameras a million units away, where depths are an eighth apart, with such a lens that steps are shorter.
#[test]
fn hull_entry_ends_at_any_distance() {
    let mut world = World::new(1);
    for view in &mut world.views {
        let back = 5.0e5;
        for axis in [&mut view.pose.right, &mut view.pose.down, &mut view.pose.forward] {
            axis[3] *= back;
        }
        view.intrinsics[0] = (50.0 * view.intrinsics[0] * back).min(1.0e9);
        view.intrinsics[1] = (50.0 * view.intrinsics[1] * back).min(1.0e9);
    }
    world.texels.iter_mut().for_each(|texel| texel[3] = 0.15);
    let World { object, views, texels, .. } = &world;
    for pixel in 0..views[0].width * views[0].height {
        assert_eq!(hull_entry(object, &views[..], &texels[..], 0, pixel), NO_SURFACE);
    }
}
