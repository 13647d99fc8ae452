//! What NeuS's own program needs of its layout: the unit sphere, the order of its files, a mask of each photograph.

use super::*;

#[test]
fn a_scene_of_a_unit_sphere_keeps_it() {
    let folder = neus();
    folder.remove("mask/03.png");
    let scene = open(&folder);
    let out = Folder::new();
    write(&scene, Layout::Neus, &out.join("out"), &Silent).expect("written");
    let read = Scene::open(out.join("out")).expect("a scene");
    assert_same(Layout::Neus, &scene, &read);
    assert_eq!(sphere(&read.path), (DVec3::ZERO, 1.0));
    assert_eq!((read.views[0].near_far, read.views.len()), (scene.views[0].near_far, 2));
}

/// NeuS's own program takes `world_mat_0` for the first of its PNGs by name, and so on.
#[test]
fn neus_counts_its_photographs_from_0() {
    for (given, written_as) in [
        (["a", "b", "c"], ["a", "b", "c"]),
        (["dino0001", "dino0002", "dino0003"], ["dino0001", "dino0002", "dino0003"]),
        // In its order 10 comes before 9, in ours their numbers are 1 and 0.
        (["8", "9", "10"], ["000000", "000001", "000002"]),
        (["a1", "b0", "c2"], ["000000", "000001", "000002"]),
    ] {
        let folder = Folder::new();
        let mut frames = Vec::new();
        for (index, name) in given.into_iter().enumerate() {
            let mut matrix = scenes::opengl_matrix();
            matrix[0][3] = json!(index as f64);
            frames.push(json!({ "file_path": format!("{name}.jpg"), "transform_matrix": matrix }));
            let picture = image::RgbImage::from_pixel(16, 12, image::Rgb([60 * index as u8; 3]));
            picture.save(folder.file(&format!("{name}.jpg"))).expect("a photograph");
        }
        folder.write("transforms.json", json!({ "fl_x": 20, "frames": frames }).to_string());
        let scene = open(&folder);
        let (out, read, given_up) = written(&scene, Layout::Neus);
        let files = names_in(&out.join("out/image"));
        let mut expected: Vec<String> = written_as.iter().map(|name| format!("{name}.png")).collect();
        expected.sort();
        assert_eq!(files, expected);
        assert_eq!(given_up.lost.iter().any(|line| line.contains("are numbered")), given != written_as);
        // As it reads them: matrix by place, in the order of bytes.
        let (centre, radius) = sphere(&read.path);
        for (place, file) in files.iter().enumerate() {
            let number = format!("world_mat_{place}.npy");
            let archive = std::fs::File::open(out.join("out/cameras_sphere.npz")).expect("an archive");
            assert!(zip::ZipArchive::new(archive).expect("an archive").by_name(&number).is_ok(), "{number}");
            let view = written_as.iter().position(|name| *file == format!("{name}.png")).expect("a view");
            let back = read.view_named(written_as[view]).expect("the same view");
            let found = centre + radius * read.frame.file(read.views[back].camera.pose.centre_world().as_dvec3());
            let truth = scene.frame.file(scene.views[view].camera.pose.centre_world().as_dvec3());
            assert!(found.distance(truth) < 1e-5, "{file}: {found} {truth}");
        }
    }
}

#[test]
fn names_without_numbers_of_their_own_find_their_cameras_and_masks() {
    // Two cameras count alike, a third view has no number; one of them has no mask.
    let mut frames = Vec::new();
    let folder = Folder::new();
    for (index, name) in ["left/1", "right/1", "b"].into_iter().enumerate() {
        let mut matrix = scenes::opengl_matrix();
        matrix[0][3] = json!(index as f64);
        frames.push(json!({ "file_path": format!("{name}.png"), "transform_matrix": matrix }));
        let level = 40 * index as u8;
        image::RgbImage::from_pixel(16, 12, image::Rgb([level; 3]))
            .save(folder.file(&format!("{name}.png")))
            .expect("one");
        if name == "b" {
            // Its own alpha channel says where the object is.
            let alpha = |x: u32, y: u32| if (2..14).contains(&x) && (2..10).contains(&y) { 255 } else { 0 };
            image::RgbaImage::from_fn(16, 12, |x, y| image::Rgba([level, level, level, alpha(x, y)]))
                .save(folder.file(&format!("{name}.png")))
                .expect("one");
        } else {
            let mask = image::GrayImage::from_pixel(16, 12, image::Luma([200 + level]));
            mask.save(folder.file(&format!("masks/{name}.png"))).expect("a mask");
        }
    }
    folder.write("transforms.json", json!({ "fl_x": 20, "frames": frames }).to_string());
    let scene = Scene::open_masked(&folder, MaskChoice::Object).expect("a scene");
    assert_eq!(names(&scene), ["left_1", "right_1", "b"]);
    assert_eq!(scene.views.iter().filter(|view| view.mask.is_some()).count(), 2);
    let out = Folder::new();
    write(&scene, Layout::Neus, &out.join("out"), &Silent).expect("written");
    let read = Scene::open(out.join("out")).expect("a scene");
    let (centre, radius) = sphere(&read.path);
    for (index, view) in scene.views.iter().enumerate() {
        let other = read.view_named(&view.name).expect("the same view");
        assert_eq!(scene.photograph(index).expect("one"), read.photograph(other).expect("the other"), "{}", view.name);
        let centre_world = read.views[other].camera.pose.centre_world().as_dvec3();
        let error =
            (centre + radius * read.frame.file(centre_world)).distance(view.camera.pose.centre_world().as_dvec3());
        assert!(error < 1e-5, "{}: {error}", view.name);
    }
}

#[test]
fn a_scene_far_from_the_origin_is_written_in_its_own_coordinates() {
    let centres = [[0.001, 0.0, 0.0], [0.0, 1.002, 0.0], [0.0, 0.0, 1.003]]
        .map(|near| DVec3::new(4_468_123.0, 5_333_987.0, 512.0) + DVec3::from_array(near));
    let folder = llff();
    folder.image("images_8/c.png", 16, 12);
    let rows = centres.map(|centre| {
        let mut row = llff_row();
        (row[3], row[8], row[13]) = (centre.x, centre.y, centre.z);
        row
    });
    folder.write("poses_bounds.npy", npy(&[3, 17], rows.as_flattened()));
    let scene = open(&folder);
    assert!(scene.frame.origin.distance(centres[0]) < 2.0);
    for layout in Layout::ALL {
        let (_folder, read, given) = written(&scene, layout);
        let is_told = given.lost.iter().any(|line| line.contains("it reads matrices in f32"));
        assert_eq!(is_told, layout == Layout::Neus, "{:?}", given.lost);
        let (centre, radius) = if layout == Layout::Neus { sphere(&read.path) } else { (DVec3::ZERO, 1.0) };
        for (view, expected) in read.views.iter().zip(centres) {
            let file = centre + radius * read.frame.file(view.camera.pose.centre_world().as_dvec3());
            assert!(file.distance(expected) < 1e-6, "{layout}: {file} {expected}");
        }
        // As f32 sees it: the same scene as before.
        let distance = |scene: &Scene| {
            let [a, b] = [0, 2].map(|view| scene.views[view].camera.pose.centre_world());
            f64::from(a.distance(b)) * scene.frame.scale
        };
        assert!((radius * distance(&read) - distance(&scene)).abs() < 1e-6, "{layout}");
    }
}

#[test]
fn the_sphere_of_a_small_scene_is_told() {
    let folder = llff();
    let rows = [0.0, 1.0e-5].map(|x| {
        let mut row = llff_row();
        (row[3], row[8], row[13]) = (x, 2.0e-5, 3.0e-5);
        row
    });
    folder.write("poses_bounds.npy", npy(&[2, 17], rows.as_flattened()));
    let (out, _, written) = written(&open(&folder), Layout::Neus);
    let (_, radius) = sphere(&out.join("out"));
    let told = written.lost.iter().find_map(|line| line.split_once("farther than ")?.1.split(' ').next()?.parse().ok());
    assert!(told.is_some_and(|told: f64| (told / radius - 1.0).abs() < 0.01), "{radius} {:?}", written.lost);
}

/// Photographs that are cut out have their silhouettes in an alpha channel, which NeuS's programs do not read.
#[test]
fn cut_out_photographs_get_masks_of_neus() {
    let scene = Scene::open(viewfuse_tests::places::data("toy")).expect("the sample");
    let (folder, read, written) = written(&scene, Layout::Neus);
    let is_of_masks = |line: &&String| line.contains("mask") || line.contains("sphere");
    assert_eq!(written.lost.iter().find(is_of_masks), None, "they are there");
    assert_eq!(read.views.iter().filter(|view| read.has_object_mask(view)).count(), 24);
    let mask = image::open(folder.file("out/mask/000000.png")).expect("a mask").into_luma8();
    let photograph = scene.photograph(0).expect("a photograph");
    assert!(photograph.pixels.pixels().zip(mask.pixels()).all(|(pixel, level)| pixel[3] == level[0]));
    assert!(read.photograph(0).expect("the same") == photograph);
}

/// One of them may be near enough to be cut off by most of its border, and one may have no alpha channel.
#[test]
fn each_of_the_cut_out_photographs_gets_a_mask_of_neus() {
    let folder = toy();
    let near = image::RgbaImage::from_fn(128, 128, |x, _| image::Rgba([90, 120, 150, if x < 96 { 255 } else { 0 }]));
    near.save(folder.file("toy/rgb/000003.png")).expect("a photograph");
    image::RgbImage::new(128, 128).save(folder.file("toy/rgb/000005.png")).expect("a photograph");
    let scene = Scene::open(folder.join("toy")).expect("a scene");
    let (folder, read, _) = written(&scene, Layout::Neus);
    assert_eq!(read.views.iter().filter(|view| read.has_object_mask(view)).count(), 24);
    let share = |name: &str| {
        let mask = image::open(folder.file(&format!("out/mask/{name}.png"))).expect("a mask").into_luma8();
        mask.iter().filter(|level| **level == 255).count() as f64 / f64::from(128 * 128)
    };
    assert_eq!((share("000003"), share("000005")), (0.75, 1.0));
}

/// An alpha channel of pixels that do not count is none of an object, and NeuS's program does not read it.
#[test]
fn transparency_that_neus_does_not_read_is_told() {
    let is_told = |scene: &Scene| {
        written(scene, Layout::Neus).2.lost.iter().any(|line| line.contains("it reads no alpha channel"))
    };
    let folder = toy();
    for view in 0..24 {
        let hole = |x: u32, y: u32| if (40..60).contains(&x) && (40..60).contains(&y) { 0 } else { 255 };
        let picture = image::RgbaImage::from_fn(128, 128, |x, y| image::Rgba([90, 2 * x as u8, y as u8, hole(x, y)]));
        picture.save(folder.file(&format!("toy/rgb/{view:06}.png"))).expect("a photograph");
    }
    assert!(is_told(&Scene::open(folder.join("toy")).expect("a scene")));
    let samples = ["toy", "room"].map(viewfuse_tests::places::data);
    assert!(samples.iter().all(|path| !is_told(&Scene::open(path).expect("a sample"))));
}

/// A mask of one photograph would be taken for that of the first.
#[test]
fn photographs_beside_one_with_a_mask_get_masks_of_neus() {
    let mut scene = Scene::open(viewfuse_tests::places::data("room")).expect("the sample");
    let folder = Folder::new();
    let mask = image::GrayImage::from_fn(320, 240, |x, _| image::Luma([if x < 80 { 255 } else { 0 }]));
    mask.save(folder.file("mask.png")).expect("a mask");
    (scene.views[4].mask, scene.masks) = (Some(folder.join("mask.png")), MaskMeaning::Object);
    let (folder, read, _) = written(&scene, Layout::Neus);
    assert!(read.views.iter().all(|view| read.has_object_mask(view)));
    for (name, share) in [("003", 1.0), ("004", 0.25)] {
        let mask = image::open(folder.file(&format!("out/mask/{name}.png"))).expect("a mask").into_luma8();
        assert_eq!(mask.iter().filter(|level| **level == 255).count() as f64 / f64::from(320 * 240), share);
    }
}

/// Through a lens that does not see the corners of the pinhole's picture: the mask is the object, not what it saw.
#[test]
fn cut_out_photographs_through_a_lens_get_masks_of_neus() {
    let mut scene = Scene::open(viewfuse_tests::places::data("toy")).expect("the sample");
    let lens = Lens::new(Projection::Perspective, [0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).expect("a lens");
    scene.views.iter_mut().for_each(|view| view.lens = Some(lens));
    let photograph = scene.photograph(0).expect("a photograph");
    assert!(photograph.has_alpha && photograph.seen.is_some());
    let (folder, ..) = written(&scene, Layout::Neus);
    let mask = image::open(folder.file("out/mask/000000.png")).expect("a mask").into_luma8();
    assert!(photograph.pixels.pixels().zip(mask.pixels()).all(|(pixel, level)| pixel[3] == level[0]));
}
