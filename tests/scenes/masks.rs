//! What masks mean: those of COLMAP, nerfstudio, instant-ngp and NeuS, over the sample scenes.

use image::{DynamicImage, GrayImage, ImageBuffer, Luma, RgbImage};
use serde_json::{Value, json};
use std::fs;
use viewfuse::job::progress::Silent;
use viewfuse::scene::photographs::{Album, BackgroundChoice};
use viewfuse::scene::write::{Layout, write};
use viewfuse::scene::{MaskChoice, MaskMeaning, Scene};
use viewfuse_tests::command::{sample, toy};
use viewfuse_tests::scenes::{self, Folder};

/// Photographs of the sample scene `room`, 320 x 240.
const COUNT: u32 = 11;

fn mask(counts: impl Fn(u32, u32) -> bool) -> GrayImage {
    GrayImage::from_fn(320, 240, |x, y| Luma([if counts(x, y) { 255 } else { 0 }]))
}

/// What a thing covers that is somewhere else in each photograph: 4 % of it.
fn thing(view: u32, x: u32, y: u32) -> bool {
    let [left, top] = [20 + 20 * (7 * view % 11), 20 + 14 * (5 * view % 11)];
    (left..left + 64).contains(&x) && (top..top + 48).contains(&y)
}

/// The room with a mask for each photograph under the name that `name` makes of `000`.
fn room(name: impl Fn(&str) -> String, counts: impl Fn(u32, u32, u32) -> bool) -> Folder {
    let folder = sample("room");
    for view in 0..COUNT {
        let path = folder.file(&format!("room/{}", name(&format!("{view:03}"))));
        mask(|x, y| counts(view, x, y)).save(path).expect("a mask");
    }
    folder
}

fn opened(folder: &Folder, masks: MaskChoice) -> Scene {
    Scene::open_masked(folder.join("room"), masks).expect("a scene")
}

/// The line of `inspect` about masks.
fn line(scene: &Scene) -> &str {
    scene.conventions.iter().find(|line| line.starts_with("masks: ")).map_or("", String::as_str)
}

/// Photograph 5 counts where the thing is not, and is otherwise as without masks.
#[track_caller]
fn assert_hides_the_thing(scene: &Scene) {
    assert_eq!(scene.masks, MaskMeaning::Ignore);
    let photograph = scene.photograph(5).expect("a photograph");
    let plain = Scene::open(viewfuse_tests::places::data("room")).expect("the sample").photograph(5).expect("the same");
    assert!(!photograph.has_alpha && photograph.pixels == plain.pixels);
    let seen = photograph.seen.expect("pixels that do not count");
    assert!(seen.enumerate_pixels().all(|(x, y, level)| (level[0] == 0) == thing(5, x, y)));
}

#[test]
fn masks_of_what_moves_are_ignore_masks() {
    let names: [fn(&str) -> String; 2] = [|name| format!("masks/{name}.jpg.png"), |name| format!("masks/{name}.png")];
    for name in names {
        let folder = room(name, |view, x, y| !thing(view, x, y));
        let scene = opened(&folder, MaskChoice::Auto);
        assert_eq!(line(&scene), "masks: pixels that do not count, 11 files, 4 % of the pixels");
        assert_hides_the_thing(&scene);
    }
    // nerfstudio names them.
    let folder = room(|name| format!("elsewhere/{name}.png"), |view, x, y| !thing(view, x, y));
    let file = folder.file("room/transforms.json");
    let mut transforms: Value = serde_json::from_slice(&fs::read(&file).expect("a file")).expect("JSON");
    for (view, frame) in transforms["frames"].as_array_mut().expect("frames").iter_mut().enumerate() {
        frame["mask_path"] = json!(format!("elsewhere/{view:03}.png"));
    }
    fs::write(&file, transforms.to_string()).expect("a file");
    assert_hides_the_thing(&opened(&folder, MaskChoice::Auto));
    // A person's word counts more than what is seen.
    let scene = opened(&folder, MaskChoice::Object);
    assert_eq!(line(&scene), "masks: where the object is, 11 files, 96 % of the pixels");
    assert!(scene.photograph(5).is_ok_and(|photograph| photograph.has_alpha && photograph.seen.is_none()));
    let scene = opened(&folder, MaskChoice::None);
    assert!(line(&scene).is_empty() && scene.views.iter().all(|view| view.mask.is_none()));
}

#[test]
fn masks_of_instant_ngp_are_inverted() {
    for name in ["dynamic_mask_NAME.png", "dynamic_mask_NAME.jpg.png"] {
        let folder = room(|view| format!("images/{}", name.replace("NAME", view)), thing);
        let scene = opened(&folder, MaskChoice::Auto);
        let inverted = ", white where they do not count (dynamic_mask_*.png, 11 files)";
        assert_eq!(line(&scene), format!("masks: pixels that do not count, 11 files, 4 % of the pixels{inverted}"));
        assert_hides_the_thing(&scene);
        // Written, they are as all others.
        let out = Folder::new();
        write(&scene, Layout::Transforms, &out.join("room"), &Silent).expect("written");
        assert_hides_the_thing(&opened(&out, MaskChoice::Auto));
    }
}

#[test]
fn levels_of_0_and_1_are_whole() {
    type Shape = fn(GrayImage) -> DynamicImage;
    let shapes: [(&str, Shape); 5] = [
        ("0 and 1", |mask| GrayImage::from_fn(320, 240, |x, y| Luma([mask.get_pixel(x, y)[0] / 255])).into()),
        ("16 bits", |mask| DynamicImage::from(mask).into_luma16().into()),
        ("16 bits, 0 and 1", |mask| {
            let level = |x, y| Luma([u16::from(mask.get_pixel(x, y)[0] / 255)]);
            DynamicImage::ImageLuma16(ImageBuffer::from_fn(320, 240, level))
        }),
        ("half the size", |mask| GrayImage::from_fn(160, 120, |x, y| *mask.get_pixel(2 * x, 2 * y)).into()),
        ("in an alpha channel", |mask| {
            let level = |x, y| image::Rgba([0, 0, 0, mask.get_pixel(x, y)[0]]);
            image::RgbaImage::from_fn(320, 240, level).into()
        }),
    ];
    for (shape, shaped) in shapes {
        let folder = sample("room");
        for view in 0..COUNT {
            let picture = shaped(mask(|x, y| !thing(view, x, y)));
            picture.save(folder.file(&format!("room/masks/{view:03}.png"))).expect("a mask");
        }
        let scene = opened(&folder, MaskChoice::Auto);
        assert!(line(&scene).contains("11 files, 4 %"), "{shape}: {}", line(&scene));
        assert_hides_the_thing(&scene);
    }
}

/// Of an object the greatest value counts whole, too: other programs write 128, a label's number or its colour.
#[test]
fn an_object_is_whole_at_any_level() {
    type Shape = fn(GrayImage) -> DynamicImage;
    fn coloured(mask: &GrayImage, colour: [u8; 3]) -> DynamicImage {
        let pixel = |x, y| image::Rgb(if mask.get_pixel(x, y)[0] > 0 { colour } else { [0; 3] });
        RgbImage::from_fn(320, 240, pixel).into()
    }
    let shapes: [(&str, Shape); 5] = [
        ("128", |mask| GrayImage::from_fn(320, 240, |x, y| Luma([mask.get_pixel(x, y)[0] / 2])).into()),
        ("7", |mask| GrayImage::from_fn(320, 240, |x, y| Luma([mask.get_pixel(x, y)[0].min(7)])).into()),
        ("16 bits, 1000", |mask| {
            let level = |x, y| Luma([1000 * u16::from(mask.get_pixel(x, y)[0] / 255)]);
            DynamicImage::ImageLuma16(ImageBuffer::from_fn(320, 240, level))
        }),
        ("dark red", |mask| coloured(&mask, [128, 0, 0])),
        ("blue", |mask| coloured(&mask, [0, 0, 255])),
    ];
    for (shape, shaped) in shapes {
        let folder = sample("room");
        for view in 0..COUNT {
            let picture = shaped(mask(|x, y| object(view, x, y, 40.0)));
            picture.save(folder.file(&format!("room/masks/{view:03}.png"))).expect("a mask");
        }
        let scene = opened(&folder, MaskChoice::Object);
        let photograph = scene.photograph(5).expect("a photograph");
        assert!(
            photograph.pixels.enumerate_pixels().all(|(x, y, pixel)| pixel[3] == mask_level(5, x, y)),
            "{shape}: the object is not whole"
        );
    }
    // Of a view that does not show it a compressed mask is nearly black.
    let folder = sample("room");
    for view in 0..COUNT {
        let level = |x: u32, y: u32| if (x + y).is_multiple_of(5) { 3 } else { 0 };
        let black = GrayImage::from_fn(320, 240, |x, y| Luma([level(x, y)]));
        let shown = if view == 5 { black } else { mask(|x, y| object(view, x, y, 40.0)) };
        shown.save(folder.file(&format!("room/masks/{view:03}.jpg"))).expect("a mask");
    }
    let photograph = opened(&folder, MaskChoice::Object).photograph(5).expect("a photograph");
    assert!(photograph.pixels.pixels().all(|pixel| pixel[3] == 0));
}

fn mask_level(view: u32, x: u32, y: u32) -> u8 {
    if object(view, x, y, 40.0) { 255 } else { 0 }
}

#[test]
fn masks_that_are_alike_are_ignore_masks() {
    // The circle of a fisheye is one region away from the border, and the same in every photograph.
    let circle = |_: u32, x: u32, y: u32| (f64::from(x) - 160.0).hypot(f64::from(y) - 120.0) < 112.0;
    let scene = opened(&room(|name| format!("masks/{name}.png"), circle), MaskChoice::Auto);
    assert_eq!(line(&scene), "masks: pixels that do not count, 11 files, 49 % of the pixels");
}

#[test]
fn silhouettes_are_object_masks() {
    let names: [fn(&str) -> String; 2] = [|name| format!("{name}.png"), |name| format!("{name}.png.png")];
    for name in names {
        let folder = toy();
        let plain = Scene::open(folder.join("toy")).expect("the sample");
        let photographs: Vec<_> = (0..plain.views.len()).map(|view| plain.photograph(view).expect("one")).collect();
        for (view, photograph) in plain.views.iter().zip(&photographs) {
            let (width, height) = photograph.pixels.dimensions();
            let alpha = GrayImage::from_fn(width, height, |x, y| Luma([photograph.pixels.get_pixel(x, y)[3]]));
            alpha.save(folder.file(&format!("toy/masks/{}", name(&view.name)))).expect("a mask");
            let opaque: RgbImage = DynamicImage::from(photograph.pixels.clone()).into_rgb8();
            opaque.save(folder.file(&format!("toy/rgb/{}.png", view.name))).expect("a photograph");
        }
        let scene = Scene::open(folder.join("toy")).expect("a scene");
        assert!(line(&scene).starts_with("masks: where the object is, 24 files, "), "{}", line(&scene));
        for (view, photograph) in photographs.iter().enumerate() {
            assert!(scene.photograph(view).expect("the same") == *photograph, "{view}");
        }
        // Layouts whose masks say what does not count get the object as an alpha channel.
        let out = Folder::new();
        for layout in [Layout::Transforms, Layout::Colmap, Layout::Neus] {
            let path = out.join(layout.to_string());
            write(&scene, layout, &path, &Silent).expect("written");
            let read = Scene::open(&path).expect("a scene");
            for (view, photograph) in photographs.iter().enumerate() {
                let same = read.view_named(&scene.views[view].name).expect("the same view");
                assert!(read.photograph(same).expect("the same") == *photograph, "{layout}: {view}");
            }
        }
    }
}

#[test]
fn masks_that_leave_little_are_refused() {
    // The bonnet of a car in white, and the thing that moves.
    let kinds: [fn(u32, u32, u32) -> bool; 2] = [|_, _, y| y >= 228, thing];
    for kind in kinds {
        let folder = room(|name| format!("masks/{name}.jpg.png"), kind);
        let scene = opened(&folder, MaskChoice::Auto);
        assert!(line(&scene).contains("unclear") && line(&scene).contains(" % of the pixels"), "{}", line(&scene));
        let error = scene.photograph(3).expect_err("unclear masks").to_string();
        assert!(error.contains("masks/003.jpg.png: this mask and the others leave ") && error.contains("inverted"));
        let album = Album::open(&scene, [0, 1], &Silent).map(|_| ()).expect_err("unclear masks");
        assert!(album.to_string().contains("masks/000.jpg.png"), "{album}");
        assert!(opened(&folder, MaskChoice::Ignore).photograph(3).is_ok_and(|photograph| photograph.seen.is_some()));
        assert!(opened(&folder, MaskChoice::Object).photograph(3).is_ok_and(|photograph| photograph.has_alpha));
    }
}

#[test]
fn what_may_be_a_near_object_is_said() {
    // It reaches the border below, and moves.
    let near: fn(u32, u32, u32) -> bool = |view, x, y| y >= 80 && x >= 4 * view;
    let folder = room(|name| format!("masks/{name}.png"), near);
    let is_said = |scene: &Scene| {
        scene.warnings.iter().any(|line| line.contains("if they show the object instead, choose object"))
    };
    let scene = opened(&folder, MaskChoice::Auto);
    assert!(line(&scene).starts_with("masks: pixels that do not count") && is_said(&scene), "{:?}", scene.warnings);
    assert!([MaskChoice::Ignore, MaskChoice::Object].iter().all(|choice| !is_said(&opened(&folder, *choice))));
    let folder = room(|name| format!("masks/{name}.png"), |view, x, y| !thing(view, x, y));
    assert!(!is_said(&opened(&folder, MaskChoice::Auto)));
}

#[test]
fn photographs_without_a_mask_are_told() {
    let folder = room(|name| format!("masks/{name}.png"), |view, x, y| !thing(view, x, y));
    folder.remove("room/masks/004.png").remove("room/masks/007.png");
    let scene = opened(&folder, MaskChoice::Auto);
    let warning = "2 of 11 photographs have no mask, 004.jpg the first";
    assert!(scene.warnings.iter().any(|line| line.ends_with(warning)), "{:?}", scene.warnings);
    assert_eq!(line(&scene), "masks: pixels that do not count, 9 files, 4 % of the pixels");
    assert!(scene.photograph(4).is_ok_and(|photograph| photograph.seen.is_none()));
}

/// A red thing before green, through a lens.
fn red_before_green(masks: bool) -> Folder {
    let folder = Folder::new();
    let is_red = |x: u32, y: u32| (60..90).contains(&x) && (30..70).contains(&y);
    let colour = |x, y| image::Rgb(if is_red(x, y) { [255, 0, 0] } else { [0, 255, 0] });
    RgbImage::from_fn(120, 90, colour).save(folder.file("images/1.png")).expect("a photograph");
    if masks {
        let mask = GrayImage::from_fn(120, 90, |x, y| Luma([if is_red(x, y) { 0 } else { 255 }]));
        mask.save(folder.file("masks/1.png")).expect("a mask");
    }
    let transforms = json!({
        "fl_x": 100, "k1": 0.2, "w": 120, "h": 90,
        "frames": [{ "file_path": "images/1.png", "transform_matrix": scenes::opengl_matrix() }],
    });
    folder.write("transforms.json", transforms.to_string());
    folder
}

#[test]
fn a_lens_moves_a_mask_as_it_moves_the_photograph() {
    let [masked, plain] = [true, false].map(|masks| {
        let folder = red_before_green(masks);
        Scene::open(&folder).expect("a scene").photograph(0).expect("a photograph")
    });
    let hidden = plain.seen.expect("corners").pixels().filter(|seen| seen[0] == 0).count();
    let seen = masked.seen.expect("pixels that do not count");
    let counting = || masked.pixels.pixels().zip(seen.pixels()).filter(|(_, seen)| seen[0] > 0);
    assert!(counting().all(|(pixel, _)| pixel[0] == 0 && pixel[1] == 255), "red shows");
    let red = masked.pixels.pixels().filter(|pixel| pixel[0] > 0).count();
    // Some show less red than a level of 8 bits.
    let rest = 120 * 90 - counting().count() - red - hidden;
    assert!(rest < 40, "{rest} pixels are hidden that show no red");
}

#[test]
fn what_an_ignore_mask_hides_is_in_no_source_and_no_truth() {
    let folder = room(|name| format!("masks/{name}.png"), |view, x, y| !thing(view, x, y));
    let scene = opened(&folder, MaskChoice::Auto);
    for choice in [BackgroundChoice::Auto, BackgroundChoice::None] {
        let album = Album::open_at(&scene, 0..11, 160, &Silent).expect("photographs");
        let images = album.sources(&[3, 5], 160, choice, &Silent).expect("sources");
        assert!(!images.has_silhouettes && images.warnings.is_empty(), "{:?}", images.warnings);
        for (texel, at) in images.images[1].texels.iter().zip(0..) {
            let (x, y) = (2 * (at % 160), 2 * (at / 160));
            assert_eq!(texel[3] == 0.0, thing(5, x, y), "{x}, {y}");
        }
        let truth = album.truth(5, [160, 120], None).expect("a truth").seen.expect("pixels that do not count");
        assert!(truth.enumerate_pixels().all(|(x, y, level)| (level[0] == 0) == thing(5, 2 * x, 2 * y)));
    }
}

#[test]
fn layouts_without_ignore_masks_hold_them_as_transparency_or_not_at_all() {
    let folder = room(|name| format!("masks/{name}.png"), |view, x, y| !thing(view, x, y));
    let scene = opened(&folder, MaskChoice::Auto);
    let out = Folder::new();
    let written = write(&scene, Layout::Srn, &out.join("srn"), &Silent).expect("written");
    assert!(
        written.lost.contains(&"the ignore masks of 11 photographs: what does not count is transparent".to_owned())
    );
    let read = Scene::open(out.join("srn")).expect("a scene");
    let photograph = read.photograph(5).expect("a photograph");
    assert!(photograph.pixels.enumerate_pixels().all(|(x, y, pixel)| (pixel[3] == 0) == thing(5, x, y)));
    let album = Album::open(&read, [3, 5], &Silent).expect("photographs");
    let images = album.sources(&[3, 5], 320, BackgroundChoice::Auto, &Silent).expect("sources");
    assert!(!images.has_silhouettes && images.warnings.len() == 1, "{:?}", images.warnings);
    let error = write(&scene, Layout::Neus, &out.join("neus"), &Silent).expect_err("no place").to_string();
    assert!(error.contains("cannot hold this scene: its masks say where the object is"), "{error}");
}

/// A rim that does not count, as of a fisheye, is the border's as an object's surroundings are.
#[test]
fn transparency_that_would_be_an_objects_is_told() {
    let rim = |_: u32, x: u32, y: u32| (f64::from(x) / 160.0 - 1.0).hypot(f64::from(y) / 120.0 - 1.0) < 0.97;
    let is_told = |counts: &dyn Fn(u32, u32, u32) -> bool| {
        let folder = room(|name| format!("masks/{name}.png"), counts);
        let scene = opened(&folder, MaskChoice::Auto);
        assert_eq!(scene.masks, MaskMeaning::Ignore);
        let written = write(&scene, Layout::Middlebury, &folder.join("out"), &Silent).expect("written");
        written.lost.iter().any(|line| line.starts_with("that alpha channels say which pixels do not count"))
    };
    assert!(is_told(&rim) && !is_told(&|view, x, y| !thing(view, x, y)));
}

/// A person's word on masks holds for what is exported: no alpha channel where it is not used, a line where it cannot be
/// said again.
#[test]
fn what_is_said_of_alpha_channels_is_exported_or_told() {
    let folder = toy();
    let path = folder.join("toy");
    let cut = image::RgbaImage::from_fn(128, 128, |x, _| image::Rgba([90, 120, 150, if x < 64 { 0 } else { 255 }]));
    cut.save(folder.file("toy/rgb/000003.png")).expect("a photograph");
    let out = Folder::new();
    let choices = [MaskChoice::Auto, MaskChoice::Object, MaskChoice::Ignore, MaskChoice::None];
    for (choice, has_alpha) in choices.into_iter().zip([true, true, true, false]) {
        let scene = Scene::open_masked(&path, choice).expect("a scene");
        for layout in [Layout::Transforms, Layout::ColmapBinary] {
            let folder = out.join(format!("{choice:?}-{layout}"));
            // SRN's poses without photographs are not held there.
            let photographed = Scene {
                views: scene.views.iter().filter(|view| view.image.is_some()).cloned().collect(),
                ..scene.clone()
            };
            let written = write(&photographed, layout, &folder, &Silent).expect("written");
            let picture = image::open(folder.join("images/000003.png")).expect("a photograph");
            assert_eq!(picture.color().has_alpha(), has_alpha, "{choice:?} {layout}");
            let is_told = written.lost.iter().any(|line| line.contains("must be said of this folder, too"));
            let is_said = matches!(choice, MaskChoice::Object | MaskChoice::Ignore);
            assert_eq!(is_told, is_said, "{:?}", written.lost);
        }
    }
}

#[test]
fn what_is_hidden_before_an_objects_background_is_background() {
    let folder = toy();
    let path = folder.join("toy");
    let plain = Scene::open(&path).expect("the sample");
    let pinhole = plain.views[0].camera.pinhole;
    let (width, height) = (pinhole.width(), pinhole.height());
    for view in 0..plain.views.len() {
        let level = |x, y| Luma([if x < width / 8 && y < height / 8 { 0 } else { 255 }]);
        let mask = GrayImage::from_fn(width, height, level);
        mask.save(folder.file(&format!("toy/masks/{view:06}.png"))).expect("a mask");
    }
    let scene = Scene::open(&path).expect("a scene");
    assert!(scene.photograph(3).is_ok_and(|photograph| photograph.seen.is_some()));
    let sources = |scene: &Scene| {
        let album = Album::open(scene, [3, 9], &Silent).expect("photographs");
        album.sources(&[3, 9], width, BackgroundChoice::Auto, &Silent).expect("sources")
    };
    let (hidden, all) = (sources(&scene), sources(&plain));
    assert!(hidden.has_silhouettes && all.has_silhouettes);
    for (hidden, all) in hidden.images.iter().zip(&all.images) {
        assert_eq!(hidden.texels, all.texels);
    }
}

/// A disc around the middle of the room's object, which fills much of the photographs.
fn object(view: u32, x: u32, y: u32, radius: f64) -> bool {
    let [left, top] = [160.0 + 4.0 * f64::from(view), 120.0 - 2.0 * f64::from(view)];
    (f64::from(x) - left).hypot(f64::from(y) - top) < radius
}

/// Masks of the room's views that follow what all of them look at.
fn of_object(name: impl Fn(&str) -> String, radius: impl Fn(u32) -> f64) -> Folder {
    let plain = Scene::open(viewfuse_tests::places::data("room")).expect("the sample");
    let focus = viewfuse::scene::rig::Rig::of(&plain.views.iter().map(|view| view.camera).collect::<Vec<_>>()).focus;
    room(name, |view, x, y| {
        let seen = plain.views[view as usize].camera.project(focus);
        (x as f32 - seen.x).hypot(y as f32 - seen.y) < radius(view) as f32
    })
}

#[test]
fn some_silhouettes_may_reach_the_border() {
    let of = |near: u32| {
        let folder = of_object(
            |name| format!("masks/{name}.png"),
            |view| if view < near { 175.0 } else { 60.0 + f64::from(view) },
        );
        opened(&folder, MaskChoice::Auto).masks
    };
    assert_eq!([0, 5].map(of), [MaskMeaning::Object; 2]);
    assert_ne!(of(6), MaskMeaning::Object);
}

#[test]
fn a_photograph_without_a_silhouette_is_excluded() {
    let folder = of_object(|name| format!("masks/{name}_mask.png"), |view| 60.0 + f64::from(view));
    assert_eq!(opened(&folder, MaskChoice::Auto).masks, MaskMeaning::Object, "called so");
    fs::remove_file(folder.file("room/masks/005_mask.png")).expect("a mask");
    let scene = opened(&folder, MaskChoice::Auto);
    assert!(scene.views.iter().all(|view| view.image.is_some() == (view.name != "005")), "as a pose it stays");
    let said: Vec<&String> = scene.warnings.iter().filter(|warning| warning.contains("005")).collect();
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].contains("1 of 11 photographs are excluded (005.jpg is the first): they have no mask"), "{said:?}");
    // Of most photographs nothing is known then, and nothing is excluded.
    (0..5).for_each(|view| fs::remove_file(folder.file(&format!("room/masks/{view:03}_mask.png"))).expect("a mask"));
    let scene = opened(&folder, MaskChoice::Auto);
    assert!(scene.views.iter().all(|view| view.image.is_some()));
    assert!(
        scene.warnings.iter().any(|warning| warning.contains("6 of 11 photographs have no mask")),
        "{:?}",
        scene.warnings
    );
    // Ignore masks are a matter of their photographs alone.
    let folder = room(|name| format!("masks/{name}.png"), |view, x, y| !thing(view, x, y));
    fs::remove_file(folder.file("room/masks/005.png")).expect("a mask");
    assert!(opened(&folder, MaskChoice::Auto).views.iter().all(|view| view.image.is_some()));
}

#[test]
fn masks_that_fit_no_photograph_are_told() {
    let folder = room(|name| format!("masks/of_{name}.png"), |view, x, y| object(view, x, y, 60.0));
    let scene = opened(&folder, MaskChoice::Auto);
    assert!(scene.views.iter().all(|view| view.mask.is_none()));
    let expected = "masks: 11 pictures are no masks of any photograph: of_000.png would be the mask of 000.jpg";
    assert!(scene.warnings.iter().any(|warning| warning.contains(expected)), "{:?}", scene.warnings);
}

#[test]
fn photographs_of_which_nothing_counts_are_told() {
    let folder = room(|name| format!("masks/{name}.png"), |view, x, y| view != 3 && view != 7 && !thing(view, x, y));
    let scene = opened(&folder, MaskChoice::Auto);
    let album = Album::open(&scene, 0..11, &Silent).expect("photographs");
    let sources = |views: &[usize]| album.sources(views, 64, BackgroundChoice::Auto, &Silent);
    let warnings = sources(&[1, 3, 5, 7]).expect("sources").warnings;
    assert!(
        warnings.iter().any(|warning| warning.contains("of the photograph '003', and of 1 more nothing counts")),
        "{warnings:?}"
    );
    assert!(warnings.iter().all(|warning| !warning.contains("grey")), "what shows nothing is not grey: {warnings:?}");
    let error = sources(&[3, 7]).expect_err("nothing").to_string();
    assert!(error.contains("of the photographs nothing counts ('003' is the first)"), "{error}");
}

/// Whatever colour it has: a source's truth is the picture of the copies that fields are compared with.
#[test]
fn what_is_transparent_is_in_no_truth() {
    let truth = |colour: [u8; 3]| {
        let folder = toy();
        let path = folder.join("toy/rgb/000020.png");
        let mut picture = image::open(&path).expect("a picture").into_rgba8();
        let hidden = picture.pixels_mut().filter(|pixel| pixel[3] == 0);
        hidden.for_each(|pixel| pixel.0[..3].copy_from_slice(&colour));
        picture.save(&path).expect("a picture");
        let scene = Scene::open(folder.join("toy")).expect("a scene");
        let album = Album::open(&scene, [20], &Silent).expect("a photograph");
        album.truth(20, [64, 64], None).expect("a truth")
    };
    assert!(truth([0; 3]) == truth([255; 3]));
}

/// A target whose object is cut off by its border is no photograph with pixels that do not count, where the sources are
/// of an object; and one of which all is transparent is none that could be met.
#[test]
fn transparency_means_for_targets_what_it_means_for_sources() {
    let folder = toy();
    let path = |view: u32| folder.join(format!("toy/rgb/{view:06}.png"));
    let altered = |view: u32, alpha: fn(u32, u32, u8) -> u8| {
        let mut picture = image::open(path(view)).expect("a picture").into_rgba8();
        picture.enumerate_pixels_mut().for_each(|(x, y, pixel)| pixel[3] = alpha(x, y, pixel[3]));
        picture.save(path(view)).expect("a picture");
    };
    altered(20, |x, y, alpha| if x < 2 || y < 2 || x > 125 || y > 125 { 255 } else { alpha });
    altered(21, |_, _, _| 0);
    let scene = Scene::open(folder.join("toy")).expect("a scene");
    let album = Album::open(&scene, 0..24, &Silent).expect("photographs");
    let white = Some([1.0; 3]);
    let counts = |view: usize| {
        let seen = album.truth(view, [128, 128], white).expect("a truth").seen;
        seen.map(|seen| seen.pixels().filter(|level| level[0] > 0).count())
    };
    assert!(counts(20).is_some_and(|count| count < 128 * 128), "by its own border it is no object's");
    let images = album.sources(&[0, 1, 2, 3], 128, BackgroundChoice::Auto, &Silent).expect("sources");
    assert!(images.has_silhouettes);
    assert_eq!((counts(20), counts(21), counts(5)), (None, Some(0), None));
    // What earlier sources were says nothing of a later run's.
    album.sources(&[20], 128, BackgroundChoice::Auto, &Silent).expect("a source");
    assert!(counts(20).is_some(), "these are no object's");
}
