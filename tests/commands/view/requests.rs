//! The server by requests alone: who may ask, what is answered, and that it ends.

use super::super::{BINARY, assert_near, assert_refused, command, done_with_warnings, list_of, number_of, numbers};
use super::{room, start};
use image::codecs::webp::WebPDecoder;
use image::{AnimationDecoder, DynamicImage, Rgb, RgbImage};
use serde_json::{Value, json};
use std::io::Cursor;
use std::path::Path;
use std::time::Duration;
use viewfuse_tests::command::{files_below, names_in, toy};
use viewfuse_tests::devices::vulkan_devices;
use viewfuse_tests::patience::wait_until;
use viewfuse_tests::places::{data, repository};
use viewfuse_tests::scenes::Folder;
use viewfuse_tests::trials::lacking;
use viewfuse_tests::viewer::{Answer, Connection, Program, request};

viewfuse_tests::trials![
    other_hosts_and_addresses_get_nothing,
    how_much_was_photographed_is_told,
    full_pictures_are_those_of_render,
    pictures_have_the_size_and_the_units_that_are_told,
    no_view_is_an_error_of_the_server,
    the_scheme_can_be_chosen_for_the_scene,
    the_newest_request_wins,
    a_video_has_the_pictures_of_its_path,
    one_video_at_a_time_for_who_waits,
    a_video_is_mp4_where_ffmpeg_is,
    an_encoder_that_waits_keeps_no_picture_from_anybody,
    ctrl_c_ends_it_and_nothing_is_written,
    a_taken_port_is_an_error,
    learned_fields_are_shown,
    gaussians_are_shown;
    lacking(has_vulkan(), "no Vulkan device"), "VIEWFUSE_REQUIRE_VULKAN" => a_vulkan_device_shows_the_same,
];

fn has_vulkan() -> bool {
    vulkan_devices().is_ok_and(|(_, adapters)| adapters.iter().any(|adapter| adapter.missing.is_empty()))
}

fn other_hosts_and_addresses_get_nothing() {
    let program = start(&repository(), &format!("{} --size 24x24", data("toy").display()));
    let header = ("Host", program.host.as_str());
    let status = |method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]| {
        program.connect().ask(method, path, headers, body).status
    };
    let page = program.get("");
    let text = String::from_utf8_lossy(&page.body);
    assert!(page.status == 200 && text.contains("<title>viewfuse</title>"), "{text}");
    for header in
        ["Content-Security-Policy: default-src 'none'", "Referrer-Policy: no-referrer", "Cache-Control: no-store"]
    {
        assert!(page.head.contains(header), "{header} is not in {}", page.head);
    }
    assert!(!page.head.contains("Access-Control-Allow-Origin"), "{}", page.head);
    for host in ["evil.example", "127.0.0.1", "127.0.0.1:1"] {
        assert_eq!(status("GET", &program.path, &[("Host", host)], b""), 403, "{host}");
    }
    assert_eq!(status("GET", &program.path, &[], b""), 403, "no host");
    assert_eq!(status("GET", &program.path, &[header, header], b""), 403, "two hosts");
    assert_eq!(status("GET", &program.path, &[header, ("Origin", "http://evil.example")], b""), 403);
    for path in ["/", "/scene", "/0123456789abcdef0123456789abcdef/", &program.path[..20]] {
        assert_eq!(status("GET", path, &[header], b""), 403, "{path}");
    }
    // A page there would look for its parts elsewhere.
    assert_eq!(status("GET", program.path.trim_end_matches('/'), &[header], b""), 404);
    let tunnel = program.connect().ask("GET", &program.path, &[("Host", "127.0.0.1:9")], b"").body;
    assert!(String::from_utf8_lossy(&tunnel).contains("a tunnel must have that port at both ends"));
    for (rest, expected) in [("scene", 405), ("picture", 400), ("nothing", 404), ("../Cargo.toml", 404)] {
        assert_eq!(status("POST", &format!("{}{rest}", program.path), &[header], b"{}"), expected, "{rest}");
    }
    let long = vec![b' '; 5000];
    assert_eq!(status("POST", &format!("{}picture", program.path), &[header], &long), 413);
    let start = &program.scene()["start"];
    for (key, value) in [("scheme", "attention:Cargo.toml"), ("scheme", "median"), ("layer", "everything")] {
        let mut wrong = request("a", start, true);
        wrong[key] = value.into();
        assert_eq!(program.connect().picture(&wrong).status, 400, "{key}={value}");
    }
    // After all of that it goes on.
    let (answer, picture) = program.connect().picture(&request("a", start, false)).unpacked();
    assert_eq!((answer["full"].as_bool(), picture.dimensions()), (Some(true), (24, 24)));
}

/// The room in small pictures, of a program that finds no others but those in this folder.
fn filming(programs: &Path) -> Program {
    let arguments = format!(
        "view {} --sources 003..007 --size 64x48 --weights mean --no-browser --device cpu",
        data("room").display()
    );
    let mut viewer = command(&repository(), &arguments);
    // As many frames wait to be encoded as there are threads.
    viewer.env("PATH", programs).env("TMPDIR", programs).env("RAYON_NUM_THREADS", "2");
    Program::of(viewer)
}

/// A path along which a camera moves sideways.
fn path(start: &Value, frames: usize) -> Value {
    let pose = |frame: usize| {
        let mut pose = start.clone();
        pose[0][3] = (number_of(&pose[0][3]) + 0.01 * frame as f64).into();
        pose
    };
    json!({"poses": (0..frames).map(pose).collect::<Vec<_>>(), "scheme": "mean"})
}

fn send_video(connection: &mut Connection<'_>, program: &Program, path: &Value) {
    let target = format!("{}video", program.path);
    connection.send("POST", &target, &[("Host", &program.host)], path.to_string().as_bytes());
}

fn video(program: &Program, path: &Value) -> Answer {
    let mut connection = program.connect();
    send_video(&mut connection, program, path);
    connection.receive()
}

fn a_video_has_the_pictures_of_its_path() {
    let folder = Folder::new();
    let program = filming(&folder);
    let scene = program.scene();
    assert_eq!(scene["video"], json!({"format": "webp", "most_frames": 240}));
    let film = path(&scene["start"], 3);
    let answer = video(&program, &film);
    assert!(answer.status == 200 && answer.head.contains("Content-Type: image/webp"), "{}", answer.head);
    let decoder = WebPDecoder::new(Cursor::new(answer.body)).expect("a WebP");
    let frames = decoder.into_frames().collect_frames().expect("frames");
    assert_eq!(frames.len(), 3);
    for (frame, pose) in frames.iter().zip(list_of(&film["poses"])) {
        let mut request = request("a", pose, false);
        request["scheme"] = "mean".into();
        let (_, picture) = program.connect().picture(&request).unpacked();
        assert!(DynamicImage::from(frame.buffer().clone()).into_rgb8() == picture, "without loss");
        // Rounded to whole milliseconds.
        let (milliseconds, divisor) = frame.delay().numer_denom_ms();
        assert!((41..=42).contains(&(milliseconds / divisor)), "{milliseconds} / {divisor}");
    }
    for (wrong, part) in [
        (path(&scene["start"], 1), "from 2 to 240 frames, not 1"),
        (path(&scene["start"], 241), "from 2 to 240 frames, not 241"),
        (json!({"poses": film["poses"], "scheme": "attention:Cargo.toml"}), "reads a file"),
        (json!({"poses": [[1]], "scheme": "mean"}), "cannot be read"),
    ] {
        let answer = video(&program, &wrong);
        assert_eq!(answer.status, 400);
        assert!(String::from_utf8_lossy(&answer.body).contains(part), "{}", String::from_utf8_lossy(&answer.body));
    }
    // Only a path is that long.
    let long = film.to_string() + &" ".repeat(2000);
    let target = format!("{}picture", program.path);
    assert_eq!(program.connect().ask("POST", &target, &[("Host", &program.host)], long.as_bytes()).status, 413);
    assert_eq!(names_in(&folder), [""; 0], "its scratch folder is gone");
}

fn one_video_at_a_time_for_who_waits() {
    let folder = Folder::new();
    let mut program = filming(&folder);
    let start = program.scene()["start"].clone();
    let filmed = || program.get("status").json()["video"].clone();
    let (short, long) = (path(&start, 2), path(&start, 240));
    let mut waiting = program.connect();
    send_video(&mut waiting, &program, &long);
    wait_until("no frame is made", || filmed()[0].as_u64() >= Some(1));
    let refused = video(&program, &short);
    assert_eq!(refused.status, 409, "{}", String::from_utf8_lossy(&refused.body));
    // Pictures are not kept from anybody meanwhile.
    let (answer, _) = program.connect().picture(&request("a", &start, false)).unpacked();
    assert_eq!(answer["full"].as_bool(), Some(true));
    assert!(filmed()[1] == 240 && filmed()[0].as_u64() < Some(240), "{} was too soon", filmed());
    // Who goes cancels it, and the next one may.
    drop(waiting);
    wait_until("nobody waits for it", || filmed().is_null());
    assert_eq!(video(&program, &short).status, 200);
    // The end of the program does not wait for it, and leaves nothing of it.
    let mut waiting = program.connect();
    send_video(&mut waiting, &program, &long);
    wait_until("no frame is made", || filmed()[0].as_u64() >= Some(1));
    drop(waiting);
    assert_eq!(program.interrupt().0, Some(0));
    assert_eq!(names_in(&folder), [""; 0]);
}

fn a_video_is_mp4_where_ffmpeg_is() {
    let folder = Folder::new();
    // What comes in is what goes out, to the last argument.
    folder.script("ffmpeg", "[ \"$1\" = -version ] && exit\nfor last; do :; done\nexec /bin/cat > \"$last\"\n");
    let program = filming(&folder);
    let scene = program.scene();
    assert_eq!(scene["video"]["format"], "mp4");
    let answer = video(&program, &path(&scene["start"], 2));
    assert!(answer.status == 200 && answer.head.contains("Content-Type: video/mp4"), "{}", answer.head);
    assert!(answer.body.starts_with(b"YUV4MPEG2 W64 H48 F24:1 "), "{}", String::from_utf8_lossy(&answer.body[..40]));
    folder.script("ffmpeg", "echo 'no such codec' >&2; exit 1\n");
    let answer = video(&program, &path(&scene["start"], 2));
    let said = String::from_utf8_lossy(&answer.body).into_owned();
    assert!(
        answer.status == 503 && said.contains("the video cannot be written") && said.contains("no such codec"),
        "{said}"
    );
    assert_eq!(names_in(&folder), ["ffmpeg"]);
}

/// Pictures come while the program that encodes takes no frame, and none of the frames is lost.
fn an_encoder_that_waits_keeps_no_picture_from_anybody() {
    const FRAMES: usize = 24;
    let folder = Folder::new();
    let waits = "while [ ! -e \"${0%/*}/go\" ] && [ -e \"$0\" ]; do /bin/sleep 0.05; done";
    let script = format!("[ \"$1\" = -version ] && exit\n{waits}\nfor last; do :; done\nexec /bin/cat > \"$last\"\n");
    folder.script("ffmpeg", &script);
    let program = filming(&folder);
    let start = program.scene()["start"].clone();
    let mut waiting = program.connect();
    send_video(&mut waiting, &program, &path(&start, FRAMES));
    let mut before = 0;
    // The pipe holds some frames, and fewer than the video has.
    wait_until("frames are taken without end", || {
        std::thread::sleep(Duration::from_millis(500));
        let now = program.get("status").json()["video"][0].as_u64().unwrap_or(0);
        now > 0 && now == std::mem::replace(&mut before, now)
    });
    assert!(before < FRAMES as u64, "no frame waits");
    for is_moving in [true, false] {
        program.connect().picture(&request("a", &start, is_moving)).unpacked();
    }
    folder.write("go", "");
    let answer = waiting.receive();
    assert_eq!(answer.status, 200, "{}", String::from_utf8_lossy(&answer.body));
    let head = answer.body.iter().position(|byte| *byte == b'\n').expect("a line") + 1;
    assert_eq!(answer.body.len() - head, FRAMES * ("FRAME\n".len() + 3 * 64 * 48));
}

/// The ring around the subject, and a picture from its other side.
fn how_much_was_photographed_is_told() {
    let program = start(&repository(), &format!("{} --size 24x18", data("room").display()));
    let scene = program.scene();
    let ring = list_of(&scene["ring"]);
    let seen: Vec<f64> = ring.iter().map(|place| number_of(&place["seen"])).collect();
    assert_eq!(seen.len(), 36);
    let count = |is: &dyn Fn(f64) -> bool| seen.iter().filter(|share| is(**share)).count();
    assert!(count(&|share| share > 0.9) >= 3 && count(&|share| share < 0.1) >= 15, "{seen:?}");
    let share = |pose: &Value, is_moving: bool| {
        let (answer, _) = program.connect().picture(&request("a", pose, is_moving)).unpacked();
        number_of(&answer["seen"])
    };
    // Looking back, over its own shoulder: the first two columns are turned around.
    let (there, mut away) = (scene["start"].clone(), scene["start"].clone());
    for row in 0..3 {
        for column in [0, 2] {
            away[row][column] = (-number_of(&away[row][column])).into();
        }
    }
    for is_moving in [true, false] {
        assert!(share(&there, is_moving) > 0.8 && share(&away, is_moving) < 0.2);
    }
}

fn full_pictures_are_those_of_render() {
    let folder = Folder::new();
    let scene = data("room");
    let options = "--sources 000..004,006..009 --size 96x72";
    for scheme in ["error:alpha=1", "gaussian:beta=2"] {
        let arguments =
            format!("render {} --targets 005 --weights {scheme} {options} --device cpu -o out", scene.display());
        done_with_warnings(&folder, &arguments);
    }
    let program = start(&folder, &format!("{} {options} --weights error:alpha=1", scene.display()));
    let found = program.scene();
    let others = list_of(&found["others"]);
    let pose = &others.iter().find(|view| view["name"] == "005").expect("view 005")["pose"];
    let mut connection = program.connect();
    let mut pictures = Vec::new();
    // Back to the first one: what was encoded for another scheme is not used.
    for scheme in ["error:alpha=1", "mean", "gaussian:beta=2"] {
        let mut request = request("a", pose, false);
        request["scheme"] = scheme.into();
        request["layer"] = "depth".into();
        let (answer, picture) = connection.picture(&request).unpacked();
        assert_eq!(answer["layers"], json!(["depth", "confidence"]));
        assert_eq!(answer["layer"]["bytes"], 96 * 72);
        let sum: f64 = numbers(&answer["weights"]).iter().sum();
        assert_near(sum, 1.0, 1.0e-5);
        pictures.push(picture);
    }
    let rendered = image::open(folder.join("out/005.png")).expect("a picture").to_rgb8();
    assert!(pictures[2] == rendered, "the picture is not that of render");
    assert!(pictures[0] != pictures[1] && pictures[0] != rendered);
}

/// Photographs of two shapes, far apart, of which one is missing: the page is of the first source's shape, as `render`
/// takes it, and hears of the scene's warnings.
fn pictures_have_the_size_and_the_units_that_are_told() {
    let folder = Folder::new();
    let mut frames = Vec::new();
    for (view, [width, height]) in [[64, 48], [48, 64], [48, 64], [48, 64]].into_iter().enumerate() {
        let picture = RgbImage::from_fn(width, height, |x, y| Rgb([(x * 5) as u8, (y * 5) as u8, (x * y % 251) as u8]));
        picture.save(folder.file(&format!("images/{view}.png"))).expect("a photograph");
        let across = 1.0e6 * view as f64;
        frames.push(json!({
            "file_path": format!("images/{view}.png"), "w": width, "h": height, "fl_x": 60, "fl_y": 60,
            "cx": width / 2, "cy": height / 2,
            "transform_matrix": [[1, 0, 0, across], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
        }));
    }
    frames
        .push(json!({ "file_path": "images/gone.png", "fl_x": 60, "transform_matrix": frames[0]["transform_matrix"] }));
    folder.write("transforms.json", json!({ "frames": frames }).to_string());
    let program = start(&folder, ". --sources 1,2,3 --size 32x24 --weights mean");
    let found = program.scene();
    let mut request = request("a", &found["start"], false);
    (request["scheme"], request["layer"]) = ("mean".into(), "depth".into());
    let (answer, picture) = program.connect().picture(&request).unpacked();
    assert_eq!(picture.dimensions(), (24, 32), "upright, as the first source");
    assert_eq!(
        (&found["size"], &answer["record"]["size"], &answer["size"]),
        (&json!([24, 32]), &json!([24, 32]), &json!([24, 32]))
    );
    let far = number_of(&answer["layer"]["range"][1]);
    assert!(far > 1.0e5, "in units of the files: {far}");
    let warnings = program.get("status").json()["warnings"].to_string();
    assert!(warnings.contains("1 of 5 photographs are not there"), "{warnings}");
}

/// Whatever a person does with the camera, there is a picture or a sentence that says why not.
fn no_view_is_an_error_of_the_server() {
    let folder = toy();
    let program = start(&folder, "toy --sources 0..3 --size 24x24 --weights mean");
    let found = program.scene();
    let mut connection = program.connect();
    for (axis, value) in [(0, 0.0), (2, -1.0e3), (1, 1.0e6), (0, 1.0e12), (2, 1.0e30), (1, -3.0e38), (0, 1.0e39)] {
        for is_moving in [true, false] {
            let mut pose = found["start"].clone();
            pose[axis][3] = json!(value);
            let answer = connection.picture(&request("a", &pose, is_moving));
            let text = String::from_utf8_lossy(&answer.body);
            assert!(matches!(answer.status, 200 | 400 | 422), "{value}: {} {text}", answer.status);
            assert!(answer.status == 200 || text.contains(' '), "{value}: a sentence: {text}");
        }
    }
    // In the middle of the subject, and from there away from it.
    let mut inside = found["start"].clone();
    (0..3).for_each(|axis| inside[axis][3] = found["focus"][axis].clone());
    assert_eq!(connection.picture(&request("a", &inside, false)).status, 200);
    connection.picture(&request("a", &found["start"], false)).unpacked();
}

/// What `--weights auto` chooses is what `render` chooses, with the field's scalars; other schemes have the usual ones.
fn the_scheme_can_be_chosen_for_the_scene() {
    let folder = toy();
    let options = "--sources 000000..000011 --size 48x48";
    let program = start(&folder, &format!("toy {options} --weights auto"));
    let found = program.scene();
    let pose = &found["others"][8]["pose"];
    assert_eq!((&found["scheme"], &found["chooses"]), (&json!("error:alpha=1"), &json!(true)));
    // A video that asks for what is chosen waits for the choice, which is made beside the pictures.
    let mut film = path(pose, 2);
    film["scheme"] = Value::Null;
    let film = video(&program, &film);
    let decoder = WebPDecoder::new(Cursor::new(film.body)).expect("a WebP");
    let filmed = decoder.into_frames().collect_frames().expect("frames").remove(0).into_buffer();
    program.connect().picture(&request("a", pose, false)).unpacked();
    let chosen = || program.get("status").json()["chosen"].clone();
    wait_until("no scheme is chosen", || !chosen().is_null());
    let chosen = chosen();
    assert_eq!(found["others"][8]["name"], "000020");
    assert_eq!(found["commands"]["first_weights"], "auto");
    let picture = |scheme: &serde_json::Value| {
        let mut request = request("a", pose, false);
        request["scheme"] = scheme.clone();
        program.connect().picture(&request).unpacked().1
    };
    let shown = [&chosen, &json!("mean"), &chosen].map(picture);
    for (scheme, row) in ["auto", "mean"].into_iter().zip(&shown) {
        let arguments = format!("render toy --targets 000020 --weights {scheme} {options} --device cpu -o {scheme}");
        done_with_warnings(&folder, &arguments);
        let path = folder.join(scheme).join("000020.png");
        assert!(image::open(path).expect("a picture").to_rgb8() == *row, "{scheme}: another picture");
    }
    assert!(shown[0] != shown[1] && shown[0] == shown[2]);
    assert!(DynamicImage::from(filmed).into_rgb8() == shown[0], "the video has another scheme");
}

/// The kernels are the same functions on every device.
fn a_vulkan_device_shows_the_same() {
    let folder = toy();
    let pictures = ["cpu", "vulkan"].map(|device| {
        let program = Program::start(BINARY, device, &folder, "toy --sources 0..3 --size 32x32");
        let found = program.scene();
        assert_eq!(found["device"].as_str().is_some_and(|name| name.starts_with("cpu")), device == "cpu", "{found}");
        let mut connection = program.connect();
        let coarse = connection.picture(&request("a", &found["start"], true)).unpacked().1;
        assert!(coarse.width() <= 32);
        connection.picture(&request("a", &found["start"], false)).unpacked().1
    });
    let gaps = pictures[0].as_raw().iter().zip(pictures[1].as_raw()).map(|(a, b)| u64::from(a.abs_diff(*b)));
    let mean = gaps.sum::<u64>() as f64 / pictures[0].as_raw().len() as f64;
    assert!(pictures[0].dimensions() == (32, 32) && mean < 0.5, "they differ by {mean} of 255");
}

fn the_newest_request_wins() {
    let program = room("");
    let start = program.scene()["start"].clone();
    let mut first = program.connect();
    let (answer, _) = first.picture(&request("a", &start, true)).unpacked();
    assert_eq!(answer["full"], false);
    // A full picture takes seconds the first time; then its tab wants something else.
    first.send_picture(&request("a", &start, false));
    let (mut second, mut third) = (program.connect(), program.connect());
    std::thread::sleep(Duration::from_millis(100));
    second.send_picture(&request("a", &start, false));
    let other = third.picture(&request("b", &start, true));
    assert_eq!(other.unpacked().0["full"], false, "another tab does not wait for it");
    third.send_picture(&request("a", &start, true));
    assert_eq!((first.receive().status, second.receive().status), (204, 204));
    assert_eq!(third.receive().unpacked().0["full"], false);
    // Weights are told without a picture.
    let weights = third.ask(
        "POST",
        &format!("{}weights", program.path),
        &[("Host", &program.host)],
        request("a", &start, true).to_string().as_bytes(),
    );
    assert_eq!(numbers(&weights.json()).len(), 11);
}

fn ctrl_c_ends_it_and_nothing_is_written() {
    let folder = toy();
    let before = files_below(&folder);
    let mut program = start(&folder, "toy --size 48x48");
    let start = program.scene()["start"].clone();
    program.connect().picture(&request("a", &start, true)).unpacked();
    // In the middle of a full picture.
    let mut connection = program.connect();
    connection.send_picture(&request("a", &start, false));
    drop(connection);
    assert_eq!(program.interrupt(), (Some(0), String::new()));
    assert!(std::net::TcpStream::connect(&program.host).is_err(), "it still listens");
    assert_eq!(files_below(&folder), before);
}

fn a_taken_port_is_an_error() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = listener.local_addr().expect("an address").port();
    let folder = toy();
    let parts = ["cannot listen on 127.0.0.1", &port.to_string(), "--port"];
    assert_refused(&folder, &format!("view toy --no-browser --device cpu --port {port}"), &parts);
    assert_refused(&folder, "view toy --no-browser --size 48x20", &["does not keep the shape", "--size"]);
}

/// Fields without a cheaper form are shown in smaller pictures of their own.
fn learned_fields_are_shown() {
    let folder = toy();
    for (model, layers) in
        [("formula:8 --samples 16,4,4", json!(["depth"])), ("genvs:small --steps 2 --samples 8", json!([]))]
    {
        let arguments = format!("toy --sources 000000,000008,000016 --size 32x32 --model {model}");
        let program = start(&folder, &arguments);
        let start = program.scene()["start"].clone();
        let mut connection = program.connect();
        let (coarse, picture) = connection.picture(&request("a", &start, true)).unpacked();
        assert!(picture.width() <= 32, "{model}: {coarse}");
        let (full, picture) = connection.picture(&request("a", &start, false)).unpacked();
        assert_eq!((full["full"].as_bool(), picture.dimensions()), (Some(true), (32, 32)), "{model}");
        assert_eq!(full["layers"], layers, "{model}");
    }
}

/// At rest the picture of `render`, while moving a smaller one of the same.
fn gaussians_are_shown() {
    let folder = toy();
    done_with_warnings(&folder, "optimise toy --size 48x48 --device cpu -o toy.ply");
    done_with_warnings(&folder, "render toy --gaussians toy.ply --targets 20 --size 64x64 --device cpu -o out");
    let expected = image::open(folder.join("out/000020.png")).expect("a picture").to_rgb8();
    let program = start(&folder, "toy --gaussians toy.ply --sources 0..19 --size 64x64");
    let found = program.scene();
    let others = list_of(&found["others"]);
    let pose = &others.iter().find(|view| view["name"] == "000020").expect("view 20")["pose"];
    let mut connection = program.connect();
    let (full, picture) = connection.picture(&request("a", pose, false)).unpacked();
    assert_eq!((&full["full"], &found["is_weighted"]), (&json!(true), &json!(false)));
    assert!(picture == expected, "it is not the picture of render");
    let mut moving = request("a", pose, true);
    moving["side"] = found["moving_side"].clone();
    assert_eq!(found["moving_side"], 64, "as large as at rest, where a device is fast enough");
    for _ in 0..3 {
        let (coarse, picture) = connection.picture(&moving).unpacked();
        assert_eq!(coarse["full"], false);
        let (width, height) = picture.dimensions();
        assert!(width == height && (16..=64).contains(&width), "{width}x{height}");
        let small = image::imageops::resize(&expected, width, height, image::imageops::FilterType::Triangle);
        let difference = picture.iter().zip(small.iter()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>();
        let mean = difference / f64::from(3 * width * height);
        assert!(mean < 12.0, "{mean} levels beside the picture at rest");
    }
}
