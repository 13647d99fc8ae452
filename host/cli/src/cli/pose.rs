//! `viewfuse pose`.

mod solvers;

use super::outputs::keep_others;
use super::printing::{complain, say};
use super::terminal::Terminal;
use super::threads::on_threads;
use super::wrong::wrong;
use anyhow::{Context, bail};
use clap::Args;
use image::{DynamicImage, RgbImage};
use solvers::{From, solvers};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viewfuse_job::files::check_writable;
use viewfuse_job::progress::{Interrupted, Progress};
use viewfuse_job::shell::quoted;
use viewfuse_output::camera_map::camera_map;
use viewfuse_output::match_graph::match_graph;
use viewfuse_output::png::write_marked_png;
use viewfuse_pose::{
    FocalSource, Found, Kept, Matches, Options, Record, Refusal, Solver, Verdict, find, has_record, write,
};
use viewfuse_scene::inspect::inspect;
use viewfuse_scene::photographs::BackgroundChoice;
use viewfuse_scene::write::{Layout, check_name};
use viewfuse_scene::{Scene, encode_png, reads_below};

/// Most photographs of which a refusal tells which others they match.
const MAX_ROWS: usize = 24;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse pose photos/ -o posed\n      posed/sparse/0 and posed/images (COLMAP's layout), pose.json, cameras.png; \
    then: viewfuse render posed --orbit 24 -o out\n  viewfuse pose photos/ --focal 1375 -o posed\n      photographs \
    that do not state their focal length\n  viewfuse pose photos/ --from openmvg,colmap -o posed\n      with your own \
    COLMAP as a second opinion\n\n\
    Poses are found several times, with other features and, where the focal length is unknown, other guesses of it. \
    What is written is what two attempts agree on, and what passes this: each photograph, held out and rendered from \
    the others, is met at its pose, better than by copies of its neighbours, and not two degrees beside it. Where \
    neighbours are too far away for that, attempts must agree more closely and over many points, and the pose is \
    doubtful: pose.json and every command that opens\n\
    the scene say so. If nothing passes, no scene is written, and it is said which photographs match which.\n\n\
    The same command goes on with a run that was stopped or killed: attempts that were finished lie in a hidden folder \
    beside the output (.posed.attempts) until the command ends by itself.")]
pub(crate) struct Arguments {
    /// The folder of the photographs: JPEG, PNG, WebP
    photographs: PathBuf,
    /// Focal length in pixels of the first photograph [default: as the photographs state it (EXIF), otherwise found]
    #[arg(long, value_name = "PIXELS", value_parser = parse_focal)]
    focal: Option<f64>,
    /// What finds poses; several, with commas, confirm one another
    #[arg(long, value_name = "SOLVERS", value_delimiter = ',', default_value = "openmvg")]
    from: Vec<From>,
    /// Take every Nth photograph, in the order of the names
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    every: u16,
    /// How to lay the scene out: colmap (text; binary where a photograph's name has a blank), colmap-binary or
    /// transforms
    #[arg(long, default_value = "colmap", value_parser = parse_layout)]
    layout: Layout,
    /// Seed of every random draw
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Work on this many threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    /// Draw which photographs match which (PNG), whether poses are found or not
    #[arg(long, value_name = "FILE")]
    matches: Option<PathBuf>,
    /// Folder to write; must not be there yet, or be empty
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
}

fn parse_focal(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|focal| (1.0..=1.0e6).contains(focal))
        .ok_or_else(|| "a number of pixels from 1".to_owned())
}

/// The layouts that hold lenses.
fn parse_layout(text: &str) -> Result<Layout, String> {
    let layouts = [Layout::Colmap, Layout::ColmapBinary, Layout::Transforms];
    let layout = layouts.into_iter().find(|layout| layout.to_string() == text);
    layout.ok_or_else(|| "the layout must be colmap, colmap-binary or transforms".to_owned())
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let Arguments { photographs, output, .. } = arguments;
    if photographs.is_file() {
        return Err(wrong(format_args!("{}: is a file; give the folder of the photographs", photographs.display())));
    }
    let is_empty = || std::fs::read_dir(output).is_ok_and(|mut entries| entries.next().is_none());
    if output.is_symlink() || output.exists() && !is_empty() {
        remove_kept_for(output);
        bail!("{}: exists already and is not an empty folder; give another name", output.display());
    }
    if reads_below(photographs, output) {
        let output = output.display();
        return Err(wrong(format_args!(
            "--output {output}: photographs are read from this folder; give another folder"
        )));
    }
    if let Some(file) = &arguments.matches {
        keep_picture_apart(file, photographs, output)?;
        check_writable(file)?;
        keep_others(file)?;
    }
    let options = Options { focal: arguments.focal, seed: arguments.seed, every: arguments.every.into() };
    let (from, to) = (solvers(&arguments.from), (arguments.layout, output.as_path()));
    let work = || found(photographs, &from, &options, to, arguments.matches.as_deref());
    let found = on_threads(arguments.threads, work)??;
    let Ok(verdict) = &found.verdict else { bail!("{}: no verdict", photographs.display()) };
    print(&found, verdict, &found.record(verdict, &options))?;
    let layout = holding(arguments.layout, &verdict.scene);
    say(format_args!("written    {} ({layout}): {} photographs", output.display(), verdict.photos.len()))?;
    let word = quoted(output.as_os_str());
    say(format_args!("next       viewfuse render {word} --orbit 24 -o out"))?;
    Ok(ExitCode::SUCCESS)
}

/// The binary form of a layout whose text form does not hold the names of a scene's photographs.
fn holding(layout: Layout, scene: &Scene) -> Layout {
    let are_held = scene.views.iter().all(|view| check_name(layout, &view.name).is_ok());
    if layout == Layout::Colmap && !are_held { Layout::ColmapBinary } else { layout }
}

/// Removes the attempts that were kept for a scene that is there: a kill may have come between both. What cannot be
/// removed stays.
fn remove_kept_for(scene: &Path) {
    if let Some(folder) = Kept::folder_beside(scene).filter(|_| has_record(scene)) {
        let _ = Kept::remove(&folder);
    }
}

/// What `viewfuse pose PHOTOGRAPHS -o OUTPUT` does, told in one line.
pub(crate) fn find_with_defaults(photographs: &Path, output: &Path) -> anyhow::Result<String> {
    let (from, to) = (solvers(&[From::Openmvg]), (Layout::Colmap, output));
    let found = found(photographs, &from, &Options::default(), to, None)?;
    let all = found.intake.photos.len() + found.intake.unusable.len();
    let registered = found.verdict.map_or(0, |verdict| verdict.photos.len());
    Ok(format!("{}: written, {registered} of {all} photographs with poses", output.display()))
}

/// Refuses a picture in the folder of the photographs, where it would be one of them, or of the scene, which must be
/// empty.
fn keep_picture_apart(file: &Path, photographs: &Path, output: &Path) -> anyhow::Result<()> {
    let whole = |path: &Path| std::fs::canonicalize(path).or_else(|_| std::path::absolute(path));
    let folder = file.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
    let folder = whole(folder)?;
    for other in [photographs, output] {
        if folder.starts_with(whole(other)?) {
            let (file, other) = (file.display(), other.display());
            return Err(wrong(format_args!("--matches {file}: lies in {other}; give a file elsewhere")));
        }
    }
    Ok(())
}

/// Finds poses and writes the scene, and a picture of what matches to `matches`; the verdict is an accepted one.
/// Finished attempts of a run that is stopped are kept beside the output for the next one.
fn found(
    photographs: &Path,
    from: &[Box<dyn Solver>],
    options: &Options,
    to: (Layout, &Path),
    matches: Option<&Path>,
) -> anyhow::Result<Found> {
    let from: Vec<&dyn Solver> = from.iter().map(AsRef::as_ref).collect();
    let Some(folder) = Kept::folder_beside(to.1) else { return written(photographs, &from, options, to, matches) };
    Kept::check(&folder).with_context(|| folder.display().to_string())?;
    let kept: Vec<Kept<'_>> = from.iter().map(|solver| Kept::new(*solver, &folder)).collect();
    let from: Vec<&dyn Solver> = kept.iter().map(|solver| solver as &dyn Solver).collect();
    let found = written(photographs, &from, options, to, matches);
    let is_stopped = |error: &anyhow::Error| error.chain().any(|cause| cause.is::<Interrupted>());
    // Before the first question there is nothing of this run; what is there is of one that was stopped.
    if kept.iter().any(Kept::was_asked) && !found.as_ref().is_err_and(is_stopped) {
        Kept::remove(&folder).with_context(|| folder.display().to_string())?;
    }
    found
}

/// As [`found`], and nothing is kept.
fn written(
    photographs: &Path,
    from: &[&dyn Solver],
    options: &Options,
    (layout, output): (Layout, &Path),
    matches: Option<&Path>,
) -> anyhow::Result<Found> {
    let progress = Terminal::new("reading the photographs");
    let found = find(photographs, from, options, &progress)?;
    if let Some(file) = matches {
        write_marked_png(file, &DynamicImage::ImageRgb8(picture_of_matches(&found)))?;
    }
    let verdict = match &found.verdict {
        Ok(verdict) => verdict,
        Err(refusal) => {
            told(&found, refusal, &progress);
            drop(progress);
            table_of_matches(&found, matches.is_some());
            bail!("{}: no poses that can be trusted ({}); {}", photographs.display(), refusal.main(), advice(&found));
        }
    };
    let picture = camera_map(&verdict.scene, &inspect(&verdict.scene, BackgroundChoice::None, &progress)?);
    let files = [("cameras.png", encode_png(&DynamicImage::ImageRgb8(picture))?)];
    progress.stage("writing the scene", 9..10, 10);
    write(&found, verdict, options, (holding(layout, &verdict.scene), output), &files, &progress)?;
    Ok(found)
}

/// What a person can do where no poses were found.
fn advice(found: &Found) -> String {
    let is_stated = found.cameras.groups.iter().any(|group| group.source == FocalSource::Exif);
    let changed = found.attempts.iter().find_map(|attempt| found.cameras.changed_focal(&attempt.tried.focal));
    let way = found.matches.diagnosis();
    match changed {
        Some([focal, _]) if is_stated => format!(
            "what EXIF states is not what the photographs show, as after a crop or with a digital zoom: try --focal \
             {focal:.0}; or {way}"
        ),
        _ if found.is_contradicted => format!("leave out what was cropped or taken with a digital zoom; or {way}"),
        _ if found.cameras.are_known() => way,
        _ => format!("{way}; or give the focal length with --focal"),
    }
}

/// Which photographs cannot be used, and why attempts were refused: each reason once.
fn told(found: &Found, refusal: &Refusal, progress: &Terminal) {
    for (name, reason) in found.excluded(None) {
        progress.warn(&format!("{name}: {reason}"));
    }
    let mut reasons: Vec<(&str, Vec<String>)> = Vec::new();
    for (attempt, reason) in found.attempts.iter().zip(&refusal.reasons) {
        let tried = &attempt.tried;
        let guess =
            tried.focal_guess.map_or(String::new(), |guess| format!(", focal length from {guess} longest sides"));
        let name = format!("{} ({} at {} pixels{guess})", tried.solver, tried.features, tried.side);
        match reasons.iter_mut().find(|(earlier, _)| earlier == reason) {
            Some((_, names)) => names.push(name),
            None => reasons.push((reason, vec![name])),
        }
    }
    for (reason, names) in reasons {
        progress.warn(&format!("{}: {reason}", names.join(", ")));
    }
}

/// Tells of each photograph which others it matches.
fn table_of_matches(found: &Found, has_picture: bool) {
    let Matches { names, .. } = &found.matches;
    for (photo, name) in names.iter().enumerate().take(MAX_ROWS) {
        complain(format_args!("matches of {name}: {}", found.matches.told(photo)));
    }
    if names.len() > MAX_ROWS {
        complain(format_args!("matches of {} more photographs are not shown", names.len() - MAX_ROWS));
    }
    if !has_picture {
        complain("--matches FILE.png draws which photographs match which");
    }
}

fn picture_of_matches(found: &Found) -> RgbImage {
    let Matches { names, pairs } = &found.matches;
    let accepted = found.verdict.as_ref().map_or(&[][..], |verdict| verdict.photos.as_slice());
    let has_pose: Vec<bool> = (0..names.len()).map(|photo| accepted.contains(&photo)).collect();
    match_graph(names, pairs, Matches::MIN_TIE, &has_pose)
}

fn print(found: &Found, verdict: &Verdict, record: &Record<'_>) -> std::io::Result<()> {
    let all = found.intake.photos.len() + found.intake.unusable.len();
    say(format_args!("registered {} of {all} photographs", verdict.photos.len()))?;
    record.excluded.iter().try_for_each(|(name, reason)| say(format_args!("excluded   {name}: {reason}")))?;
    let doubtful = verdict.doubtful();
    if !doubtful.is_empty() {
        say(format_args!(
            "doubtful   {}: too far from the nearest photograph for a held-out picture to tell",
            doubtful.join(", ")
        ))?;
    }
    for camera in &record.cameras {
        let [width, height] = camera.size;
        let stated = camera.stated_focal.unwrap_or(camera.focal);
        let from = match camera.focal_from {
            FocalSource::Given => format!("refined from the given {stated:.0}"),
            FocalSource::Exif => format!("refined from EXIF's {stated:.0}"),
            FocalSource::Unknown => "found with the poses".to_owned(),
        };
        let (focal, widths) = (camera.focal, camera.focal / f64::from(width));
        say(format_args!(
            "focal      {focal:.0} pixels ({widths:.2} widths), {from}; {width}x{height}, k1 {:.4}",
            camera.k1
        ))?;
        if camera.is_doubtful() {
            say(format_args!(
                "doubtful   the lens of {width}x{height}: it distorts more than one of such a focal length does, as where \
                 photographs were cropped differently; poses and lens are then wrong by some percent"
            ))?;
        }
    }
    let tried = record.attempts[record.attempt];
    let (solver, points, error) = (&tried.solver, tried.points, record.reprojection_error);
    let features = tried.features;
    say(format_args!("points     {points} by {solver} ({features}), reprojection error {error:.2} pixels"))?;
    for image in record.accepted {
        let scores = &image.held_out;
        say(format_args!(
            "held out   {} rendered from the others {:.1} dB; copies {:.1} dB, two degrees beside {:.1} dB; attempts \
                differ by {:.2} degrees",
            scores.photograph,
            scores.score,
            scores.copy.max(scores.warp),
            scores.disturbed,
            image.rotation_difference
        ))?;
    }
    let neighbours = &record.neighbours;
    let (median, greatest) = (neighbours.median, neighbours.greatest);
    say(format_args!("neighbours {median:.0} degrees apart (median), at most {greatest:.0}"))?;
    let gap = |(a, b, gap): &(String, String, f32)| {
        say(format_args!("gap        {gap:.0} degrees: take photographs between {a} and {b}"))
    };
    neighbours.gaps.iter().try_for_each(gap)
}
