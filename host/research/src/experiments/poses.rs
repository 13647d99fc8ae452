//! Poses of bare photographs, on scenes whose poses are known: they are removed, found again, and compared.
//!
//! `cargo run --release -p viewfuse-research -- poses FILE SOLVER COUNTS SCENE...`
//!
//! `SOLVER` is `viewfuse-openmvg` or its file, or `pycolmap=` and a Python interpreter that has pycolmap; `COUNTS` are numbers of
//! photographs with commas (3,5,8), a scene is a folder. A row is a set of photographs of one scene, about 12 degrees apart. Rows that
//! `FILE` has already are not made again. Errors are of the poses that were accepted:
//!
//! ```text
//! focal      known: the scene's own is given; unknown: nothing is said, and the files' EXIF is taken out
//! accepted   photographs with an accepted pose, of those in the set
//! rotation   median over pairs of photographs of the angle between relative rotations found and known, degrees
//! worst      the greatest of these angles
//! centres    root mean square distance of the camera centres, aligned by a similarity, in percent of their spread
//! attempts   the greatest median rotation error of an attempt that was not accepted: what the verdict had to tell apart
//! ```

mod exif;
pub(super) mod pictures;
pub(super) mod refined;
mod rows;
mod sets;
mod truth;

use anyhow::{Context, bail};
use rows::{Rows, numbers};
use sets::{Focal, SETS, Set, neighbours};
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use truth::{Errors, errors};
use viewfuse_job::progress::Silent;
use viewfuse_pose::{Found, OpenMvg, Options, PoseError, PyColmap, Solver, find};
use viewfuse_scene::{Scene, read_picture};

const TITLE: &str = "scene           photographs  seed  focal    accepted  rotation   worst  centres  attempts";

pub(crate) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let [file, solver, counts, scenes @ ..] = arguments else { bail!("usage: poses FILE SOLVER COUNTS SCENE...") };
    let solver = solver_of(solver);
    let counts: Vec<usize> = counts.split(',').map(str::parse).collect::<Result<_, _>>().context("COUNTS")?;
    let mut rows = Rows::open(file, TITLE)?;
    for folder in scenes {
        let scene = Scene::open(folder)?;
        for set in SETS.iter().filter(|set| set.count <= scene.views.len() && counts.contains(&set.count)) {
            rows.row(&head(&scene.name(), set), || {
                Ok(one(&scene, set, solver.as_ref()).with_context(|| format!("{folder}: {set:?}"))?.to_string())
            })?;
        }
    }
    let summary = Totals::of(rows.all()).to_string();
    rows.finish(&summary)
}

/// The solver of this name.
fn solver_of(text: &str) -> Box<dyn Solver> {
    if let Some(python) = text.strip_prefix("pycolmap=") {
        return Box::new(PyColmap { python: PathBuf::from(python) });
    }
    Box::new(OpenMvg { program: PathBuf::from(text) })
}

/// What became of a set.
struct Row {
    /// Of the accepted poses; `None` if nothing was accepted.
    accepted: Option<Errors>,
    /// The greatest median rotation error of the other attempts.
    attempts: f64,
}

/// Removes the poses of a set and finds them again.
fn one(scene: &Scene, set: &Set, solver: &dyn Solver) -> anyhow::Result<Row> {
    let views = neighbours(scene, set);
    let Some((found, _)) = found_or_few(scene, set, &views, solver, Options::default().refine)? else {
        return Ok(Row { accepted: None, attempts: 0.0 });
    };
    let view_of = |photo: usize| view_of(&found, &views, photo);
    let accepted_attempt = found.verdict.as_ref().ok().map(|verdict| verdict.attempt);
    let mut attempts = 0.0_f64;
    for (index, attempt) in found.attempts.iter().enumerate().filter(|(index, _)| Some(*index) != accepted_attempt) {
        if let Some(solution) = &attempt.solution {
            let own = errors(scene, solution, &solution.registered(), view_of);
            attempts = attempts.max(if found.attempts[index].tried.registered > 1 { own.rotation } else { 0.0 });
        }
    }
    let accepted = found.verdict.as_ref().ok();
    let accepted = accepted.map(|verdict| errors(scene, &verdict.solution, &verdict.photos, view_of));
    Ok(Row { accepted, attempts })
}

/// Looks for the poses of copies of these views' photographs; with the folder of the copies, which the found scene refers to.
/// `None` with too few photographs that can be used.
fn found_or_few(
    scene: &Scene,
    set: &Set,
    views: &[usize],
    solver: &dyn Solver,
    refine: bool,
) -> anyhow::Result<Option<(Found, TempDir)>> {
    let folder = tempfile::tempdir()?;
    let focal = f64::from(scene.views[views[0]].camera.pinhole.focal()[0]);
    for (place, view) in views.iter().enumerate() {
        let file = scene.views[*view].image.as_deref().context("a photograph")?;
        put(file, &folder.path().join(format!("{place:03}")), set.focal, focal)?;
    }
    let focal = (set.focal == Focal::Known).then_some(focal);
    let options = Options { focal, seed: set.seed, every: 1, refine };
    match find(folder.path(), &[solver], &options, &Silent) {
        Err(PoseError::Few { .. }) => Ok(None),
        found => Ok(Some((found?, folder))),
    }
}

/// The view of the known scene that a photograph shows.
fn view_of(found: &Found, views: &[usize], photo: usize) -> usize {
    views[found.intake.photos[photo].name.parse::<usize>().unwrap_or_default()]
}

/// Copies a photograph; without what it states of itself where its focal length is to be unknown, with nothing but its focal
/// length in pixels where it is to state that. `to` has no extension.
fn put(file: &Path, to: &Path, stated: Focal, focal: f64) -> anyhow::Result<()> {
    let extension = file.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    match stated {
        Focal::Exif => std::fs::write(to.with_extension("jpg"), exif::jpeg(&read_picture(file)?, focal)?)?,
        Focal::Unknown if extension != "png" => read_picture(file)?.save(to.with_extension("png"))?,
        Focal::Known | Focal::Unknown => drop(std::fs::copy(file, to.with_extension(extension))?),
    }
    Ok(())
}

/// What a set's row begins with.
fn head(scene: &str, set: &Set) -> String {
    format!("{scene:<18} {:>9} {:>5}  {:<7}", set.count, set.seed, set.focal.name())
}

impl std::fmt::Display for Row {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.accepted {
            None => write!(f, " refused                            {:>8.2}", self.attempts),
            Some(own) => write!(
                f,
                "{:>8}  {:>8.2}  {:>6.2}  {:>7.1}  {:>8.2}",
                own.count, own.rotation, own.worst, own.centres, self.attempts
            ),
        }
    }
}

/// Most degrees of a median rotation error that is not called wrong.
const WRONG: f64 = 3.0;

#[derive(Default)]
struct Totals {
    sets: usize,
    accepted_sets: usize,
    asked: usize,
    accepted: usize,
    wrong: usize,
    with_wrong_attempts: usize,
}

impl Totals {
    /// Of rows as they are written.
    fn of(rows: &[String]) -> Totals {
        let mut totals = Totals::default();
        for row in rows {
            totals.sets += 1;
            totals.asked += row.split_whitespace().nth(1).and_then(|count| count.parse::<usize>().ok()).unwrap_or(0);
            let numbers = numbers(row);
            totals.with_wrong_attempts += usize::from(numbers.last().is_some_and(|attempts| *attempts > WRONG));
            if let [count, rotation, ..] = numbers[..]
                && !row.contains("refused")
            {
                totals.accepted_sets += 1;
                totals.accepted += count as usize;
                totals.wrong += usize::from(rotation > WRONG);
            }
        }
        totals
    }
}

impl std::fmt::Display for Totals {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Totals { sets, accepted_sets, asked, accepted, wrong, with_wrong_attempts } = self;
        write!(
            f,
            "{sets} sets: {accepted_sets} accepted, {} refused; {accepted} of {asked} photographs; accepted and wrong by more than \
             {WRONG} degrees: {wrong}; sets with an attempt that wrong: {with_wrong_attempts}",
            sets - accepted_sets
        )
    }
}
