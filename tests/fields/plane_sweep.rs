//! The training-free field on whole photographs, on the CPU: the sample scene with a background, and a painted wall.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use viewfuse::device::cpu::Cpu;
use viewfuse::field::gaussians::Recipe;
use viewfuse::field::render::{RenderError, RenderOptions, RenderRun, Stage, render, render_all};
use viewfuse::field::training_free::{Cache, Shown, Sweep, TrainingFree};
use viewfuse::field::{AnyOptions, DepthMap, Mixture, On, Rendered};
use viewfuse::job::digest::{SEAL, sealed, sha256};
use viewfuse::job::progress::{Progress, Silent};
use viewfuse::scene::few_shot::{FewShot, Target};
use viewfuse::scene::photographs::{SourceImage, SourceImages};
use viewfuse::weighting::Weighting;
use viewfuse::weighting::sources::SourceWeights;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::metrics::psnr;
use viewfuse_core::pose::Pose;
use viewfuse_core::weights::Weights;
use viewfuse_tests::fields::{job, on_sources, sample};
use viewfuse_tests::listener::Listener;
use viewfuse_tests::scenes::Folder;

/// Distance of the painted wall.
const WALL: f32 = 3.0;

/// A camera at `centre` that looks along z.
pub(super) fn camera(centre: Vec3, width: u32, height: u32) -> Camera {
    let pose = Pose::look_at(centre, centre + Vec3::Z, -Vec3::Y).expect("a pose");
    let focal = 0.9 * width as f32;
    let principal = [0.5 * width as f32, 0.5 * height as f32];
    Camera { pose, pinhole: Pinhole::new([focal; 2], principal, width, height).expect("a pinhole") }
}

/// The wall's paint: smooth, and different everywhere.
fn paint(x: f32, y: f32) -> [f32; 3] {
    let wave =
        |a: f32, b: f32, c: f32| 0.5 + 0.2 * (a * x + c).sin() * (b * y + c).cos() + 0.2 * (7.3 * x * y + a * y).sin();
    [wave(9.0, 5.0, 0.3), wave(6.0, 11.0, 1.1), wave(13.0, 8.0, 2.0)]
}

/// What a camera sees of the wall; `gain` is its exposure.
fn photograph(camera: Camera, gain: f32) -> SourceImage {
    let (width, height) = (camera.pinhole.width(), camera.pinhole.height());
    let texel = |at: u32| {
        let ray = camera.ray((at % width) as f32 + 0.5, (at / width) as f32 + 0.5);
        let point = ray.at((WALL - ray.origin_world.z) / ray.direction_world.z);
        let [r, g, b] = paint(point.x, point.y).map(|value| value * gain);
        [r, g, b, 1.0]
    };
    SourceImage { camera, texels: (0..width * height).map(texel).collect() }
}

fn sources(images: Vec<SourceImage>) -> SourceImages {
    SourceImages {
        images,
        background: [0.0; 3],
        has_silhouettes: false,
        points: Vec::new(),
        near_far: Some([1.5, 8.0]),
        focus: None,
        warnings: Vec::new(),
    }
}

pub(super) fn wall(gains: [f32; 3]) -> SourceImages {
    let centres = [Vec3::new(-0.3, 0.0, 0.0), Vec3::new(0.3, 0.05, 0.0), Vec3::new(0.05, -0.3, 0.1)];
    sources(centres.iter().zip(gains).map(|(centre, gain)| photograph(camera(*centre, 72, 54), gain)).collect())
}

/// Equal weights of the first views but one, of so many.
fn without(view: usize, first: usize, count: usize) -> SourceWeights {
    let mut scores = [0.0; viewfuse::weighting::sources::MAX_SOURCES];
    (0..first).filter(|other| *other != view).for_each(|other| scores[other] = 1.0);
    Weights::from_scores(&scores, count as u32)
}

/// A picture with equal weights.
fn picture(sources: &SourceImages, target: &Camera) -> Rendered {
    picture_of(&TrainingFree::default(), sources, target)
}

fn picture_of(field: &TrainingFree, sources: &SourceImages, target: &Camera) -> Rendered {
    picture_saying(field, sources, target, &Silent)
}

fn picture_saying(field: &TrainingFree, sources: &SourceImages, target: &Camera, progress: &dyn Progress) -> Rendered {
    let weights = Weights::mean(sources.images.len() as u32);
    on_stage(field, sources, progress, |stage| stage.picture(target, &weights, 0.0, progress).expect("a picture"))
}

/// The depths of the sources, before any picture.
fn depths_of(field: &TrainingFree, sources: &SourceImages) -> Vec<DepthMap> {
    on_stage(field, sources, &Silent, |stage| {
        stage.encode_all(&Silent).expect("encoded sources");
        stage.source_depths().expect("depths")
    })
}

/// Calls `act` where each source has equal weights of all others.
fn on_stage<T>(
    field: &TrainingFree,
    sources: &SourceImages,
    progress: &dyn Progress,
    act: impl FnOnce(&mut Stage<'_>) -> T,
) -> T {
    let count = sources.images.len();
    let relevance: Vec<SourceWeights> = (0..count).map(|view| without(view, count, count)).collect();
    on_sources(sources, field, progress, |stage| {
        stage.weigh_by(&relevance, progress).expect("a weighting");
        act(stage)
    })
}

/// Root mean square difference of the colours away from the border.
fn inner_error(a: &[[f32; 4]], b: &[[f32; 4]], width: usize) -> f32 {
    let height = a.len() / width;
    let inner = (8..height - 8).flat_map(|row| (8..width - 8).map(move |column| row * width + column));
    let (mut sum, mut count) = (0.0, 0.0);
    for at in inner {
        sum += (0..3).map(|c| (a[at][c] - b[at][c]).powi(2)).sum::<f32>();
        count += 3.0;
    }
    (sum / count as f32).sqrt()
}

#[test]
fn a_painted_wall_is_found_and_shown() {
    let target = camera(Vec3::new(0.0, 0.0, 0.0), 72, 54);
    let rendered = picture(&wall([1.0; 3]), &target);
    let error = inner_error(&rendered.colours, &photograph(target, 1.0).texels, 72);
    let mut depths = rendered.depths.clone();
    depths.sort_by(f32::total_cmp);
    let median = depths[depths.len() / 2];
    // A plane is off by at most half a step, 1.3 % of the depth here: less than half a pixel.
    assert!(error < 0.02, "{error}");
    assert!((median - WALL).abs() < 0.05 * WALL, "{median}");
    let copy = inner_error(&wall([1.0; 3]).images[0].texels, &photograph(target, 1.0).texels, 72);
    assert!(copy > 5.0 * error, "a copy is as good: {copy}");
}

#[test]
fn exposures_are_made_equal() {
    let target = camera(Vec3::new(0.0, 0.0, 0.0), 72, 54);
    let gains = [0.8, 1.0, 1.25];
    let rendered = picture(&wall(gains), &target);
    // Equal weights: the picture has the geometric mean of the exposures, 1.
    let error = inner_error(&rendered.colours, &photograph(target, 1.0).texels, 72);
    assert!(error < 0.03, "{error}");
}

/// The sources' depth maps with this share of geometric consistency.
fn depths_with(consistency_share: f32, sources: &SourceImages) -> Vec<DepthMap> {
    let sweep = Sweep { consistency_share, ..Sweep::default() };
    depths_of(&TrainingFree { sweep, ..TrainingFree::default() }, sources)
}

#[test]
fn two_other_views_confirm_a_depth() {
    let sources = wall([1.0; 3]);
    let [none, half, all] = [0.0, 0.5, 1.0].map(|share| depths_with(share, &sources));
    let mut confirmed = Vec::new();
    for (view, image) in sources.images.iter().enumerate() {
        assert_eq!(none[view].depths, all[view].depths, "the depths stay");
        for pixel in 0..72 * 54 {
            let [alone, mixed, consistent] = [&none, &half, &all].map(|maps| maps[view].confidences[pixel]);
            assert!((mixed - 0.5 * (alone + consistent)).abs() < 1.0e-6, "{alone} {mixed} {consistent}");
            // One view gives at most 0.65, two 1 - 0.35 * 0.35.
            assert!((0.0..0.8776).contains(&consistent), "{consistent}");
            let ray = image.camera.ray((pixel % 72) as f32 + 0.5, (pixel / 72) as f32 + 0.5);
            let depth = none[view].depths[pixel] / ray.direction_world.dot(image.camera.pose.forward_world());
            let point = ray.at(depth);
            let others = sources.images.iter().enumerate().filter(|(other, _)| *other != view);
            match others.filter(|(_, other)| other.camera.project(point).in_image).count() {
                0 => assert_eq!(consistent, 0.0, "no other view has {point}"),
                1 => assert!(consistent < 0.6501, "{consistent}"),
                _ if (point.z - WALL).abs() < 0.02 * WALL => confirmed.push(consistent),
                _ => {}
            }
        }
    }
    confirmed.sort_by(f32::total_cmp);
    let median = confirmed[confirmed.len() / 2];
    assert!(confirmed.len() > 3000 && median > 0.85, "{} {median}", confirmed.len());
}

#[test]
fn what_is_painted_otherwise_in_one_view_is_not_confirmed_by_it() {
    let mut sources = wall([1.0; 3]);
    let mean = |map: &DepthMap| map.confidences.iter().sum::<f32>() / map.confidences.len() as f32;
    let agreeing = depths_with(1.0, &sources).iter().map(mean).collect::<Vec<_>>();
    // The third photograph is upside down: its disparities are wrong, and the others confirm one another alone.
    sources.images[2].texels.reverse();
    let maps = depths_with(1.0, &sources);
    println!("mean consistency {agreeing:?}, with a wrong photograph {:?}", maps.iter().map(mean).collect::<Vec<_>>());
    assert!(mean(&maps[2]) < 0.6 * agreeing[2]);
    (0..2).for_each(|view| assert!(mean(&maps[view]) < agreeing[view]));
}

#[test]
fn two_sources_are_not_confirmed() {
    let mut sources = wall([1.0; 3]);
    sources.images.pop();
    let [none, all] = [0.0, 1.0].map(|share| depths_with(share, &sources));
    none.iter().zip(&all).for_each(|(none, all)| assert_eq!(none.confidences, all.confidences));
}

/// A source of which neither the weights nor a used source's neighbours know anything, whatever it shows.
#[test]
fn sources_without_a_weight_change_no_bit() {
    let target = camera(Vec3::ZERO, 72, 54);
    let with_fourth = |gain: f32| {
        let mut sources = wall([0.8, 1.0, 1.25]);
        sources.images.push(photograph(camera(Vec3::new(0.2, 0.2, 0.0), 72, 54), gain));
        let among_three = |view| without(view, 3, 4);
        on_sources(&sources, &TrainingFree::default(), &Silent, |stage| {
            for few in [0, 3] {
                let error = stage.weigh_by(&vec![among_three(0); few], &Silent).expect_err("of four").to_string();
                assert_eq!(error, format!("there are weights for {few} sources of 4"));
            }
            stage.weigh_by(&[0, 1, 2, 3].map(among_three), &Silent).expect("a weighting");
            let render = |stage: &mut Stage<'_>, weights: &SourceWeights| {
                stage.picture(&target, weights, 0.0, &Silent).expect("a picture")
            };
            let picture = render(stage, &among_three(3));
            let [line] = &stage.record().left_out[..] else { panic!("one line") };
            assert_eq!((line.what, line.left_out, line.of), ("encoded views", 1, 4));
            // A later target that uses all four does not change what an earlier one would give.
            render(stage, &Weights::mean(4));
            assert_eq!(render(stage, &among_three(3)), picture);
            picture
        })
    };
    let (alone, beside) = (with_fourth(0.0), with_fourth(0.6));
    assert_eq!(alone, beside, "bit for bit");
    assert!(inner_error(&alone.colours, &photograph(target, 1.0).texels, 72) < 0.03);
}

#[test]
fn what_no_source_sees_is_filled_and_marked() {
    let sources = wall([1.0; 3]);
    // Far to the side: the left part of the picture is on no photograph.
    let target = camera(Vec3::new(-2.2, 0.0, 0.0), 72, 54);
    let rendered = picture(&sources, &target);
    assert!(rendered.colours.iter().flatten().chain(&rendered.depths).all(|value| value.is_finite()));
    assert!(rendered.colours.iter().all(|colour| colour[3] == 1.0), "no void");
    assert!(rendered.colours.iter().all(|colour| colour[..3].iter().any(|value| *value > 0.01)), "no void");
    let mean = |columns: std::ops::Range<usize>| {
        let inside = (0..72 * 54).filter(|at| columns.contains(&(at % 72)));
        inside.map(|at| rendered.confidences[at]).sum::<f32>() / (columns.len() * 54) as f32
    };
    let (unseen, seen) = (mean(0..16), mean(60..72));
    assert!(unseen < 0.05 && seen > 4.0 * unseen, "{unseen} {seen}");
}

#[test]
fn extremes_give_finite_pictures() {
    let target = camera(Vec3::ZERO, 24, 18);
    let towards = |centre: Vec3| camera(centre, 24, 18);
    let flat = |camera: Camera| SourceImage { camera, texels: vec![[0.5, 0.5, 0.5, 1.0]; 24 * 18] };
    let turned = Camera { pose: Pose::look_at(Vec3::X, Vec3::X - Vec3::Z, -Vec3::Y).expect("a pose"), ..target };
    let textured = |centre: Vec3| photograph(towards(centre), 1.0);
    let nothing = SourceImage { texels: vec![[0.0; 4]; 24 * 18], ..flat(towards(Vec3::X)) };
    let cases = [
        ("no texture", [flat(towards(Vec3::X)), flat(towards(-Vec3::X))]),
        ("the same camera twice", [textured(Vec3::ZERO), textured(Vec3::ZERO)]),
        ("one looks away", [flat(turned), textured(Vec3::X)]),
        ("a thousand units apart", [textured(Vec3::X * 1.0e3), textured(-Vec3::X * 1.0e3)]),
        ("nothing is seen", [nothing, flat(towards(Vec3::Y))]),
    ];
    for (name, images) in cases {
        for near_far in [Some([1.5, 8.0]), None] {
            let sources = SourceImages { near_far, ..sources(images.to_vec()) };
            let rendered = picture(&sources, &target);
            let numbers = rendered.colours.iter().flatten().chain(&rendered.depths).chain(&rendered.confidences);
            assert!(numbers.clone().all(|value| value.is_finite() && *value >= 0.0), "{name}");
        }
    }
}

#[test]
fn the_room_is_better_than_a_copy() {
    let scene = sample("room");
    let job = job(&scene, "0,1,3,4,6,7,9,10", "2,5,8");
    let options = RenderOptions { size: Some([160, 120]), ..RenderOptions::default() };
    let weighting = Weighting::open("error:alpha=1").expect("a scheme");
    let renderer = On { device: &Cpu, field: &TrainingFree::default() };
    let frames = render_all(&scene, &job, &weighting, &renderer, &options).expect("frames");
    for frame in frames {
        let truth = frame.truth.expect("a truth");
        let heaviest =
            (0..job.sources.len() as u32).max_by(|a, b| frame.weights.get(*a).total_cmp(&frame.weights.get(*b)));
        let copy = scene.photograph(job.sources[heaviest.expect("a source") as usize]).expect("a photograph").pixels;
        let copy = image::imageops::resize(&copy, 160, 120, image::imageops::FilterType::Triangle);
        let copy: Vec<u8> = copy.pixels().flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
        let (ours, copied) =
            (psnr(frame.picture.as_raw(), truth.picture.as_raw()), psnr(&copy, truth.picture.as_raw()));
        assert!(ours > copied + 4.0, "{}: {ours} dB, a copy {copied} dB", frame.target.name);
    }
}

/// The files of a folder and their bytes, by name.
fn kept_files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let mut files: Vec<_> = entries.map(|path| (path.clone(), std::fs::read(path).expect("a file"))).collect();
    files.sort();
    files
}

#[test]
fn what_is_kept_of_the_sources_is_used_and_gives_the_same_picture() {
    let folder = Folder::new();
    let kept = folder.path().join("kept");
    let field = TrainingFree { cache: Some(Cache::open(&kept).expect("a cache")), ..TrainingFree::default() };
    let target = camera(Vec3::ZERO, 72, 54);
    let sources = SourceImages { near_far: None, ..wall([1.0; 3]) };
    let expected = picture(&sources, &target);
    assert_eq!(picture_of(&field, &sources, &target), expected, "nothing is kept yet");
    let files = kept_files(&kept);
    // Of each source its disparities, of the scene its points.
    assert_eq!(files.len(), 4, "{files:?}");
    assert_eq!(picture_of(&field, &sources, &target), expected, "all is kept");
    assert_eq!(kept_files(&kept), files, "and nothing is new");
    assert_eq!(depths_of(&field, &sources), depths_of(&TrainingFree::default(), &sources), "before a picture, too");
    // Other surfaces in a file that is whole: another picture, so it is used.
    let maps: Vec<_> = files.iter().filter(|(_, bytes)| bytes.len() == SEAL + 8 * 72 * 54).collect();
    let [(path, bytes), (_, of_another), ..] = maps[..] else { panic!("disparities of each source") };
    let name = path.file_stem().expect("a name").to_string_lossy();
    let other = vec![0x3f; bytes.len() - SEAL];
    std::fs::write(path, sealed(&name, &other)).expect("written");
    assert_ne!(picture_of(&field, &sources, &target), expected);
    // What is damaged, has another length or another name, and numbers that are none, are not used but made again.
    let mut one_bit = bytes.clone();
    one_bit[100] ^= 1;
    let with = |number: f32| sealed(&name, &[&bytes[SEAL..bytes.len() - 4], &number.to_le_bytes()].concat());
    for damaged in [
        [&bytes[..], b"more"].concat(),
        bytes[..bytes.len() - 8].to_vec(),
        b"short".to_vec(),
        one_bit,
        of_another.clone(),
        [sha256(&other).as_bytes(), &other].concat(),
        with(f32::NAN),
        with(f32::INFINITY),
        sealed(&name, &bytes[SEAL..bytes.len() - 8]),
        sealed(&name, &[]),
    ] {
        std::fs::write(path, damaged).expect("written");
        assert_eq!(picture_of(&field, &sources, &target), expected);
        assert_eq!(kept_files(&kept), files);
    }
    // So are points that are none.
    let (points, bytes) = files.iter().find(|(_, bytes)| bytes.len() != SEAL + 8 * 72 * 54).expect("points");
    let name = points.file_stem().expect("a name").to_string_lossy();
    for body in [Vec::new(), [f32::NAN; 3].map(f32::to_le_bytes).concat()] {
        std::fs::write(points, sealed(&name, &body)).expect("written");
        let said = Listener::default();
        assert_eq!(picture_saying(&field, &sources, &target, &said), expected);
        let said = BTreeSet::from_iter(said.warnings());
        let told = said.iter().filter(|warning| warning.contains("are not as they were kept")).count();
        assert_eq!(told, 1, "{said:?}");
        assert_eq!(&std::fs::read(points).expect("made again"), bytes);
    }
    // Another photograph has files of its own: its own disparities, those of the two that it is compared with, and the
    // points.
    let mut others = sources.clone();
    others.images[2].texels[0][0] *= 0.5;
    assert_eq!(picture_of(&field, &others, &target), picture(&others, &target));
    assert_eq!(kept_files(&kept).len(), 8);
}

#[test]
fn second_disparities_are_the_same_bits_whether_the_first_comparison_is_kept_or_made_again() {
    let folder = Folder::new();
    let sweep = Sweep { second_share: 0.03, ..Sweep::default() };
    let fresh = TrainingFree { sweep, ..TrainingFree::default() };
    let cache = Some(Cache::open(&folder.path().join("kept")).expect("a cache"));
    let cached = TrainingFree { cache, ..fresh.clone() };
    let (sources, target) = (wall([1.0; 3]), camera(Vec3::ZERO, 72, 54));
    let expected = picture_of(&fresh, &sources, &target);
    assert_ne!(picture(&sources, &target), expected, "second disparities change the picture");
    assert_eq!(picture_of(&cached, &sources, &target), expected, "nothing is kept yet");
    // The first disparities are read, so nothing was compared for them.
    assert_eq!(picture_of(&cached, &sources, &target), expected, "compared again");
    // The second picture of a stage has what the first one kept.
    let weights = Weights::mean(sources.images.len() as u32);
    let twice = on_stage(&fresh, &sources, &Silent, |stage| {
        [(); 2].map(|()| stage.picture(&target, &weights, 0.0, &Silent).expect("a picture"))
    });
    assert_eq!(twice, [expected.clone(), expected]);
}

/// One stage under several settings, as trials and mixtures have it, gives what a fresh one gives under each, whichever
/// sources a picture uses.
#[test]
fn what_other_settings_found_changes_no_bit() {
    let mut sources = wall([0.8, 1.0, 1.25]);
    sources.images.push(photograph(camera(Vec3::new(0.2, 0.2, 0.0), 72, 54), 0.9));
    let target = camera(Vec3::ZERO, 72, 54);
    let first = Sweep::default();
    let second = Sweep { front_share: 0.2, second_share: 0.03, ..first };
    let settings = [
        first,
        second,
        Sweep { second_share: 0.06, ..second },
        Sweep { near_cost: 0.05, ..second },
        Sweep { consistency_share: 0.1, ..first },
        first,
    ];
    let field = |sweep: Sweep| TrainingFree { sweep, ..TrainingFree::default() };
    let drawn = |stage: &mut Stage<'_>, number: usize| {
        let weights = without(4, if number.is_multiple_of(3) { 3 } else { 4 }, 4);
        let picture = stage.picture(&target, &weights, 0.0, &Silent).expect("a picture");
        (picture, stage.source_depths().expect("depths"))
    };
    let shared = on_stage(&field(first), &sources, &Silent, |stage| {
        // The depths of some are known when the others are encoded; those of two are a target's.
        drawn(stage, 0);
        stage.picture(&target, &without(4, 2, 4), 0.0, &Silent).expect("a picture");
        let few = stage.source_depths().expect("depths");
        assert!(few[3].depths.iter().all(|depth| *depth == 0.0) && few[0].depths.iter().any(|depth| *depth > 0.0));
        stage.encode_all(&Silent).expect("encoded sources");
        let of = |number: usize| {
            stage.vary(Some(&AnyOptions::new(field(settings[number]))), None, &Silent).expect("settings");
            drawn(stage, number)
        };
        [0, 1, 2, 3, 4, 5].map(of)
    });
    for (number, (sweep, shared)) in settings.into_iter().zip(shared).enumerate() {
        let fresh = on_stage(&field(sweep), &sources, &Silent, |stage| {
            stage.encode_all(&Silent).expect("encoded sources");
            drawn(stage, number)
        });
        assert!(shared == fresh, "settings {number}");
    }
}

/// Gaussians begin with the depths of all sources, also where a mixture's other picture found those of some again.
#[test]
fn gaussians_of_a_mixture_begin_with_all_sources() {
    let mut sources = wall([1.0; 3]);
    sources.images.push(photograph(camera(Vec3::new(0.2, 0.2, 0.0), 72, 54), 1.0));
    let (target, weights) = (camera(Vec3::ZERO, 72, 54), without(4, 3, 4));
    let sweep = Sweep { front_share: 0.2, second_share: 0.03, ..Sweep::default() };
    let recipe = Recipe { iterations: [0, 4, 4, 4], ..Recipe::default() };
    let field = TrainingFree { sweep, recipe, ..TrainingFree::default() };
    let gaussians = TrainingFree { shown: Shown::Gaussians, ..field.clone() };
    let [sweeps, gaussians] = [field.clone(), gaussians].map(AnyOptions::new);
    let mixture = Mixture::mean(vec![sweeps.clone(), gaussians.clone()]);
    // Its Gaussians are those of the picture after it.
    let [mixed, apart] = [Some(&mixture), None].map(|mixture| {
        on_stage(&field, &sources, &Silent, |stage| {
            for (options, mixture) in [(&sweeps, mixture), (&gaussians, None)] {
                stage.vary(Some(options), mixture, &Silent).expect("settings");
                stage.picture(&target, &weights, 0.0, &Silent).expect("a picture");
            }
            stage.picture(&target, &weights, 0.0, &Silent).expect("a picture")
        })
    });
    assert!(mixed == apart);
}

/// A target of another shape than the size keeps its own, and that is said.
#[test]
fn pictures_of_another_size_are_told() {
    let scene = sample("room");
    let wide = scene.views[5].camera;
    let [focal, pinhole] = [wide.pinhole.focal(), wide.pinhole.principal()];
    let high =
        Pinhole::new(focal, [pinhole[1], pinhole[0]], wide.pinhole.height(), wide.pinhole.width()).expect("a pinhole");
    let target = |name: &str, camera| Target { name: name.to_owned(), camera, truth: None };
    let targets = vec![target("wide", wide), target("high", Camera { pinhole: high, ..wide })];
    let job = FewShot { sources: vec![4, 6], targets, ..FewShot::default() };
    let (renderer, progress) = (On { device: &Cpu, field: &TrainingFree::default() }, Listener::default());
    let options = RenderOptions { size: Some([32, 24]), ..RenderOptions::default() };
    let run = RenderRun { scene: &scene, job: &job, renderer: &renderer, options: &options, progress: &progress };
    let mut sizes = Vec::new();
    render(&run, &Weighting::default_scheme(), |_, frame| {
        sizes.push(frame.picture.dimensions());
        Ok::<(), RenderError>(())
    })
    .expect("two pictures");
    assert_eq!(sizes, [(32, 24), (24, 32)]);
    let told = "1 of 2 targets have another shape than 32x24, and keep it: 'high' 24x32";
    assert!(progress.warnings().contains(&told.to_owned()), "{:?}", progress.warnings());
}
