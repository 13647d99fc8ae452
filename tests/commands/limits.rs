//! Files that promise, or hide, more than fits: each is one error, or no matter, and takes no memory.

use super::{BINARY, assert_refused, assert_wrong_arguments, command, done, done_with_warnings};
use std::fs;
use viewfuse_tests::command::{Outcome, assert_command_refused, names_in, sample, toy};
use viewfuse_tests::scenes::{Folder, png_chunk};

viewfuse_tests::trials![
    a_compressed_colour_profile_takes_no_memory,
    an_image_of_too_many_pixels_is_refused,
    a_text_that_is_too_long_is_not_read,
    a_picture_that_does_not_fit_is_refused,
    a_photograph_longer_than_its_pixels_is_refused,
    narrow_photographs_have_narrow_pictures,
    #[cfg(unix)]
    a_file_that_may_not_grow_is_an_error,
    #[cfg(target_os = "linux")]
    threads_that_cannot_be_started_are_an_error,
];

/// What the process may take, in KiB of addresses: less than one such file took.
const LIMIT: u32 = 900_000;

/// The command where it may take no more than that.
fn limited(folder: &std::path::Path, arguments: &str) -> std::process::Command {
    let mut limited = command::command("sh", folder, "");
    limited.args(["-c", &format!("ulimit -v {LIMIT}; exec \"$@\""), "sh", BINARY]).args(arguments.split(' '));
    limited
}

/// So many zeros, compressed (RFC 1950, 1951): one, and copies of it, 258 at a time, in 13 bits.
fn zeros(count: usize) -> Vec<u8> {
    let (mut bytes, mut bits, mut held) = (vec![0x78, 0x01], 0_u64, 0);
    let mut put = |value: u64, length: u32| {
        bits |= value << held;
        held += length;
        while held >= 8 {
            bytes.push(bits as u8);
            (bits, held) = (bits >> 8, held - 8);
        }
    };
    // The only block, of fixed codes, which stand in it from their highest bit on: a zero is 00110000.
    put(0b011, 3);
    put(0b0000_1100, 8);
    for _ in 0..count / 258 {
        // Length 258 is 11000101, distance 1 is 00000.
        put(0b1010_0011, 13);
    }
    // The end, and what is left of its byte.
    put(0, 14);
    // The checksum of n zeros (Adler) is n, 1.
    let sum = (count / 258 * 258 + 1) % 65_521;
    bytes.extend([(sum >> 8) as u8, sum as u8, 0, 1]);
    bytes
}

fn a_compressed_colour_profile_takes_no_memory() {
    let folder = toy();
    let profile = png_chunk(b"iCCP", &[b"p\0\0", zeros(1 << 30).as_slice()].concat());
    // Behind the signature and the header.
    for view in 0..8 {
        let path = folder.join(format!("toy/rgb/{view:06}.png"));
        let photograph = fs::read(&path).expect("a photograph");
        fs::write(&path, [&photograph[..33], &profile, &photograph[33..]].concat()).expect("written");
    }
    let outcome = Outcome::of(limited(&folder, "inspect toy"));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let render = "render toy --targets 20 --sources 0..7 --size 32x32 --weights mean --device cpu -o out";
    let outcome = Outcome::of(limited(&folder, render));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    // The pixels are those of the photographs.
    let plain = toy();
    done(&plain, render);
    let picture = |folder: &std::path::Path| fs::read(folder.join("out/000020.png")).expect("a picture");
    assert!(picture(&folder) == picture(&plain));
}

fn an_image_of_too_many_pixels_is_refused() {
    let folder = toy();
    let side = 16_384_u32.to_be_bytes();
    let header = png_chunk(b"IHDR", &[&side[..], &side, &[8, 2, 0, 0, 0]].concat());
    let pixels = png_chunk(b"IDAT", &zeros(16_384 * (3 * 16_384 + 1)));
    let bytes = [b"\x89PNG\r\n\x1a\n".as_slice(), &header, &pixels, &png_chunk(b"IEND", b"")].concat();
    folder.write("toy/rgb/000003.png", bytes);
    let parts = ["toy/rgb/000003.png: the image is 16384 x 16384", "decoding it takes 1792 MiB; at most 1024 MiB"];
    assert_command_refused(limited(&folder, "inspect toy"), &folder, &parts);
    let compared = "compare toy/rgb/000003.png toy/rgb/000003.png";
    assert_command_refused(limited(&folder, compared), &folder, &parts);
}

fn a_text_that_is_too_long_is_not_read() {
    let folder = toy();
    fs::create_dir(folder.join("scene")).expect("a folder");
    let file = fs::File::create(folder.join("scene/transforms.json")).expect("a file");
    // It takes no room on the disk.
    file.set_len(3 << 30).expect("a sparse file");
    let parts = ["scene/transforms.json: ", "it is longer than 268435456 bytes"];
    assert_command_refused(limited(&folder, "inspect scene"), &folder, &parts);
    let path = "render toy --camera-path scene/transforms.json --device cpu -o out";
    assert_command_refused(limited(&folder, path), &folder, &["transforms.json: ", "longer than 268435456"]);
}

fn a_picture_that_does_not_fit_is_refused() {
    let folder = toy();
    for model in ["", "--model formula:8"] {
        let render = format!("render toy --targets 20 --size 16384x12288 --device cpu -o out {model}");
        let parts = ["'16384x12288'", "takes about 9216 MiB", "at most 4096 MiB"];
        assert_wrong_arguments(&folder, &render, &parts);
    }
}

/// Zeros behind a photograph, which take no room on a disk.
fn a_photograph_longer_than_its_pixels_is_refused() {
    let folder = sample("room");
    let lengthen = |file: &str, mebibytes: u64| {
        let file = fs::OpenOptions::new().write(true).open(folder.join(file)).expect("a photograph");
        file.set_len(mebibytes << 20).expect("a sparse file");
    };
    let photograph = "room/images/001.jpg";
    let render = "render room --targets 3 --size 32x24 --weights mean --device cpu -o out";
    for (mebibytes, said) in
        [(3072, "the file has 3072 MiB; of an image at most 2048 MiB"), (600, "of 320 x 240 at most 257 MiB")]
    {
        lengthen(photograph, mebibytes);
        for arguments in ["inspect room", render] {
            assert_command_refused(limited(&folder, arguments), &folder, &[photograph, said]);
        }
    }
    // Among photographs without poses it is excluded by name.
    for view in [0, 2] {
        fs::copy(folder.join(format!("room/images/00{view}.jpg")), folder.file(&format!("bare/{view}.jpg")))
            .expect("a copy");
    }
    fs::copy(folder.join("room/images/003.jpg"), folder.file("bare/1.jpg")).expect("a copy");
    lengthen("bare/1.jpg", 3072);
    let parts = ["bare: 2 of the photographs can be used", "1.jpg: the file has 3072 MiB"];
    assert_command_refused(limited(&folder, "pose bare -o posed"), &folder, &parts);
}

/// 13 by 999 pixels: reduced, they are two or seven pixels wide, which nobody asked for.
fn narrow_photographs_have_narrow_pictures() {
    let folder = Folder::new();
    let mut frames = Vec::new();
    for view in 0..6_u32 {
        let level =
            |x: u32, y: u32| image::Rgb([((x * 31 + y / 3 * 7 + view) % 251) as u8, (y % 250) as u8, (y / 4) as u8]);
        image::RgbImage::from_fn(13, 999, level).save(folder.file(&format!("thin/{view}.png"))).expect("a photograph");
        let (sine, cosine) = (0.08 * f64::from(view)).sin_cos();
        frames.push(serde_json::json!({ "file_path": format!("{view}.png"), "transform_matrix": [
            [cosine, 0.0, sine, 2.0 * sine], [0.0, 1.0, 0.0, 0.0], [-sine, 0.0, cosine, 2.0 * cosine], [0.0, 0.0, 0.0,
                1.0]] }));
    }
    let camera =
        serde_json::json!({ "fl_x": 1000, "fl_y": 1000, "cx": 6.5, "cy": 499.5, "w": 13, "h": 999, "frames": frames });
    folder.write("thin/transforms.json", camera.to_string());
    done_with_warnings(&folder, "render thin --targets 3 --device cpu -o out");
    let picture = image::open(folder.join("out/3.png")).expect("a picture");
    assert_eq!((picture.width(), picture.height()), (7, 512));
    let other = "render thin --targets 3 --size 9x500 --device cpu -o other";
    assert_refused(&folder, other, &["9x500 does not keep the shape"]);
}

/// `ulimit -u`, as containers have it: the limit holds for people but not for root, who becomes nobody.
#[cfg(target_os = "linux")]
fn threads_that_cannot_be_started_are_an_error() {
    use std::os::unix::fs::PermissionsExt;
    use std::process::Command;
    let user = Command::new("id").arg("-u").output().expect("id runs").stdout;
    // Who runs this has other processes, too; of nobody's the first thread beside this one listens to Ctrl-C.
    let (first, limits): (&[&str], &[u32]) = match user.trim_ascii() == b"0" {
        true => (&["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"], &[1, 2]),
        false => (&[], &[1]),
    };
    let folder = Folder::new();
    fs::set_permissions(&*folder, fs::Permissions::from_mode(0o755)).expect("a folder for all");
    fs::copy(BINARY, folder.join("viewfuse")).expect("the command");
    for limit in limits {
        let script = format!("ulimit -u {limit}; exec ./viewfuse inspect nowhere");
        let words = [first, &["bash", "-c", &script]].concat();
        let mut limited = Command::new(words[0]);
        limited.args(&words[1..]).current_dir(&*folder);
        let Outcome { code, stderr, .. } = Outcome::of(limited);
        let is_told = ["Ctrl-C cannot be listened to", "the threads of the cores cannot be started"]
            .iter()
            .any(|told| stderr.starts_with(&format!("viewfuse: {told}")));
        assert!(code == Some(1) && is_told && stderr.lines().count() == 1, "{limit}: {stderr}");
    }
}

/// `ulimit -f`: a write beyond it is an error like that of a full disk, and nothing is left.
#[cfg(unix)]
fn a_file_that_may_not_grow_is_an_error() {
    let folder = toy();
    let small = |arguments: &str| {
        let mut small = command::command("sh", &folder, "");
        small.args(["-c", "ulimit -f 2; exec \"$@\"", "sh", super::binary(arguments)]).args(arguments.split(' '));
        small
    };
    for (arguments, file) in [
        ("points toy --size 32x32 --device cpu -o toy.ply", "toy.ply"),
        ("export toy --layout transforms -o exported", "exported"),
        ("inspect toy -o cameras.png", "cameras.png"),
    ] {
        let before = names_in(&folder);
        let Outcome { code, stderr, .. } = Outcome::of(small(arguments));
        assert_eq!(code, Some(1), "{arguments}: {stderr}");
        assert!(stderr.contains(file) && stderr.contains("File too large"), "{arguments}: {stderr}");
        assert_eq!(names_in(&folder), before, "{arguments} left something");
    }
    // What was finished stays, and nothing of what was not.
    let Outcome { code, stderr, .. } = Outcome::of(small("render toy --targets 20 --size 64x64 --device cpu -o out"));
    assert_eq!(code, Some(1), "{stderr}");
    assert!(stderr.contains("File too large"), "{stderr}");
    let left = names_in(&folder.join("out"));
    assert!(!left.iter().any(|name| name.starts_with('.') || name == "run.json"), "{left:?}");
}
