//! `viewfuse compare`.

use super::{assert_near, assert_refused, assert_wrong_arguments, done, list_of, number_of, read_json};
use image::DynamicImage;
use image::metadata::Orientation;
use viewfuse_tests::command::{f32_bytes, safetensors, toy};
use viewfuse_tests::scenes::with_tag;

viewfuse_tests::trials![
    one_picture_and_folders,
    scores_are_those_of_render,
    transparent_pictures_are_laid_over_a_background,
    pictures_are_compared_upright,
    pictures_of_every_depth_and_kind_are_compared_alike,
    what_cannot_be_compared,
];

/// The columns of a metric's row.
fn row<'a>(printed: &'a str, metric: &str) -> Vec<&'a str> {
    let mut rows = printed.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
    rows.find(|columns| columns.first() == Some(&metric)).unwrap_or_else(|| panic!("no {metric}:\n{printed}"))
}

fn one_picture_and_folders() {
    let folder = toy();
    let printed = done(&folder, "compare toy/rgb/000000.png toy/rgb/000000.png");
    assert!(printed.starts_with("1 picture\n"), "{printed}");
    assert_eq!(row(&printed, "psnr")[1..], ["inf", "inf", "toy/rgb/000000.png"]);
    assert_eq!(row(&printed, "ssim")[1..3], ["1.0000", "1.0000"]);
    for (name, shown) in [("000001", "000001"), ("000002", "000007")] {
        let bytes = std::fs::read(folder.file(&format!("toy/rgb/{shown}.png"))).expect("a picture");
        folder.write(&format!("made/{name}.png"), bytes);
    }
    folder.write("made/notes.txt", "no picture").write("made/._000001.png", "no picture");
    // A video of the run may be a picture, too.
    let bytes = std::fs::read(folder.file("made/000001.png")).expect("a picture");
    folder.write("made/video.webp", &bytes).write("made/run.json", "{}");
    let printed = done(&folder, "compare made toy/rgb");
    assert!(printed.starts_with("2 pictures\n"), "{printed}");
    assert_eq!(row(&printed, "psnr")[3], "000002.png", "the worst");
    assert_ne!(row(&printed, "ssim")[2], "1.0000");
    // What a render writes beside its pictures is no picture to compare; in another folder a name says nothing.
    folder.write("made/000001_depth.png", std::fs::read(folder.file("made/000001.png")).expect("a picture"));
    assert!(done(&folder, "compare made toy/rgb").starts_with("2 pictures\n"));
    std::fs::remove_file(folder.file("made/run.json")).expect("removed");
    std::fs::remove_file(folder.file("made/video.webp")).expect("removed");
    assert_refused(
        &folder,
        "compare made toy/rgb",
        &["000001_depth.png: is missing, to compare made/000001_depth.png"],
    );
    // As the published evaluation: other numbers.
    let published = done(&folder, "compare made/000002.png toy/rgb/000002.png --metrics-as viewattention");
    let plain = done(&folder, "compare made/000002.png toy/rgb/000002.png");
    assert_eq!(row(&published, "psnr").len(), 4);
    assert_eq!(plain.lines().count(), published.lines().count());
}

/// The number in a metric's row and column.
#[track_caller]
fn number(printed: &str, metric: &str, column: usize) -> f64 {
    row(printed, metric)[column].parse().expect("a number")
}

/// The examples of the help, on what render writes: photographs with transparency that are larger than the pictures.
fn scores_are_those_of_render() {
    let folder = toy();
    for (more, out) in [("", "out"), ("--alpha", "alpha"), ("--background 10,200,30", "green")] {
        let render = format!(
            "render toy --targets 20..23 --sources 0..7 --size 48x48 --weights mean --device cpu {more} -o {out}"
        );
        done(&folder, &render);
        let record = read_json(folder.join(out).join("run.json"));
        let scores = |name: &str| -> Vec<f64> {
            list_of(&record["frames"]).iter().map(|frame| number_of(&frame[name])).collect()
        };
        let printed = done(&folder, &format!("compare {out}/ toy/rgb/"));
        assert!(printed.starts_with("4 pictures\n") && printed.contains(&format!("({out}/run.json)")), "{printed}");
        assert!(printed.contains("4 of 4 photographs are larger: resampled by area averages"), "{printed}");
        for metric in ["psnr", "ssim"] {
            let again = scores(metric);
            // A picture with an alpha channel was rounded once more.
            let rounding = if more == "--alpha" { 0.05 } else { 0.0001 };
            assert_near(number(&printed, metric, 1), again.iter().sum::<f64>() / 4.0, rounding);
            assert_near(number(&printed, metric, 2), again.iter().copied().fold(f64::INFINITY, f64::min), rounding);
        }
        let printed = done(&folder, &format!("compare {out}/000020.png toy/rgb/000020.png"));
        assert_near(number(&printed, "psnr", 1), scores("psnr")[0], 0.05);
    }
    // Another extension is the same picture's.
    let photograph = image::open(folder.join("toy/rgb/000020.png")).expect("a picture").to_rgb8();
    photograph.save(folder.file("photographs/000020.jpg")).expect("a picture");
    folder.write("one/000020.png", std::fs::read(folder.join("out/000020.png")).expect("a picture"));
    let printed = done(&folder, "compare one photographs");
    assert!(number(&printed, "psnr", 1) > 10.0, "{printed}");
}

fn transparent_pictures_are_laid_over_a_background() {
    let folder = toy();
    let picture = |name: &str, pixel: [u8; 4]| {
        image::RgbaImage::from_pixel(16, 16, image::Rgba(pixel)).save(folder.file(name)).expect("a picture");
    };
    picture("clear.png", [255, 0, 0, 0]);
    picture("white.png", [255, 255, 255, 255]);
    picture("green.png", [0, 255, 0, 255]);
    picture("red.png", [255, 0, 0, 255]);
    for (background, same) in [("", "white"), ("--background 0,255,0", "green"), ("--background none", "red")] {
        let printed = done(&folder, &format!("compare clear.png {same}.png {background}"));
        assert_eq!(row(&printed, "psnr")[1], "inf", "{background}: {printed}");
    }
    let printed = done(&folder, "compare clear.png green.png");
    assert!(number(&printed, "psnr", 1) < 10.0 && printed.contains("over 255,255,255 (the default)"), "{printed}");
}

/// Photographs as telephones save them: on either side of a comparison, alone and in folders, square or not.
fn pictures_are_compared_upright() {
    let folder = toy();
    let square = image::open(folder.join("toy/rgb/000003.png")).expect("a picture").into_rgb8();
    let oblong = image::DynamicImage::from(square.clone()).crop_imm(0, 20, 128, 80);
    for (name, plain) in [("square", square.into()), ("oblong", oblong)] {
        plain.save(folder.file(&format!("plain/{name}.png"))).expect("a picture");
        for tag in 2..=8 {
            let undone = Orientation::from_exif(match tag {
                6 => 8,
                8 => 6,
                other => other,
            });
            let mut stored = plain.clone();
            stored.apply_orientation(undone.expect("an orientation"));
            folder.write(&format!("turned-{tag}/{name}.jpg"), with_tag(&stored, tag));
        }
    }
    for tag in 2..=8 {
        let pair = if tag % 2 == 0 { format!("plain turned-{tag}") } else { format!("turned-{tag} plain") };
        let printed = done(&folder, &format!("compare {pair} --device cpu"));
        assert!(printed.starts_with("2 pictures\n") && number(&printed, "psnr", 2) > 25.0, "{pair}: {printed}");
    }
}

fn pictures_of_every_depth_and_kind_are_compared_alike() {
    let folder = toy();
    let photograph = image::open(folder.join("toy/rgb/000003.png")).expect("a picture");
    let (colour, grey) = (photograph.to_rgb8(), photograph.to_luma8());
    let same: [(&str, DynamicImage, Vec<DynamicImage>); 2] = [
        (
            "colour",
            colour.clone().into(),
            vec![
                DynamicImage::from(colour.clone()).into_rgb16().into(),
                DynamicImage::from(colour.clone()).into_rgba8().into(),
                DynamicImage::from(colour).into_rgba16().into(),
            ],
        ),
        (
            "grey",
            DynamicImage::from(grey.clone()).into_rgb8().into(),
            vec![
                grey.clone().into(),
                DynamicImage::from(grey.clone()).into_luma16().into(),
                DynamicImage::from(grey).into_luma_alpha8().into(),
            ],
        ),
    ];
    for (name, plain, others) in same {
        plain.save(folder.file("plain.png")).expect("a picture");
        for other in others {
            other.save(folder.file("other.png")).expect("a picture");
            for pair in ["plain.png other.png", "other.png plain.png"] {
                let printed = done(&folder, &format!("compare {pair} --device cpu"));
                assert_eq!(row(&printed, "psnr")[1], "inf", "{name}, {:?}: {printed}", other.color());
            }
        }
    }
}

fn what_cannot_be_compared() {
    let folder = toy();
    folder.write("made/none.txt", "no picture");
    folder.write("broken.png", "no picture");
    folder.image("small.png", 4, 3);
    folder.image("large.png", 256, 256);
    folder.write("head.safetensors", safetensors(&[("mlp.weight", "F32", &[1], f32_bytes([1.0]))]));
    let refused = |arguments: &str, parts: &[&str]| {
        assert_refused(&folder, &format!("compare {arguments} --device cpu"), parts);
    };
    refused("made toy/rgb", &["made: has no pictures"]);
    refused("nowhere toy/rgb", &["nowhere: no such file or folder"]);
    refused("toy/rgb nowhere", &["nowhere: no such file or folder"]);
    refused("toy/rgb made", &["made/000000.png: is missing", "toy/rgb/000000.png"]);
    folder.image("one/x.png", 8, 8).write("two/x.jpeg", "").write("two/x.jpg", "");
    refused("one two", &["one/x.png: may be compared with two/x.jpeg or two/x.jpg"]);
    refused("broken.png toy/rgb/000000.png", &["broken.png: not a readable image"]);
    refused("toy/rgb/000000.png toy/rgb", &["toy/rgb: is a folder"]);
    refused("toy/rgb toy/rgb/000000.png", &["toy/rgb: is a folder, toy/rgb/000000.png is not"]);
    refused("large.png toy/rgb/000000.png", &["large.png", "256x256 cannot be compared with one of 128x128"]);
    refused("small.png toy/rgb/000000.png", &["small.png", "4x3 cannot be compared with one of 128x128"]);
    let one = "toy/rgb/000000.png toy/rgb/000001.png";
    refused(&format!("{one} --lpips alex=none.pth"), &["none.pth: cannot be read"]);
    let parts = ["--lpips alex", "head.safetensors", "missing: features.0.weight", "unexpected: mlp.weight"];
    refused(&format!("{one} --lpips alex=head.safetensors"), &parts);
    refused(&format!("{one} --dists toy/rgb/000000.png"), &["toy/rgb/000000.png", "not a checkpoint"]);
    refused(&format!("{one} --fid head.safetensors"), &["--fid", "head.safetensors", "fc.weight"]);
    let wrong = |arguments: &str, parts: &[&str]| {
        assert_wrong_arguments(&folder, &format!("compare {one} {arguments}"), parts);
    };
    wrong("--lpips alexnet.pth", &["alex=alexnet.pth"]);
    wrong("--lpips resnet=a.pth", &["'resnet' is not a network of LPIPS: alex, vgg or squeeze"]);
    wrong("--dists vgg16.pth,heads=", &["vgg16.pth,heads=weights.pt"]);
    wrong("--metrics-as genvs", &["'genvs' is not a convention of scores: plain, pixelnerf or viewattention"]);
}
