//! Views at points behind their cameras: of weight 0, and neither looked up nor computed.

use super::{
    Omissions, assert_sound, exact, is_not_finite, mist, omitting, orbit, picture_with, recorded, sources, target,
};
use viewfuse::field::pixelnerf::{PixelNerfOptions, Sampling};
use viewfuse::scene::photographs::SourceImages;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::depths::stratified_depth;
use viewfuse_core::pose::Pose;
use viewfuse_core::rays::{CastBlock, cast_ray};
use viewfuse_core::weights::Weights;
use viewfuse_tests::fields::{line, weights};

const SIDE: u32 = 12;
const WEIGHTS: [f32; 3] = [0.5, 0.3, 0.2];

fn centre(camera: &Camera) -> Vec3 {
    camera.block(0).centre_world()
}

/// A target between the middle of the scene and source 1, at this share of the way, that looks out of the scene.
fn looking_out(sources: &SourceImages, share: f32) -> Camera {
    let outward = centre(&sources.images[1].camera);
    let pose = Pose::look_at(outward * share, outward * 5.0, Vec3::Z).expect("a pose");
    Camera { pose, pinhole: orbit(SIDE).pinhole }
}

fn with_near(near: f32, omissions: Omissions) -> PixelNerfOptions {
    let sampling = Sampling { near_far: Some([near, 1.8]), ..Sampling::default() };
    PixelNerfOptions { sampling, omissions, ..PixelNerfOptions::default() }
}

/// Everything that asks the network: two passes, with and without probes, and nodes.
fn ways() -> [Omissions; 3] {
    [Omissions::NONE, Omissions::default(), Omissions { nodes: 24, ..Omissions::default() }]
}

/// The sources, of which one is so bright that its latents are infinite or NaN: 0 times them is NaN.
fn spoiled(view: usize) -> SourceImages {
    let mut sources = sources(3);
    sources.images[view].texels.fill([1.0e38, 1.0e38, 1.0e38, 1.0]);
    sources
}

#[test]
fn nothing_of_a_view_behind_which_all_points_lie_reaches_the_picture() {
    let (sound, spoiled) = (sources(3), spoiled(1));
    let target = looking_out(&sound, 1.0);
    let others = SourceImages { images: [0, 2].map(|view| sound.images[view].clone()).to_vec(), ..sound.clone() };
    for omissions in ways() {
        let field = |unseen_points| mist(with_near(0.1, Omissions { unseen_points, ..omissions }));
        let render = |sources: &SourceImages, unseen_points| {
            picture_with(&field(unseen_points), sources, &weights(WEIGHTS, 3), &target, 0.0)
        };
        let picture = render(&spoiled, true);
        assert_eq!(picture, render(&sound, true), "the view is read: {omissions:?}");
        assert_eq!(picture, render(&sound, false), "not the same bits: {omissions:?}");
        assert_sound(&picture);
        // Without the omission its latents are multiplied by 0.
        assert!(is_not_finite(&field(false), &spoiled, &weights(WEIGHTS, 3), &target), "{omissions:?}");
        // The weights of the others are renormalised: the picture is theirs alone, up to the rounding of that.
        let field = mist(with_near(0.1, omissions));
        let alone = picture_with(&field, &others, &weights([WEIGHTS[0], WEIGHTS[2]], 2), &target, 0.0);
        assert!(super::largest_difference(&picture.colours, &alone.colours) < 2.0e-3, "{omissions:?}");
    }
}

#[test]
fn rays_through_the_plane_of_a_camera_keep_their_bits() {
    let sources = sources(3);
    let target = looking_out(&sources, 0.6);
    for omissions in ways() {
        let render = |unseen_points| {
            let field = mist(with_near(0.1, Omissions { unseen_points, ..omissions }));
            recorded(&field, &sources, &weights(WEIGHTS, 3), &target, 0.0)
        };
        let ((picture, record), (computed, all)) = (render(true), render(false));
        assert_eq!(picture, computed, "{omissions:?}");
        let (left_out, none) = (line(&record, "views at points"), line(&all, "views at points"));
        assert!(left_out.switch && 0 < left_out.left_out && left_out.left_out < left_out.of / 3, "{left_out:?}");
        assert_eq!((none.switch, none.left_out, none.of), (false, 0, left_out.of));
        // Rows of latent layers are those of the views that are left.
        let [rows, all] = [&record, &all].map(|record| line(record, "latent layers at points").of);
        assert_eq!(rows, all - 3 * left_out.left_out);
    }
}

#[test]
fn as_many_are_omitted_as_lie_behind_cameras() {
    let sources = sources(3);
    let target = looking_out(&sources, 0.6);
    let (near, far, count) = (0.1, 1.8, 10);
    let sampling = Sampling {
        coarse_count: count,
        importance_count: 0,
        depth_count: 0,
        jitter: 0.0,
        near_far: Some([near, far]),
        ..Sampling::default()
    };
    let omissions = Omissions { unseen_points: true, ..Omissions::NONE };
    let field = mist(PixelNerfOptions { sampling, omissions, ..PixelNerfOptions::default() });
    let (_, record) = recorded(&field, &sources, &weights(WEIGHTS, 3), &target, 0.0);

    // All cameras look at the middle of the scene.
    let cast = CastBlock { camera: target.block(0), near, far, pixel_centre: 0.0, along_axis: 0 };
    let mut behind = [0; 3];
    for pixel in 0..SIDE * SIDE {
        let ray = cast_ray(&cast, pixel);
        for sample in 0..count {
            let depth = f64::from(stratified_depth(near, far, sample, count, 0.5));
            let at = [0, 1, 2].map(|axis| f64::from(ray.origin[axis]) + f64::from(ray.direction[axis]) * depth);
            for (behind, image) in behind.iter_mut().zip(&sources.images) {
                let centre = centre(&image.camera).to_array().map(f64::from);
                let forward = (0..3).map(|axis| (at[axis] - centre[axis]) * -centre[axis]).sum::<f64>();
                *behind += u64::from(forward <= 0.0);
            }
        }
    }
    let found = line(&record, "views at points");
    println!("behind the cameras: {behind:?} of {} points", SIDE * SIDE * count);
    assert!(behind[1] > 0 && behind[1] < u64::from(SIDE * SIDE * count));
    assert_eq!((found.left_out, found.of), (behind.iter().sum(), u64::from(3 * SIDE * SIDE * count)));
}

#[test]
fn a_view_of_weight_0_is_not_read_where_all_views_are_encoded() {
    let (sound, spoiled) = (sources(3), spoiled(1));
    let weights = weights([0.75, 0.0, 0.25], 3);
    let field = |unseen_points| mist(omitting(Omissions { unseen_points, ..Omissions::NONE }));
    let picture = picture_with(&field(true), &spoiled, &weights, &target(SIDE), 0.0);
    assert_eq!(picture, picture_with(&mist(exact()), &sound, &weights, &target(SIDE), 0.0));
    assert!(is_not_finite(&field(false), &spoiled, &weights, &target(SIDE)));
}

#[test]
fn where_no_view_looks_all_are_asked() {
    // Every point is behind every camera: the weights stay as they are.
    let mut sources = sources(2);
    sources.images[1] = sources.images[0].clone();
    let outward = centre(&sources.images[0].camera);
    let pose = Pose::look_at(outward, outward * 5.0, Vec3::Z).expect("a pose");
    let target = Camera { pose, pinhole: orbit(SIDE).pinhole };
    let render = |unseen_points| {
        let field = mist(with_near(0.1, Omissions { unseen_points, ..Omissions::NONE }));
        recorded(&field, &sources, &Weights::mean(2), &target, 0.0)
    };
    let ((picture, record), (computed, _)) = (render(true), render(false));
    assert_eq!(picture, computed);
    assert_eq!(line(&record, "views at points").left_out, 0);
}
