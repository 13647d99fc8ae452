//! `viewfuse optimise`: the scene of Gaussians, its score on the way, what interruptions leave, and who reads its
//! files.
#![cfg(unix)]

use super::{assert_refused, assert_wrong_arguments, done, done_with_warnings, killed_when, run, start};
use std::fs;
use std::path::Path;
use viewfuse::scene::SceneFrame;
use viewfuse::scene::gaussians::{Gaussian, GaussianScene};
use viewfuse_tests::command::{Outcome, files_below, names_in, toy};
use viewfuse_tests::patience::{end, send, wait_while_running};
use viewfuse_tests::places::data;

viewfuse_tests::trials![
    held_out_views_are_scored_on_the_way,
    it_ends_with_the_weights_of_a_view,
    the_number_follows_the_pixels,
    ctrl_c_keeps_what_there_is,
    after_a_kill_it_goes_on_from_the_file,
    a_file_of_bytes_has_the_score_that_is_told,
    options_of_the_field_are_those_of_the_command,
    what_it_refuses,
    an_antialiased_file_says_so_and_is_shown_so,
    a_page_holds_what_the_file_holds,
    more_quality_is_tried_on_sources_and_has_more_gaussians_or_iterations,
    few_photographs_and_a_short_time_have_fewer_iterations,
    without_a_view_that_is_kept_back_it_says_what_its_figure_is,
];

const OPTIMISE: &str = "optimise toy --size 48x48 --device cpu";

fn gaussians(path: &Path) -> GaussianScene {
    GaussianScene::read(path, &SceneFrame::FILE).expect("a file of Gaussians")
}

/// Writes a file with a Gaussian that no camera of the sample scene sees.
fn scene(path: &Path) {
    let gaussian = Gaussian {
        position: [0.0, 0.0, 900.0],
        log_scales: [-3.0; 3],
        rotation: [1.0, 0.0, 0.0, 0.0],
        opacity: 3.0,
        f_dc: [0.0; 3],
    };
    let scene = GaussianScene { gaussians: vec![gaussian], ..GaussianScene::default() };
    scene.write(path, &SceneFrame::FILE).expect("a file");
}

/// Iteration and decibels of the lines about held-out views.
fn scores(text: &str) -> Vec<(u32, f64)> {
    let score = |line: &str| {
        let (iteration, rest) = line.strip_prefix("iteration ")?.split_once(" of ")?;
        let (_, psnr) = rest.split_once(": held-out views have a PSNR of ")?;
        Some((iteration.parse().ok()?, psnr.strip_suffix(" dB")?.parse().ok()?))
    };
    text.lines().filter_map(score).collect()
}

fn held_out_views_are_scored_on_the_way() {
    let folder = toy();
    let text = done(&folder, &format!("{OPTIMISE} --left-out 20,21 -o a.ply"));
    let scores = scores(&text);
    let iterations: Vec<u32> = scores.iter().map(|score| score.0).collect();
    assert_eq!(iterations, [40, 80, 120, 160, 200, 240, 280, 320, 340], "{text}");
    assert!(scores[8].1 > scores[0].1 + 3.0, "it becomes better: {text}");
    assert!(!text.contains("fit: "), "{text}");
    let count = gaussians(&folder.join("a.ply")).gaussians.len();
    assert!(text.contains(&format!("a.ply: {count} Gaussians after 340 of 340 iterations\n")), "{text}");
    // The last score is that of `render` with the file, from the same sources.
    let rendered = done(&folder, "render toy --gaussians a.ply --targets 20,21 --size 48x48 --device cpu -o out");
    let psnr = |line: &str| line.split("PSNR ").nth(1)?.split(" dB").next()?.parse::<f64>().ok();
    let again: Vec<f64> = rendered.lines().filter_map(psnr).collect();
    assert!(again.len() == 2 && (again.iter().sum::<f64>() / 2.0 - scores[8].1).abs() < 0.02, "{rendered}\n{text}");
    assert!(rendered.contains("\n2 views of the file's Gaussians on cpu"), "{rendered}");
    assert!(rendered.contains("\nthe file does not say which photographs it was made from: "), "{rendered}");
    // Its pictures need no sources.
    done(&folder, "render toy --gaussians a.ply --targets all --size 16x16 --device cpu -o all");
    assert!(folder.join("all/run.json").is_file() && folder.join("all/000020.png").is_file());
    // The same seed, any number of threads.
    done(&folder, &format!("{OPTIMISE} --left-out 20,21 --threads 1 -o b.ply"));
    let read = |name: &str| fs::read(folder.join(name)).expect("a file");
    assert!(read("a.ply") == read("b.ply"), "one thread makes another scene");
    done(&folder, &format!("{OPTIMISE} --left-out 20,21 --seed 5 -o c.ply"));
    assert!(read("a.ply") != read("c.ply"), "the seed changes nothing");
}

fn an_antialiased_file_says_so_and_is_shown_so() {
    let folder = toy();
    done(&folder, &format!("{OPTIMISE} --iterations 10 --left-out 20 --antialias -o a.ply"));
    done_with_warnings(&folder, &format!("{OPTIMISE} --iterations 1 --left-out 20 --resume a.ply -o b.spz"));
    assert!(["a.ply", "b.spz"].iter().all(|file| gaussians(&folder.join(file)).is_antialiased));
    for output in ["c.html", "c.splat"] {
        assert_wrong_arguments(&folder, &format!("{OPTIMISE} --antialias -o {output}"), &["antialiased", ".ply"]);
        let Outcome { code, stderr, .. } = run(&folder, &format!("{OPTIMISE} --resume a.ply -o {output}"));
        assert!(code == Some(2) && stderr.contains("antialiased; write a .ply"), "{stderr}");
        assert!(!folder.join(output).exists());
    }
    // The same Gaussians in a file that does not say so are another picture.
    let unsaid = GaussianScene { is_antialiased: false, ..gaussians(&folder.join("a.ply")) };
    unsaid.write(&folder.join("c.ply"), &SceneFrame::FILE).expect("a file");
    let picture = |file: &str| {
        let arguments = format!("render toy --gaussians {file} --targets 20 --size 16x16 --device cpu -o {file}-out");
        done_with_warnings(&folder, &arguments);
        fs::read(folder.join(format!("{file}-out/000020.png"))).expect("a picture")
    };
    assert!(picture("a.ply") != picture("c.ply"), "what the file says changes nothing");
}

fn it_ends_with_the_weights_of_a_view() {
    let folder = toy();
    let optimised = |options: &str, output: &str| {
        let text = done(&folder, &format!("{OPTIMISE} --left-out 20,21 {options} -o {output}"));
        (scores(&text), fs::read(folder.join(output)).expect("a file"))
    };
    let (without, one, other) =
        (optimised("", "a.ply"), optimised("--towards 20", "b.ply"), optimised("--towards 21", "c.ply"));
    // The same up to there, then 60 iterations more, which differ by the view and by the scheme.
    assert_eq!(one.0[..9], without.0[..]);
    assert_eq!(one.0[9..].iter().map(|score| score.0).collect::<Vec<_>>(), [360, 400]);
    assert!(one.1 != other.1, "both views have the same weights");
    let mean = optimised("--towards 20 --weights mean", "d.ply");
    assert!(mean.1 != one.1, "the scheme does not count");
}

fn the_number_follows_the_pixels() {
    let folder = toy();
    let count = |options: &str| {
        done(&folder, &format!("optimise toy --device cpu --iterations 4 {options} -o toy.ply"));
        gaussians(&folder.join("toy.ply")).gaussians.len()
    };
    let usual = count("--size 32x32");
    assert!(usual > 200 && usual <= 32 * 32 * 3 / 2, "{usual} Gaussians for 32x32 pixels");
    let fewer = count("--size 32x32 --count 300");
    assert!(fewer > 200 && fewer <= 300, "{fewer}");
}

fn ctrl_c_keeps_what_there_is() {
    let folder = toy();
    let path = folder.join("toy.ply");
    let mut child = start(&folder, &format!("{OPTIMISE} --iterations 4000 -o toy.ply"));
    wait_while_running(&mut child, || path.exists());
    send("-INT", &child);
    assert_eq!(end(&mut child).expect("an end").code(), Some(130));
    let text = String::from_utf8(child.wait_with_output().expect("its output").stdout).expect("text");
    let count = gaussians(&path).gaussians.len();
    assert!(count > 30 && text.contains(&format!("toy.ply: {count} Gaussians after ")), "{text}");
    assert!(text.contains(" of 12000 iterations\n"), "{text}");
    assert_eq!(names_in(&folder), ["toy", "toy.ply"]);
}

fn after_a_kill_it_goes_on_from_the_file() {
    let folder = toy();
    let path = folder.join("toy.ply");
    killed_when(&folder, &format!("{OPTIMISE} --iterations 4000 --left-out 20 -o toy.ply"), || path.exists());
    let before = fs::read(&path).expect("a file");
    assert!(gaussians(&path).gaussians.len() > 30);
    let resumed = |output: &str| {
        let text = done(&folder, &format!("{OPTIMISE} --left-out 20 --resume toy.ply -o {output}"));
        (scores(&text), fs::read(folder.join(output)).expect("a file"))
    };
    // What goes on from a file is the same each time; it has the finest size's 160 iterations, and is better than the
    // file.
    let (first, second) = (resumed("a.ply"), resumed("b.ply"));
    assert!(first == second, "two scenes from one file");
    assert_eq!(first.0.iter().map(|score| score.0).collect::<Vec<_>>(), [200, 240, 280, 320, 340]);
    let rendered = done(&folder, "render toy --gaussians toy.ply --targets 20 --size 48x48 --device cpu -o out");
    let psnr = rendered.split("PSNR ").nth(1).and_then(|rest| rest.split(' ').next()).expect("a score");
    assert!(first.0[4].1 > psnr.parse().expect("a number"), "{rendered} {:?}", first.0);
    assert!(fs::read(&path).expect("a file") == before, "the file that it goes on from has changed");
    // A file that is there stays until there is a finished one.
    let unfinished = folder.join("a.unfinished.ply");
    let again = format!("{OPTIMISE} --iterations 4000 --left-out 20 -o a.ply");
    killed_when(&folder, &again, || unfinished.exists());
    assert!(fs::read(folder.join("a.ply")).expect("a file") == first.1, "a finished file has changed");
    assert!(gaussians(&unfinished).gaussians.len() > 30);
    assert_refused(&folder, &again, &["a.unfinished.ply: is of an optimisation that was stopped", "--resume"]);
    let kept = fs::read(&unfinished).expect("what there is so far");
    done(&folder, &format!("{OPTIMISE} --left-out 20 --resume a.unfinished.ply -o a.ply"));
    assert!(!unfinished.exists(), "what is finished takes its place");
    // Also of a few iterations, within which nothing is written on the way.
    folder.write("a.unfinished.ply", kept);
    done(&folder, &format!("{OPTIMISE} --resume a.unfinished.ply --iterations 2 -o a.ply"));
    assert!(!unfinished.exists(), "what is finished takes its place");
    let wrong = format!("{OPTIMISE} --resume a.ply --count 20 -o b.ply");
    assert_wrong_arguments(&folder, &wrong, &["--count 20", "none are removed"]);
}

/// Colours of a byte: what is scored on the way is what the file shows.
fn a_file_of_bytes_has_the_score_that_is_told() {
    let folder = toy();
    let text = done(&folder, "optimise toy --size 24x24 --iterations 800 --left-out 20 --device cpu -o a.splat");
    let told = scores(&text).last().expect("a score").1;
    let rendered = done(&folder, "render toy --gaussians a.splat --targets 20 --size 24x24 --device cpu -o out");
    let psnr = rendered.split("PSNR ").nth(1).and_then(|rest| rest.split(' ').next()).expect("a score");
    let shown: f64 = psnr.parse().expect("a number");
    // Colours that leave 0 to 1 cost 0.24 dB here.
    assert!((shown - told).abs() < 0.1, "{shown} dB of {told}");
}

/// `--model gaussians` optimises on the way.
fn options_of_the_field_are_those_of_the_command() {
    let folder = toy();
    let render = |options: &str, output: &str| {
        let arguments = "render toy --targets 20 --size 32x32 --weights mean --no-sheets --device cpu";
        done(&folder, &format!("{arguments} {options} -o {output}"));
        fs::read(folder.join(output).join("000020.png")).expect("a picture")
    };
    let few = render("--model gaussians --gaussian-iterations 4", "few");
    assert!(few != render("--model gaussians --gaussian-iterations 8", "more"), "iterations change nothing");
    let count = "--model gaussians --gaussian-iterations 4 --gaussian-count 300";
    assert!(few != render(count, "count"), "the number changes nothing");
    let wrong = "render toy --targets 20 --model gaussians --gaussian-count 0 -o out";
    assert_wrong_arguments(&folder, wrong, &["--gaussian-count"]);
    let without = "render toy --targets 20 --gaussian-count 300 -o out";
    assert_wrong_arguments(&folder, without, &["--gaussian-count cannot be used"]);
}

fn what_it_refuses() {
    let folder = toy();
    assert_wrong_arguments(&folder, &format!("{OPTIMISE} -o toy.obj"), &["written as .ply or .html"]);
    assert_wrong_arguments(&folder, &format!("{OPTIMISE} --count 0 -o toy.ply"), &["--count"]);
    assert_refused(&folder, &format!("{OPTIMISE} --resume no.ply -o toy.ply"), &["no.ply"]);
    assert_refused(&folder, &format!("{OPTIMISE} --left-out 99 -o toy.ply"), &["99"]);
    assert_refused(&folder, &format!("{OPTIMISE} --left-out , -o toy.ply"), &["nothing would be held out"]);
    assert_refused(&folder, &format!("{OPTIMISE} --towards , -o toy.ply"), &["nothing would be held out"]);
    let twice = format!("{OPTIMISE} --sources 0..9 --left-out 3 -o toy.ply");
    assert_refused(&folder, &twice, &["a target and a source at once", "--left-out"]);
    assert_wrong_arguments(
        &folder,
        &format!("{OPTIMISE} --early-termination 0.1 -o toy.ply"),
        &["unexpected argument"],
    );
    let made = std::process::Command::new("mkfifo").arg(folder.join("pipe.ply")).status().expect("mkfifo runs");
    assert!(made.success());
    assert_refused(&folder, &format!("{OPTIMISE} -o pipe.ply"), &["pipe.ply", "no ordinary file"]);
    // A scan of somebody else's, and a page: what viewfuse wrote is replaced, as every run does.
    for name in ["scan.ply", "scan.spz", "page.html"] {
        folder.write(name, "ply\nformat ascii 1.0\nelement vertex 0\nend_header\n");
        let parts = [name, "was not written by viewfuse, and would be replaced"];
        assert_wrong_arguments(&folder, &format!("{OPTIMISE} -o {name}"), &parts);
    }
    assert_wrong_arguments(&folder, "points toy -o scan.ply", &["scan.ply: was not written by viewfuse"]);
    for name in ["again.ply", "again.spz", "again.SPLAT", "again.html"] {
        let command = format!("{OPTIMISE} --iterations 1 -o {name}");
        assert_eq!(run(&folder, &command).code, Some(0), "{name}");
        match name {
            // Nothing in it says whose it is.
            "again.SPLAT" => assert_wrong_arguments(&folder, &command, &["a .splat does not say who wrote it"]),
            _ => assert_eq!(run(&folder, &command).code, Some(0), "{name} again"),
        }
    }
    // A name in the text is no mark.
    folder.write("other.ply", "ply\nformat ascii 1.0\ncomment exported from /home/me/viewfuse/a.ply\nend_header\n");
    folder.write("other.html", "<!doctype html><title>My viewfuse notes</title>");
    for name in ["other.ply", "other.html"] {
        let parts = [name, "was not written by viewfuse"];
        assert_wrong_arguments(&folder, &format!("{OPTIMISE} --iterations 1 -o {name}"), &parts);
    }
    // What makes pictures without a field has none of its options.
    scene(&folder.join("a.ply"));
    for option in ["--fast", "--samples 8", "--gaussian-count 300", "--leave-out 0.1", "--max-error 40dB"] {
        let arguments = format!("render toy --gaussians a.ply {option} --targets 20 -o out");
        assert_wrong_arguments(&folder, &arguments, &["--gaussians", "cannot be used with"]);
    }
    folder.write("page.html", "<!doctype html>");
    let page = "render toy --gaussians page.html --targets 20 -o out";
    assert_refused(&folder, page, &["page.html", "Gaussians are not read from it"]);
    // Of another scene: a point far away.
    let other = format!("{OPTIMISE} --resume a.ply --iterations 1 -o b.ply");
    let Outcome { code, stderr, .. } = run(&folder, &other);
    assert!(code == Some(0) && stderr.contains("see none of the Gaussians"), "{stderr}");
}

/// Held-out sources of the sample scene prefer the sharper recipe to the usual iterations of the fast one, and more of
/// these to both; the views that a person keeps back are none of them.
fn more_quality_is_tried_on_sources_and_has_more_gaussians_or_iterations() {
    let folder = toy();
    let optimised = |options: &str, output: &str| {
        let text = done(&folder, &format!("{OPTIMISE} --left-out 20,21 {options} -o {output}"));
        let last = scores(&text).last().expect("scores").1;
        (text, last)
    };
    let trial = |text: &str| {
        let line = text.lines().find(|line| line.contains("held out of a trial")).expect("a trial");
        assert!(line.starts_with("2 of 22 photographs"), "{line}");
        line.to_owned()
    };
    // As many iterations of the sharper one as fit: all of them.
    let (text, sharp) = optimised("--quality standard --max-time 20m", "a.ply");
    let line = trial(&text);
    assert!(line.contains("with 340 iterations of fast") && line.contains("standard is used"), "{line}");
    assert!(text.contains(" iterations more, ") && text.contains(" fit into the time\n"), "{text}");
    let (text, long) = optimised("--quality standard", "e.ply");
    let line = trial(&text);
    assert!(line.contains("with 900 iterations of fast") && line.ends_with("fast is used"), "{line}");
    assert!(text.contains(" after 900 of 900 iterations\n"), "{text}");
    let (_, fast) = optimised("", "b.ply");
    assert!(sharp > fast + 0.2 && long > fast + 0.5, "{sharp}, {long} and {fast} dB");
    let (first, second) = (gaussians(&folder.join("a.ply")), gaussians(&folder.join("b.ply")));
    assert_eq!((first.degree, second.degree), (3, 3));
    // 48x48 pixels, three quarters of a Gaussian each.
    assert_eq!(first.gaussians.len(), 1728, "the number rises to its limit");
    // The last score is that of the file, harmonics included.
    let rendered = done(&folder, "render toy --gaussians a.ply --targets 20,21 --size 48x48 --device cpu -o out");
    let psnr = |line: &str| line.split("PSNR ").nth(1)?.split(" dB").next()?.parse::<f64>().ok();
    let again: Vec<f64> = rendered.lines().filter_map(psnr).collect();
    assert!(again.len() == 2 && (again.iter().sum::<f64>() / 2.0 - sharp).abs() < 0.02, "{rendered}\n{text}");
    // It goes on from the file with its harmonics: the first score of few iterations is no worse.
    let (text, resumed) = optimised("--resume a.ply --quality standard --iterations 40", "c.ply");
    assert!(resumed > sharp - 0.5, "{resumed} after {sharp} dB");
    let about = text.lines().find(|line| line.contains(" iterations more, about ")).expect("a time");
    assert!(about.ends_with(" s") || about.ends_with(" minutes"), "{about}");
    assert_eq!(gaussians(&folder.join("c.ply")).degree, 3);
    // Whole photographs have one colour for all directions in the fast recipe.
    let fast = format!("{OPTIMISE} --masks ignore --resume a.ply --iterations 1 -o d.ply");
    let Outcome { code, stderr, .. } = run(&folder, &fast);
    assert!(code == Some(0) && stderr.contains("the colours to go on from depend on the direction"), "{stderr}");
    assert_eq!(gaussians(&folder.join("d.ply")).degree, 0);
}

fn few_photographs_and_a_short_time_have_fewer_iterations() {
    let folder = toy();
    let few = done(&folder, &format!("{OPTIMISE} --sources 0..9 --quality standard -o a.ply"));
    assert!(few.contains("10 photographs are too few for standard, from 12 on: fast, with 340 iterations\n"), "{few}");
    assert!(few.contains(" after 340 of 340 iterations\n"), "{few}");
    // Whole photographs 32 degrees apart have the usual iterations; near to one another, more.
    let wide = "--masks ignore --sources 0..9 --quality standard -o a.ply";
    let Outcome { code, stdout, .. } = run(&folder, &format!("{OPTIMISE} {wide}"));
    assert!(code == Some(0) && stdout.contains(": fast, with 240 iterations\n"), "{stdout}");
    let room = data("room").display().to_string();
    let near = format!("optimise {room} --views 6 --size 40x30 --quality standard --device cpu -o a.ply");
    let text = done(&folder, &near);
    assert!(text.contains("6 photographs are too few for standard, from 12 on: fast, with 900 iterations\n"), "{text}");
    // The whole trial takes longer.
    let short = done(&folder, &format!("{OPTIMISE} --quality standard --max-time 1s -o b.ply"));
    let counts = short.split(" Gaussians after ").nth(1).and_then(|rest| rest.split(" iterations").next());
    let (done_so_far, all) = counts.and_then(|counts| counts.split_once(" of ")).expect("iterations");
    assert!(done_so_far == all && all.parse::<u32>().is_ok_and(|all| all < 1000), "{short}");
    assert!(short.contains(" is used\n"), "a trial or none is told: {short}");
    let wrong = format!("{OPTIMISE} --max-time 10m -o a.ply");
    assert_wrong_arguments(&folder, &wrong, &["--max-time is for --quality standard and high"]);
    for (options, words) in [
        ("--quality best", "'best' is not a quality: fast, standard or high"),
        ("--quality high --max-time soon", "soon is no time"),
    ] {
        assert_wrong_arguments(&folder, &format!("{OPTIMISE} {options} -o a.ply"), &[words]);
    }
}

fn a_page_holds_what_the_file_holds() {
    let folder = toy();
    // Neither holds colours that depend on the direction.
    let file = done(&folder, &format!("{OPTIMISE} -o toy.splat"));
    let Outcome { code, stdout, stderr } = run(&folder, &format!("{OPTIMISE} --quality fast -o toy.html"));
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    assert_eq!(stdout.replace("toy.html", "toy.splat"), file);
    let page = fs::read_to_string(folder.join("toy.html")).expect("a page");
    assert!(page.starts_with("<!doctype html>") || page.starts_with("<!DOCTYPE html>"), "{}", &page[..40]);
    assert!(!page.contains("src=\"http") && !page.contains("href=\"http"), "it needs a network");
    let bytes = files_below(&folder).into_iter().find(|(path, _)| path.ends_with("toy.splat")).expect("a file").1;
    assert!((page.len() as u64) < bytes + 200_000, "{} bytes of a page for {bytes} of a file", page.len());
}

fn without_a_view_that_is_kept_back_it_says_what_its_figure_is() {
    let folder = toy();
    let text = done(&folder, "optimise toy --sources 0..5 --size 32x32 --iterations 20 --device cpu -o a.ply");
    let line = text.lines().find_map(|line| line.strip_prefix("fit: PSNR ")).unwrap_or_else(|| panic!("{text}"));
    let (psnr, rest) = line.split_once(" dB on 3 of the sources themselves").expect("what it is of");
    assert!(psnr.parse::<f64>().is_ok_and(|psnr| (5.0..50.0).contains(&psnr)), "{psnr}");
    assert!(rest.contains("says nothing of new views") && rest.contains("--left-out VIEW"), "{rest}");
}
