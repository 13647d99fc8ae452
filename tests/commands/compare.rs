//! `viewfuse compare`.

use super::{BINARY, done};
use viewfuse_tests::command::{assert_refused, assert_wrong_arguments, f32_bytes, safetensors, toy};

viewfuse_tests::trials![one_picture_and_folders, what_cannot_be_compared,];

/// The columns of a metric's row.
fn row<'a>(printed: &'a str, metric: &str) -> Vec<&'a str> {
    let mut rows = printed.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
    rows.find(|columns| columns.first() == Some(&metric)).unwrap_or_else(|| panic!("no {metric}:\n{printed}"))
}

fn one_picture_and_folders() {
    let folder = toy();
    let printed = done(folder.path(), "compare toy/rgb/000000.png toy/rgb/000000.png");
    assert!(printed.starts_with("1 picture\n"), "{printed}");
    assert_eq!(row(&printed, "psnr")[1..], ["inf", "inf", "toy/rgb/000000.png"]);
    assert_eq!(row(&printed, "ssim")[1..3], ["1.0000", "1.0000"]);
    for (name, of) in [("000001", "000001"), ("000002", "000007")] {
        let bytes = std::fs::read(folder.file(&format!("toy/rgb/{of}.png"))).expect("a picture");
        folder.write(&format!("made/{name}.png"), bytes);
    }
    folder.write("made/notes.txt", "no picture");
    let printed = done(folder.path(), "compare made toy/rgb");
    assert!(printed.starts_with("2 pictures\n"), "{printed}");
    assert_eq!(row(&printed, "psnr")[3], "000002.png", "the worst");
    assert_ne!(row(&printed, "ssim")[2], "1.0000");
    // As the published evaluation: other numbers.
    let published = done(folder.path(), "compare made/000002.png toy/rgb/000002.png --metrics-as viewattention");
    let plain = done(folder.path(), "compare made/000002.png toy/rgb/000002.png");
    assert_eq!(row(&published, "psnr").len(), 4);
    assert_eq!(plain.lines().count(), published.lines().count());
}

fn what_cannot_be_compared() {
    let folder = toy();
    folder.write("made/none.txt", "no picture");
    folder.write("broken.png", "no picture");
    folder.image("small.png", 4, 4);
    folder.write("head.safetensors", safetensors(&[("mlp.weight", "F32", &[1], f32_bytes([1.0]))]));
    let refused = |arguments: &str, parts: &[&str]| {
        assert_refused(BINARY, folder.path(), &format!("compare {arguments} --device cpu"), parts);
    };
    refused("made toy/rgb", &["made: has no pictures"]);
    refused("toy/rgb made", &["made/000000.png: is missing", "toy/rgb/000000.png"]);
    refused("broken.png toy/rgb/000000.png", &["broken.png: not a readable image"]);
    refused("toy/rgb/000000.png toy/rgb", &["toy/rgb: is a folder"]);
    refused("small.png toy/rgb/000000.png", &["small.png", "4x4 cannot be compared with one of 128x128"]);
    let one = "toy/rgb/000000.png toy/rgb/000001.png";
    refused(&format!("{one} --lpips alex=none.pth"), &["none.pth: cannot be read"]);
    let parts = ["--lpips alex", "head.safetensors", "missing: features.0.weight", "unexpected: mlp.weight"];
    refused(&format!("{one} --lpips alex=head.safetensors"), &parts);
    refused(&format!("{one} --dists toy/rgb/000000.png"), &["toy/rgb/000000.png", "not a checkpoint"]);
    refused(&format!("{one} --fid head.safetensors"), &["--fid", "head.safetensors", "fc.weight"]);
    let wrong = |arguments: &str, parts: &[&str]| {
        assert_wrong_arguments(BINARY, folder.path(), &format!("compare {one} {arguments}"), parts);
    };
    wrong("--lpips alexnet.pth", &["alex=alexnet.pth"]);
    wrong("--lpips resnet=a.pth", &["alex, vgg and squeeze", "'resnet'"]);
    wrong("--dists vgg16.pth,heads=", &["vgg16.pth,heads=weights.pt"]);
    wrong("--metrics-as genvs", &["plain, pixelnerf and viewattention"]);
}
