//! Photographs taken through lenses, undistorted when they are read: a smooth picture in the world must come out where
//! the pinhole sees it, and what the lens did not see is marked.

use super::made::open;
use image::{Rgb, RgbImage};
use serde_json::{Value, json};
use viewfuse::device::cpu::Cpu;
use viewfuse::evaluate::metrics::{Metrics, Scorer};
use viewfuse::field::render::Truth;
use viewfuse::job::progress::Silent;
use viewfuse::scene::Scene;
use viewfuse::scene::photographs::{Album, GroundTruth};
use viewfuse_core::lens::{Lens, Projection};
use viewfuse_tests::scenes::{self, Folder};

const SIZE: [u32; 2] = [96, 64];
const FOCAL: f64 = 60.0;
const CENTRE: [f64; 2] = [47.0, 33.0];

/// A smooth picture of directions: red follows x, green y.
fn colour(ideal: [f64; 2]) -> [f64; 3] {
    [127.5 + 90.0 * (3.0 * ideal[0]).sin(), 127.5 + 90.0 * (3.0 * ideal[1]).sin(), 60.0]
}

fn pixel_centre(column: u32, row: u32) -> [f64; 2] {
    [(f64::from(column) + 0.5 - CENTRE[0]) / FOCAL, (f64::from(row) + 0.5 - CENTRE[1]) / FOCAL]
}

/// The photograph that the lens takes of the directions, with `transforms.json`.
fn folder(model: &str, lens: &Lens) -> Folder {
    let photograph = image::RgbImage::from_fn(SIZE[0], SIZE[1], |column, row| {
        let ideal = lens.undistort(pixel_centre(column, row)).point;
        image::Rgb(colour(ideal).map(|value| value.round() as u8))
    });
    let folder = Folder::new();
    photograph.save(folder.file("images/1.png")).expect("a photograph");
    let mut transforms = json!({
        "camera_model": model, "fl_x": FOCAL, "fl_y": FOCAL, "cx": CENTRE[0], "cy": CENTRE[1], "w": SIZE[0],
        "h": SIZE[1],
        "frames": [{ "file_path": "images/1.png", "transform_matrix": scenes::opengl_matrix() }],
    });
    for (key, value) in ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"].into_iter().zip(lens.coefficients()) {
        transforms[key] = Value::from(value);
    }
    // nerfstudio's k4.
    let [.., fourth] = lens.coefficients();
    if fourth != 0.0 {
        transforms["k4"] = Value::from(fourth);
    }
    folder.write("transforms.json", transforms.to_string());
    folder
}

#[test]
fn photographs_are_those_of_the_pinhole() {
    let perspective = Projection::Perspective;
    for (model, projection, coefficients) in [
        ("SIMPLE_RADIAL", perspective, [-0.12, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ("RADIAL", perspective, [0.1, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ("OPENCV", perspective, [-0.1, 0.02, 0.0, 0.0, 0.0, 0.0, 0.004, -0.006, 0.0]),
        ("OPENCV", perspective, [-0.12, 0.05, -0.02, 0.0, 0.0, 0.0, 0.004, -0.006, 0.03]),
        ("FULL_OPENCV", perspective, [0.31, -0.18, 0.021, 0.27, -0.11, 0.013, 0.0013, -0.0021, 0.0]),
        ("OPENCV_FISHEYE", Projection::Fisheye, [0.0621, -0.0187, 0.0093, -0.0021, 0.0, 0.0, 0.0, 0.0, 0.0]),
    ] {
        let lens = Lens::new(projection, coefficients).expect("a lens");
        let folder = folder(model, &lens);
        let scene = open(&folder);
        assert_eq!(scene.views[0].lens, Some(lens), "{model}");
        let photograph = scene.photograph(0).expect("a photograph");
        assert!(!photograph.has_alpha);
        let (mut compared, mut worst) = (0, 0.0_f64);
        for (column, row, pixel) in photograph.pixels.enumerate_pixels() {
            let ideal = pixel_centre(column, row);
            let at = lens.distort(ideal);
            let place = [at[0] * FOCAL + CENTRE[0], at[1] * FOCAL + CENTRE[1]];
            let inside = |margin: f64| {
                place.into_iter().zip(SIZE).all(|(at, side)| at >= margin && at <= f64::from(side) - margin)
            };
            let seen = photograph.seen.as_ref().is_none_or(|seen| seen.get_pixel(column, row)[0] == 255);
            assert_eq!(seen, inside(0.0), "{model}: {column}, {row}");
            // Nearer than half a pixel to the border there is nothing to interpolate with.
            if inside(0.5) {
                compared += 1;
                let expected = colour(ideal);
                let error = (0..3).map(|c| (f64::from(pixel[c]) - expected[c]).abs()).fold(0.0, f64::max);
                worst = worst.max(error);
            }
        }
        // Two roundings to 8 bits and the curvature between neighbours.
        assert!(compared > 4000 && worst < 2.0, "{model}: {worst} over {compared}");
    }
}

#[test]
fn a_real_photograph_through_nerfstudios_polynomial() {
    let room = Scene::open(viewfuse_tests::places::data("room")).expect("the room");
    let truth = room.photograph(5).expect("a photograph").pixels;
    let (camera, (width, height)) = (room.views[5].camera.pinhole, truth.dimensions());
    let lens = Lens::new(Projection::Perspective, [-0.2, 0.06, -0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.25]).expect("a lens");
    let ([fx, fy], [cx, cy]) = (camera.focal().map(f64::from), camera.principal().map(f64::from));
    let taken = RgbImage::from_fn(width, height, |x, y| {
        let [x, y] = lens.undistort([(f64::from(x) + 0.5 - cx) / fx, (f64::from(y) + 0.5 - cy) / fy]).point;
        let place = [x * fx + cx - 0.5, y * fy + cy - 0.5].map(|at| at.max(0.0) as f32);
        let [x, y] = [place[0].min((width - 1) as f32), place[1].min((height - 1) as f32)];
        let pixel = image::imageops::interpolate_bilinear(&truth, x, y).expect("a pixel inside");
        Rgb([pixel[0], pixel[1], pixel[2]])
    });
    let folder = Folder::new();
    taken.save(folder.file("images/1.png")).expect("a photograph");
    let mut file = json!({
        "camera_model": "OPENCV", "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": width, "h": height,
        "k1": -0.2, "k2": 0.06, "k3": -0.05, "k4": 0.25,
        "frames": [{ "file_path": "images/1.png", "transform_matrix": scenes::opengl_matrix() }],
    });
    let psnr = |file: &Value| {
        folder.write("transforms.json", file.to_string());
        let found = open(&folder).photograph(0).expect("a photograph").pixels;
        let inner = |x: u32, y: u32| (20..width - 20).contains(&x) && (20..height - 20).contains(&y);
        let pixels = truth.enumerate_pixels().filter(|(x, y, _)| inner(*x, *y));
        let errors: Vec<f64> = pixels
            .flat_map(|(x, y, colour)| {
                [0, 1, 2].map(|c| (f64::from(colour[c]) - f64::from(found.get_pixel(x, y)[c])).powi(2))
            })
            .collect();
        10.0 * (255.0 * 255.0 * errors.len() as f64 / errors.iter().sum::<f64>()).log10()
    };
    let right = psnr(&file);
    // The same numbers as OpenCV's rational lens are another one.
    file["camera_model"] = json!("FULL_OPENCV");
    let wrong = psnr(&file);
    // Two interpolations of a textured photograph.
    assert!(right > 28.0 && wrong < right - 10.0, "{right} {wrong}");
}

#[test]
fn what_the_lens_did_not_see_is_marked_and_not_black() {
    // Stronger at the border than the photograph is wide: the corners of the pinhole's picture lie outside.
    let lens = Lens::new(Projection::Perspective, [0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).expect("a lens");
    let read = |lens: &Lens| {
        let folder = folder("RADIAL", lens);
        open(&folder).photograph(0).expect("a photograph")
    };
    let photograph = read(&lens);
    let seen = photograph.seen.expect("unseen corners");
    assert_eq!((seen.get_pixel(0, 0)[0], seen.get_pixel(47, 33)[0]), (0, 255));
    assert!(photograph.pixels.pixels().all(|pixel| pixel[2] == 60 && pixel[3] == 255));
    // One that sees more than the pinhole marks nothing.
    let barrel = Lens::new(Projection::Perspective, [-0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).expect("a lens");
    assert_eq!(read(&barrel).seen, None);
    // Where the polynomial folds over, the photograph shows nothing either.
    let folded = Lens::new(Projection::Perspective, [-0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).expect("a lens");
    let seen = read(&folded).seen.expect("a fold");
    assert_eq!((seen.get_pixel(0, 0)[0], seen.get_pixel(47, 33)[0]), (0, 255));
}

#[test]
fn what_the_lens_did_not_see_is_not_scored() {
    let lens = Lens::new(Projection::Perspective, [0.6, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).expect("a lens");
    let folder = folder("RADIAL", &lens);
    let scene = open(&folder);
    let album = Album::open(&scene, [0], &Silent).expect("the photograph");
    for size in [SIZE, [48, 32]] {
        let truth = album.truth(0, size, None).expect("the truth");
        let seen = truth.seen.clone().expect("unseen corners");
        let unseen = seen.as_raw().iter().filter(|seen| **seen == 0).count();
        let pixel_count = (size[0] * size[1]) as usize;
        assert!((pixel_count / 10..pixel_count / 2).contains(&unseen), "{unseen} of {pixel_count}");
        // The pinhole's own picture, mean over the pixels that a smaller one covers.
        let scale = SIZE[0] / size[0];
        let exact = RgbImage::from_fn(size[0], size[1], |x, y| {
            let covered = (0..scale).flat_map(|i| (0..scale).map(move |j| pixel_centre(x * scale + i, y * scale + j)));
            let sum = covered.map(colour).fold([0.0; 3], |sum, texel| [0, 1, 2].map(|c| sum[c] + texel[c]));
            Rgb(sum.map(|sum| (sum / f64::from(scale * scale)).round() as u8))
        });
        let mut wrong_outside = exact.clone();
        for (pixel, _) in wrong_outside.pixels_mut().zip(seen.as_raw()).filter(|(_, seen)| **seen == 0) {
            pixel.0 = [255, 0, 255];
        }
        let scores = |prediction: &RgbImage| {
            let Truth { psnr, ssim, .. } = Truth::compare(prediction, truth.clone()).expect("seen pixels");
            (psnr, ssim.expect("a window"))
        };
        let (psnr, ssim) = scores(&exact);
        assert!(psnr > 45.0 && ssim > 0.99, "{psnr} {ssim}");
        assert_eq!(scores(&wrong_outside), (psnr, ssim));
        // Over all pixels, the exact picture itself would be wrong where the lens saw nothing.
        let over_all = Truth::compare(&exact, GroundTruth { seen: None, ..truth.clone() }).expect("seen pixels").psnr;
        assert!(over_all < psnr - 10.0, "{over_all} {psnr}");
        // The metrics of an evaluation agree.
        let metrics = Metrics::plain(&Cpu);
        let scores = |prediction: &RgbImage| {
            let scored = metrics.score(prediction, &truth.picture, truth.seen.as_ref()).expect("scores");
            (scored[0].value, scored[1].value)
        };
        assert_eq!((scores(&exact), scores(&wrong_outside)), ((psnr, ssim), (psnr, ssim)));
        let small = image::GrayImage::new(3, 3);
        assert!(metrics.score(&exact, &truth.picture, Some(&small)).is_err());
    }
}
