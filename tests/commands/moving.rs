//! Videos and animated pictures of paths: their content by other readers, and runs that are killed and continued.

use super::{
    assert_refused, assert_wrong_arguments, command, done, killed_when, list_of, number_of, numbers, read_json,
};
use image::codecs::webp::WebPDecoder;
use image::{AnimationDecoder, Rgb, RgbImage};
use serde_json::{Value, json};
use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;
use std::process::Command;
use viewfuse_tests::command::{Outcome, files_below, names_in, toy, without_progress};
use viewfuse_tests::trials::lacking;

viewfuse_tests::trials![
    a_path_as_animated_webp_and_as_y4m,
    a_run_that_was_killed_twice_ends_with_the_same_bytes,
    more_frames_than_a_gif_can_show_keep_their_pace,
    another_run_begins_anew,
    nothing_beside_the_pictures,
    an_ffmpeg_gets_the_video_or_there_is_y4m,
    depths_and_opacity_for_other_programs,
    camera_paths_from_files;
    lacking(has_ffmpeg(), "no ffmpeg"), "VIEWFUSE_REQUIRE_FFMPEG" => mp4_by_ffmpeg_shows_the_pictures,
];

fn has_ffmpeg() -> bool {
    Command::new("ffmpeg").arg("-version").output().is_ok_and(|output| output.status.success())
}

const PATH: &str = "render toy --between 2 6 --frames 5 --size 24x24 --weights error:alpha=1 --device cpu --no-sheets";

fn png(folder: &Path, name: &str) -> RgbImage {
    image::open(folder.join(name)).expect("a picture").to_rgb8()
}

/// Red, green and blue from planes of BT.601, limited range, at full resolution.
fn rgb_of(frame: &y4m::Frame<'_>, width: usize, x: usize, y: usize) -> [f64; 3] {
    let value = |plane: &[u8], offset: f64| (f64::from(plane[y * width + x]) - offset) / 255.0;
    let luma = value(frame.get_y_plane(), 16.0) * 255.0 / 219.0;
    let [blue, red] = [value(frame.get_u_plane(), 128.0), value(frame.get_v_plane(), 128.0)].map(|c| c * 255.0 / 224.0);
    [luma + 1.402 * red, luma - 0.344136 * blue - 0.714136 * red, luma + 1.772 * blue].map(|level| 255.0 * level)
}

fn a_path_as_animated_webp_and_as_y4m() {
    let scene = toy();
    let printed = done(&scene, &format!("{PATH} --video webp,gif,y4m --fps 12 -o out"));
    assert!(printed.contains("out/video.webp\n") && printed.contains("out/video.y4m\n"), "{printed}");
    // At a photograph's own place no other one needs to show what it shows.
    let ends = printed.lines().filter(|line| line.contains("between-000.png") || line.contains("between-004.png"));
    assert_eq!(ends.map(|line| line.contains("photograph from between")).collect::<Vec<_>>(), [false; 2], "{printed}");
    let out = scene.join("out");
    let pictures: Vec<RgbImage> = (0..5).map(|frame| png(&out, &format!("between-{frame:03}.png"))).collect();
    assert!(pictures[0] != pictures[4], "the camera does not move");

    // The decoder of `image` knows animations; nothing is lost.
    let decoder = WebPDecoder::new(BufReader::new(File::open(out.join("video.webp")).expect("a file"))).expect("WebP");
    assert!(decoder.has_animation());
    let frames = decoder.into_frames().collect_frames().expect("frames");
    let times: Vec<u32> = frames.iter().map(|frame| frame.delay().numer_denom_ms()).map(|(n, d)| n / d).collect();
    assert_eq!(times, [83, 84, 83, 83, 84]);
    for (frame, picture) in frames.into_iter().zip(&pictures) {
        let shown = image::DynamicImage::ImageRgba8(frame.into_buffer()).to_rgb8();
        assert!(shown == *picture, "a frame differs from its picture");
    }

    let mut video = y4m::decode(File::open(out.join("video.y4m")).expect("a file")).expect("y4m");
    assert_eq!((video.get_width(), video.get_height()), (24, 24));
    assert_eq!((video.get_framerate().num, video.get_framerate().den), (12, 1));
    for picture in &pictures {
        let frame = video.read_frame().expect("a frame");
        for (x, y, Rgb(levels)) in picture.enumerate_pixels() {
            let shown = rgb_of(&frame, 24, x as usize, y as usize);
            levels
                .iter()
                .zip(shown)
                .for_each(|(level, shown)| assert!((f64::from(*level) - shown).abs() < 3.0, "{level} {shown}"));
        }
    }
    assert!(video.read_frame().is_err(), "a sixth frame");
    assert_gif(&out.join("video.gif"), &pictures);
    // On standard output the same bytes, and nothing else.
    let before = files_below(&scene);
    let run = command(&scene, &format!("{PATH} --fps 12 -o -")).output().expect("the command starts");
    let said = without_progress(&String::from_utf8_lossy(&run.stderr));
    assert!(run.status.success() && said.is_empty(), "{said}");
    assert!(run.stdout == fs::read(out.join("video.y4m")).expect("a file"), "another video on standard output");
    assert_eq!(files_below(&scene), before);
    for files in ["--video webp", "--depth npy", "--alpha"] {
        assert_wrong_arguments(&scene, &format!("{PATH} {files} -o -"), &["standard output", "no files are written"]);
    }
}

/// The frames of a GIF are these pictures, up to its 256 colours, at 12 a second.
#[track_caller]
fn assert_gif(path: &Path, pictures: &[RgbImage]) {
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(File::open(path).expect("a file")).expect("a GIF");
    assert_eq!((decoder.width(), decoder.height()), (24, 24));
    let mut delays = Vec::new();
    for picture in pictures {
        let frame = decoder.read_next_frame().expect("a frame").expect("a frame for each picture");
        delays.push(frame.delay);
        let shown = RgbImage::from_fn(24, 24, |x, y| {
            let at = 4 * (24 * y + x) as usize;
            Rgb([frame.buffer[at], frame.buffer[at + 1], frame.buffer[at + 2]])
        });
        let difference: u32 = shown.iter().zip(picture.iter()).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
        assert!(difference < 3 * 24 * 24 * 4, "{difference}: more than 4 levels on average");
    }
    assert!(decoder.read_next_frame().expect("the end").is_none(), "one frame more");
    assert_eq!(delays, [8, 9, 8, 8, 9]);
}

fn more_frames_than_a_gif_can_show_keep_their_pace() {
    let scene = toy();
    done(&scene, &format!("{PATH} --video gif --fps 120 -o out"));
    let mut decoder =
        gif::DecodeOptions::new().read_info(File::open(scene.file("out/video.gif")).expect("a file")).expect("a GIF");
    let mut delays = Vec::new();
    while let Some(frame) = decoder.read_next_frame().expect("a frame") {
        delays.push(frame.delay);
    }
    // Five frames of 1/120 s: those that would be shown for less than 2 hundredths are dropped.
    assert_eq!(delays, [2, 2]);
}

/// Starts a run and kills it without warning when this many frames are in its journal.
fn killed(folder: &Path, arguments: &str, frames: usize) {
    let journal = folder.join("cut/frames.jsonl");
    let lines = || fs::read_to_string(&journal).unwrap_or_default().lines().count();
    killed_when(folder, arguments, || lines() > frames);
    assert!(!folder.join("cut/run.json").exists());
}

fn a_run_that_was_killed_twice_ends_with_the_same_bytes() {
    let folder = toy();
    let arguments = "render toy --orbit 120 --size 24x24 --device cpu --no-sheets --depth npy --video webp,y4m -o";
    done(&folder, &format!("{arguments} whole"));
    let arguments = format!("{arguments} cut");
    killed(&folder, &arguments, 3);
    // What a kill leaves in the middle of a line and of a frame.
    let journal = folder.join("cut/frames.jsonl");
    let text = fs::read_to_string(&journal).expect("a journal");
    fs::write(&journal, format!("{text}{{\"frame\":")).expect("a journal");
    fs::remove_file(folder.join("cut/orbit-001_depth.npy")).expect("a file");
    killed(&folder, &arguments, 60);
    let printed = done(&folder, &arguments);
    let there: usize = printed
        .lines()
        .find_map(|line| line.strip_prefix("continued: ")?.split_once(" of them were there")?.0.parse().ok())
        .unwrap_or_else(|| panic!("nothing was continued:\n{printed}"));
    // A frame whose file went is in the journal twice.
    assert!((55..120).contains(&there), "{printed}");
    let is_result = |name: &String| !name.starts_with(".viewfuse-");
    let names: Vec<String> = names_in(&folder.join("cut")).into_iter().filter(is_result).collect();
    assert_eq!(names, names_in(&folder.join("whole")));
    assert_eq!(names.len(), 2 * 120 + 3);
    for name in names.iter().filter(|name| *name != "run.json") {
        let [whole, cut] = ["whole", "cut"].map(|run| fs::read(folder.join(run).join(name)).expect("a file"));
        assert!(whole == cut, "{name} differs");
    }
    // The record is complete, and in the order of the path.
    let record = |run: &str| -> Value { read_json(folder.join(run).join("run.json")) };
    let targets = |record: &Value| -> Vec<Value> {
        list_of(&record["frames"]).iter().map(|frame| frame["target"].clone()).collect()
    };
    assert_eq!(targets(&record("cut")), targets(&record("whole")));
    assert_eq!((record("cut")["continued"].as_u64(), &record("whole")["continued"]), (Some(there as u64), &json!(0)));
}

fn another_run_begins_anew() {
    let folder = toy();
    let arguments = "render toy --orbit 600 --size 24x24 --device cpu --no-sheets --replace -o cut";
    killed(&folder, arguments, 2);
    let printed = done(&folder, &format!("{PATH} --replace -o cut"));
    assert!(!printed.contains("continued"), "{printed}");
    // Other weights make other pictures.
    killed(&folder, arguments, 2);
    let printed =
        done(&folder, "render toy --orbit 4 --size 24x24 --device cpu --no-sheets --weights mean --replace -o cut");
    assert!(!printed.contains("continued"), "{printed}");
    assert!(!folder.join("cut/frames.jsonl").exists() && folder.join("cut/run.json").is_file());
}

/// Runs the command with a folder of programs as its path.
fn with_programs(folder: &Path, programs: &Path, arguments: &str) -> Outcome {
    let mut run = command(folder, arguments);
    run.env("PATH", programs);
    Outcome::of(run)
}

/// The ffmpeg of this machine: what it wrote, it decodes to the pictures again, up to its compression.
fn mp4_by_ffmpeg_shows_the_pictures() {
    let folder = toy();
    // Odd sides, which the format does not have: a row and a column are added.
    done(
        &folder,
        "render toy --between 2 6 --frames 5 --size 63x63 --device cpu --no-sheets --video mp4 --fps 10 -o out",
    );
    let video = folder.join("out/video.mp4");
    let mut decode = Command::new("ffmpeg");
    decode.args(["-hide_banner", "-loglevel", "error", "-i"]).arg(&video);
    let decoded = decode.args(["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]).output().expect("ffmpeg starts");
    assert!(decoded.status.success(), "{}", String::from_utf8_lossy(&decoded.stderr));
    let frames: Vec<&[u8]> = decoded.stdout.chunks(3 * 64 * 64).collect();
    assert_eq!((frames.len(), frames.last().map(|frame| frame.len())), (5, Some(3 * 64 * 64)));
    let pictures: Vec<RgbImage> =
        (0..5).map(|frame| png(&folder.join("out"), &format!("between-{frame:03}.png"))).collect();
    let difference = |frame: &[u8], picture: &RgbImage| {
        let levels = picture.enumerate_pixels().flat_map(|(x, y, pixel)| {
            let place = 3 * (64 * y as usize + x as usize);
            (0..3).map(move |channel| f64::from(frame[place + channel].abs_diff(pixel.0[channel])))
        });
        levels.sum::<f64>() / f64::from(3 * 63 * 63)
    };
    for (at, frame) in frames.iter().enumerate() {
        let apart = difference(frame, &pictures[at]);
        assert!(apart < 6.0, "frame {at} differs by {apart}");
        // It is that picture and no other.
        let other = difference(frame, &pictures[(at + 2) % 5]);
        assert!(other > 1.5 * apart, "frame {at}: {apart}, another picture {other}");
    }
}

fn an_ffmpeg_gets_the_video_or_there_is_y4m() {
    let folder = toy();
    let programs = folder.join("programs");
    fs::create_dir(&programs).expect("a folder");
    // What is written in its place must not be a person's own.
    folder.write("mine/video.y4m", "mine");
    let run = with_programs(&folder, &programs, &format!("{PATH} --video mp4 -o mine"));
    assert_eq!(run.code, Some(1));
    assert!(run.stderr.contains("mine/video.y4m: no earlier run wrote this file"), "{}", run.stderr);
    assert_eq!(fs::read_to_string(folder.join("mine/video.y4m")).expect("a file"), "mine");
    let run = with_programs(&folder, &programs, &format!("{PATH} --video mp4 -o out"));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_eq!(run.stderr, "viewfuse: out/video.y4m, not mp4, is written: there is no ffmpeg on the path\n");
    assert!(run.stdout.contains("\nout/video.y4m\n"), "{}", run.stdout);
    let video = fs::read(folder.join("out/video.y4m")).expect("a video");
    if cfg!(not(unix)) {
        return;
    }
    // A program of that name that keeps what it reads, and says how it was called.
    folder.script("programs/ffmpeg", "for last; do :; done\nexec /bin/cat > \"$last\"\n");
    // A video that this run does not write stays until a person says otherwise.
    for no_video_or_another in ["", "--video mp4"] {
        let run = with_programs(&folder, &programs, &format!("{PATH} {no_video_or_another} -o out"));
        assert_eq!(run.code, Some(1));
        assert!(run.stderr.contains("has 1 file of an earlier run, video.y4m for one"), "{}", run.stderr);
        assert!(fs::read(folder.join("out/video.y4m")).expect("a video") == video);
    }
    let run = with_programs(&folder, &programs, &format!("{PATH} --video mp4 --replace -o out"));
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    assert!(fs::read(folder.join("out/video.mp4")).expect("a video") == video, "the program got another video");
    assert!(!folder.join("out/video.y4m").exists(), "the video of the run before is left");
    // One that fails.
    folder.script("programs/ffmpeg", "echo no such encoder >&2\nexit 3\n");
    let run = with_programs(&folder, &programs, &format!("{PATH} --video mp4 -o out"));
    assert_eq!(run.code, Some(1));
    assert!(run.stderr.contains("video.mp4: ffmpeg could not write it: no such encoder"), "{}", run.stderr);
    assert!(names_in(&folder.join("out")).iter().all(|name| !name.ends_with("mp4")));
    // It failed before the last frame, and no picture is lost by that.
    let run = with_programs(&folder, &programs, &format!("{PATH} --video mp4 -o failed"));
    assert_eq!(run.code, Some(1));
    let pictures = |name: &&String| name.starts_with("between-") && name.ends_with("png");
    assert_eq!(names_in(&folder.join("failed")).iter().filter(pictures).count(), 10, "pictures and depth maps");
}

/// The numbers of a `.npy` file of `<f4`, with its header.
fn npy(path: &Path) -> (String, Vec<f32>) {
    let bytes = fs::read(path).expect("an array");
    assert!(bytes.starts_with(b"\x93NUMPY\x01\x00"));
    let end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let values = bytes[end..].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    (String::from_utf8(bytes[10..end].to_vec()).expect("text"), values)
}

fn nothing_beside_the_pictures() {
    let folder = toy();
    done(&folder, &format!("{PATH} -o out"));
    let whole = names_in(&folder.join("out"));
    let refused = Outcome::of(command(&folder, &format!("{PATH} --pictures-only --depth npy -o out")));
    assert!(refused.code == Some(2) && refused.stderr.contains("--pictures-only"), "{}", refused.stderr);
    // Depth maps of pictures that are replaced do not stay beside the new ones.
    done(&folder, &format!("{PATH} --pictures-only --video y4m -o out"));
    let pictures: Vec<String> = (0..5).map(|frame| format!("between-{frame:03}.png")).collect();
    assert!(pictures.iter().all(|name| whole.contains(name)) && whole.len() > pictures.len() + 1, "{whole:?}");
    assert_eq!(names_in(&folder.join("out")), [&pictures[..], &["run.json".into(), "video.y4m".into()]].concat());
}

fn depths_and_opacity_for_other_programs() {
    let folder = toy();
    // Wider than high, so that rows and columns differ.
    folder.write(
        "wide.csv",
        "name,x,y,z,look_x,look_y,look_z,fx,fy,cx,cy,width,height\nwide,1,0.7,0.5,0,0,0,60,60,24,16,48,32\n",
    );
    let arguments = "render toy --camera-path wide.csv --device cpu --no-sheets";
    done(&folder, &format!("{arguments} --alpha --depth png,exr,npy -o out"));
    let out = folder.join("out");
    assert_eq!(names_in(&out), ["run.json", "wide.png", "wide_depth.exr", "wide_depth.npy", "wide_depth.png"]);
    let (header, depths) = npy(&out.join("wide_depth.npy"));
    assert!(header.contains("'descr': '<f4'") && header.contains("'shape': (32, 48)"), "{header}");
    assert!(depths.len() == 48 * 32 && depths.iter().all(|depth| depth.is_finite()));
    let exr = exr::prelude::read_first_flat_layer_from_file(out.join("wide_depth.exr")).expect("OpenEXR");
    let channel = &exr.layer_data.channel_data.list[0];
    assert_eq!((channel.name.to_string(), exr.layer_data.size.0, exr.layer_data.size.1), ("Z".to_owned(), 48, 32));
    let read: Vec<f32> = channel.sample_data.values_as_f32().collect();
    assert_eq!(read, depths);
    // The steps of the PNG, by the record.
    let record = read_json(out.join("run.json"));
    let step = number_of(&record["frames"][0]["depth_step"]);
    assert!(record["depth_units"]["depth"].as_str().is_some_and(|words| words.contains("units of the scene's files")));
    let levels = image::open(out.join("wide_depth.png")).expect("a map").to_luma16();
    for (level, depth) in levels.pixels().zip(&depths) {
        assert!((f64::from(level[0]) * step - f64::from(*depth)).abs() <= 0.51 * step);
    }
    // Opacity is that of the object; colour and background make the picture without alpha.
    let with_alpha = image::open(out.join("wide.png")).expect("a picture").into_rgba8();
    done(&folder, &format!("{arguments} -o plain"));
    let plain = png(&folder.join("plain"), "wide.png");
    let background: Vec<f64> = numbers(&record["background"]["used"]);
    let opaque = with_alpha.pixels().filter(|pixel| pixel[3] == 255).count();
    let empty = with_alpha.pixels().filter(|pixel| pixel[3] == 0).count();
    assert!(opaque > 100 && empty > 300, "{opaque} {empty}");
    for (pixel, plain) in with_alpha.pixels().zip(plain.pixels()) {
        let alpha = f64::from(pixel[3]) / 255.0;
        for channel in 0..3 {
            let mixed = alpha * f64::from(pixel[channel]) + (1.0 - alpha) * background[channel];
            // Faint pixels round their alpha.
            assert!((mixed - f64::from(plain[channel])).abs() <= 2.0, "{pixel:?} over the background is not {plain:?}");
        }
    }
}

fn camera_paths_from_files() {
    let folder = toy();
    let record = |run: &str| -> Value { read_json(folder.join(run).join("run.json")) };
    done(&folder, "render toy --targets 20 --sources 0..11 --size 24x24 --device cpu --no-sheets -o view");
    let pose = record("view")["frames"][0]["world_from_camera"].clone();
    // The same camera by a table, and by nerfstudio's viewer with axes turned around.
    let number = |row: usize, column: usize| number_of(&pose[row][column]);
    let entries: Vec<String> = (0..12).map(|k| number(k / 4, k % 4).to_string()).collect();
    let names: Vec<String> = (0..12).map(|k| format!("m{}{}", k / 4, k % 4)).collect();
    folder.write("poses.csv", format!("name,{}\nview,{}\n", names.join(","), entries.join(",")));
    let opengl: Vec<f64> =
        (0..16).map(|k| number(k / 4, k % 4) * if k % 4 == 1 || k % 4 == 2 { -1.0 } else { 1.0 }).collect();
    let frame = json!({ "file_path": "view", "transform_matrix": opengl.chunks(4).collect::<Vec<_>>() });
    folder.write("poses.json", json!({ "frames": [frame], "fps": 10 }).to_string());
    for file in ["poses.csv", "poses.json"] {
        let arguments = format!("--camera-path {file} --sources 0..11 --size 24x24 --device cpu --no-sheets");
        done(&folder, &format!("render toy {arguments} --video y4m -o path"));
        assert!(png(&folder.join("path"), "view.png") == png(&folder.join("view"), "000020.png"), "{file}");
        let video = y4m::decode(File::open(folder.join("path/video.y4m")).expect("a file")).expect("y4m");
        assert_eq!(video.get_framerate().num, if file == "poses.json" { 10 } else { 30 });
        fs::remove_file(folder.join("path/video.y4m")).expect("it is there");
    }
    // A rate that no video has, and pictures of two sizes, are refused before the first picture.
    let path = "render toy --camera-path poses.json --sources 0..11 --size 24x24 --device cpu -o other";
    for rate in [0.0, -3.0, 1000.0] {
        folder.write("poses.json", json!({ "frames": [frame], "fps": rate }).to_string());
        let said = [format!("states {rate} frames per second; give --fps, from 0.1 to 240")];
        assert_refused(&folder, &format!("{path} --video y4m"), &[&said[0]]);
        assert_refused(&folder, &path.replace("other", "-"), &[&said[0]]);
    }
    folder.write(
        "poses.csv",
        "name,x,y,z,look_x,look_y,look_z,fx,fy,cx,cy,width,height\n\
         a,1,0.7,0.5,0,0,0,60,60,24,16,48,32\nb,1,0.7,0.5,0,0,0,60,60,16,24,32,48\n",
    );
    let path = "render toy --camera-path poses.csv --sources 0..11 --device cpu -o other --video webp";
    assert_refused(&folder, path, &["that of a has 48x32 pixels, that of b 32x48"]);
    assert!(!folder.join("other").exists());
}
