//! The selection of source views and target cameras.
//!
//! Views are chosen by a list of items separated by commas: a view's name, its index (from 0; `#3` in any scene, 3
//! where this can be nothing else, [`Scene::views_meant`]), a range `A..B` of these (both ends included), `all`, a
//! split of the scene (`train`, `val`, `test`, where its files define splits), and `/STEP` after either to take every
//! `STEP`-th.

mod targets;

pub use targets::away_warning;

use crate::path::arc::Arc;
use crate::path::{CameraPath, NamedCamera, generated, numbered};
use crate::rig::{Rig, spread};
use crate::{Scene, SceneError, Split, View};
use std::path::PathBuf;
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::PoseError;
use viewfuse_core::sources::MAX_SOURCES;
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_job::text::nearest;

/// Why a selection of views is invalid.
#[derive(Debug, thiserror::Error)]
pub enum SelectionError {
    /// In an item of a list, a step is not a positive whole number.
    #[error("view list '{0}': the step behind '/' must be a whole number of at least 1")]
    BadStep(String),
    /// In an item of a list, a range ends before it starts, or has no start or end.
    #[error("view list '{0}': a range is FIRST..LAST, both ends included and FIRST not after LAST")]
    BadRange(String),
    /// A camera path could not be read.
    #[error(transparent)]
    Path(#[from] SceneError),
    /// It does not fit the scene of this path.
    #[error("{0}: {1}")]
    Scene(String, SelectionFault),
}

/// Why a selection of views does not fit a scene.
#[derive(Debug, thiserror::Error)]
pub enum SelectionFault {
    /// A name in a list is no view of the scene: the names that it may have meant, and the scene's views, in words.
    #[error("has no view '{0}'{1}; its {2}")]
    NoSuchView(String, String, String),
    /// A number in a list is the number that one view's name ends in and another's index, or ends several names: the
    /// names of the views, and the first one's index.
    #[error("'{0}' may be the view {1}: write the name, or the index as '#{2}'")]
    AmbiguousView(String, String, usize),
    /// A source view has no photograph.
    #[error("view '{0}' has no photograph and cannot be a source")]
    NoPhotograph(String),
    /// A view is a target and a source at once.
    #[error("view '{0}' is a target and a source at once")]
    TargetIsSource(String),
    /// There are so many sources, fewer than are needed.
    #[error("too few source views: {0}, at least {1} are needed (a target is never a source)")]
    TooFewSources(usize, usize),
    /// There are so many sources, more than the program supports.
    #[error("{0} source views; at most {MAX_SOURCES} fit")]
    TooManySources(usize),
    /// No target was requested and the scene has no target poses.
    #[error("no targets were chosen, and the scene has no poses without photographs")]
    NoTargets,
    /// A list of views to hold out has none with a photograph.
    #[error("'{0}' names no view with a photograph: nothing would be held out")]
    NothingHeldOut(String),
    /// The cameras do not span an orbit: what was wrong with a camera of it.
    #[error("its cameras span no circle: they stand at, or straight above, what they look at")]
    NoOrbit(PoseError),
    /// The way between two views is no path of cameras: what was wrong with a camera between them.
    #[error("there is no way between '{0}' and '{1}': {2}")]
    NoWay(String, String, PoseError),
    /// The cameras do not look the same way, or are all in one place.
    #[error("its cameras span no spiral, which is for cameras side by side that look the same way")]
    NoSpiral,
    /// Files of two targets would be one file on some systems.
    #[error(
        "targets '{0}' and '{1}' would have the same files where file names ignore case or the forms of \
         accented letters; render them one after the other"
    )]
    AlikeNames(String, String),
    /// A camera of a path has the name of a chosen target.
    #[error("two targets are called '{0}'")]
    SameName(String),
}

impl SelectionFault {
    /// The error of a selection from this scene.
    pub fn in_scene(self, scene: &Scene) -> SelectionError {
        SelectionError::Scene(scene.path.display().to_string(), self)
    }
}

impl Hinted for SelectionError {
    fn hint(&self) -> Option<Hint> {
        match self {
            SelectionError::BadStep(_) | SelectionError::BadRange(_) => Some(Hint::ViewList),
            SelectionError::Path(_) => None,
            SelectionError::Scene(_, fault) => match fault {
                SelectionFault::TargetIsSource(_) => Some(Hint::SourceOrTarget),
                SelectionFault::TooManySources(_) => Some(Hint::FewerSources),
                SelectionFault::NoTargets => Some(Hint::Targets),
                SelectionFault::NoOrbit(_) => Some(Hint::NoOrbit),
                SelectionFault::NoSpiral => Some(Hint::NoSpiral),
                _ => None,
            },
        }
    }
}

/// Names that an error suggests at most.
const MAX_NEAREST: usize = 3;

/// A camera to render, with its truth if the scene has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Name for files and tables.
    pub name: String,
    /// The camera to render from.
    pub camera: Camera,
    /// The view of the scene that shows the truth, as an index into its views.
    pub truth: Option<usize>,
}

/// Sources and targets of one run, as indices into the scene's views.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FewShot {
    /// Source views, in the order of the scene.
    pub sources: Vec<usize>,
    /// Target cameras.
    pub targets: Vec<Target>,
    /// Frames per second, if the targets are from a file that states them.
    pub frames_per_second: Option<f64>,
    /// [`CameraPath::warning`] of the targets.
    pub warning: Option<String>,
}

/// Targets that are cameras along a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PathChoice {
    /// This many cameras on a circle around what the sources look at, on the arc from source to source
    /// ([`Arc::covered`]), named `orbit-000` and so on.
    Orbit(usize),
    /// As an orbit, on the whole circle.
    FullOrbit(usize),
    /// The way from a view to another, both included, named `between-000` and so on.
    Between {
        /// Name of the first view.
        first: String,
        /// Name of the last one.
        last: String,
        /// Number of cameras.
        count: usize,
    },
    /// This many cameras on a spiral in front of what the sources look at, named `spiral-000` and so on.
    Spiral(usize),
    /// The cameras of a file.
    File(PathBuf),
}

/// The requested sources and targets.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// `--targets`.
    pub targets: Option<String>,
    /// Targets that are cameras along a path.
    pub path: Option<PathChoice>,
    /// `--sources`; otherwise every view with a photograph that is not a target, but one of each pose, and none with the
    /// pose of a target that has a photograph.
    pub sources: Option<String>,
    /// `--views`: at most this many of the sources, spread as far apart as possible.
    pub view_count: Option<usize>,
    /// Whether targets are sources, too, where nothing else is left of the views: of a field whose pictures show no
    /// sources.
    pub may_share: bool,
}

impl Selection {
    /// Sources and targets for a render. Without targets and a path, the targets are the scene's target poses.
    ///
    /// # Errors
    /// [`SelectionError`]; `least_sources` is the number that the field requires.
    pub fn resolve(&self, scene: &Scene, least_sources: usize) -> Result<FewShot, SelectionError> {
        let target_views = match &self.targets {
            Some(list) => view_list(scene, list)?,
            None if self.path.is_some() => Vec::new(),
            None => (0..scene.views.len()).filter(|&view| scene.views[view].image.is_none()).collect(),
        };
        let sources = self.sources_without(scene, &target_views, least_sources)?;
        let mut targets: Vec<Target> = target_views.iter().map(|&view| target_of(scene, view)).collect();
        let (mut frames_per_second, mut warning) = (None, None);
        if let Some(choice) = &self.path {
            check_count(scene, sources.len(), 1)?;
            let path = along(choice, scene, &sources)?;
            (frames_per_second, warning) = (path.frames_per_second, path.warning);
            let target = |NamedCamera { name, camera }| Target { name, camera, truth: None };
            targets.extend(path.cameras.into_iter().map(target));
        }
        if targets.is_empty() {
            return Err(SelectionFault::NoTargets.in_scene(scene));
        }
        targets::check_names(scene, &targets)?;
        Ok(FewShot { sources, targets, frames_per_second, warning })
    }

    /// The source views when `targets` are rendered.
    ///
    /// # Errors
    /// [`SelectionError`].
    pub fn sources_without(
        &self,
        scene: &Scene,
        targets: &[usize],
        least_sources: usize,
    ) -> Result<Vec<usize>, SelectionError> {
        let name = |view: &usize| scene.views[*view].name.clone();
        let mut sources = match &self.sources {
            Some(list) => {
                let sources = view_list(scene, list)?;
                if let Some(view) = sources.iter().find(|view| targets.contains(view)) {
                    return Err(SelectionFault::TargetIsSource(name(view)).in_scene(scene));
                }
                if let Some(view) = sources.iter().find(|&&view| scene.views[view].image.is_none()) {
                    return Err(SelectionFault::NoPhotograph(name(view)).in_scene(scene));
                }
                sources
            }
            None => {
                let poses = scene.same_poses();
                let others = poses.sources(0..scene.views.len(), targets);
                if others.is_empty() && self.may_share { poses.sources(0..scene.views.len(), &[]) } else { others }
            }
        };
        if let Some(count) = self.view_count {
            let centres: Vec<_> = sources.iter().map(|&view| scene.views[view].camera.pose.centre_world()).collect();
            sources = spread(&centres, count).into_iter().map(|at| sources[at]).collect();
            sources.sort_unstable();
        }
        check_count(scene, sources.len(), least_sources)?;
        Ok(sources)
    }
}

impl FewShot {
    /// The cameras of the sources.
    pub fn source_cameras(&self, scene: &Scene) -> Vec<Camera> {
        self.sources.iter().map(|&view| scene.views[view].camera).collect()
    }
}

/// Checks a number of sources.
///
/// # Errors
/// [`SelectionFault::TooFewSources`] or [`SelectionFault::TooManySources`].
pub fn check_count(scene: &Scene, count: usize, least: usize) -> Result<(), SelectionError> {
    match count {
        _ if count < least => Err(SelectionFault::TooFewSources(count, least).in_scene(scene)),
        _ if count > MAX_SOURCES => Err(SelectionFault::TooManySources(count).in_scene(scene)),
        _ => Ok(()),
    }
}

/// A view of the scene as a target; its photograph, if it has one, is the truth.
pub fn target_of(scene: &Scene, view: usize) -> Target {
    let View { name, camera, image, .. } = &scene.views[view];
    Target { name: name.clone(), camera: *camera, truth: image.is_some().then_some(view) }
}

/// The view of a name, a number or an index.
fn view_of(scene: &Scene, name: &str) -> Result<usize, SelectionError> {
    let meant = scene.views_meant(name);
    if let [view] = meant[..] {
        return Ok(view);
    }
    if let [first, ..] = meant[..] {
        let views: Vec<String> =
            meant.iter().map(|&view| format!("'{}' (index {view})", scene.views[view].name)).collect();
        return Err(SelectionFault::AmbiguousView(name.to_owned(), views.join(" or "), first).in_scene(scene));
    }
    let names = || scene.views.iter().map(|view| view.name.as_str());
    let near: Vec<String> = nearest(name, names(), MAX_NEAREST).iter().map(|near| format!("'{near}'")).collect();
    let nearest = if near.is_empty() { String::new() } else { format!(", the nearest names are {}", near.join(", ")) };
    let (first, last) = (names().next().unwrap_or_default(), names().next_back().unwrap_or_default());
    let count = scene.views.len();
    let views = format!("{count} views are {first} .. {last}, or by index #0 .. #{}", count.saturating_sub(1));
    Err(SelectionFault::NoSuchView(name.to_owned(), nearest, views).in_scene(scene))
}

/// The views that a list names, in the order of the scene, each once.
///
/// # Errors
/// [`SelectionFault::NoSuchView`], [`SelectionError::BadStep`] or [`SelectionError::BadRange`].
pub fn view_list(scene: &Scene, list: &str) -> Result<Vec<usize>, SelectionError> {
    let find = |name: &str| view_of(scene, name);
    let mut chosen = Vec::new();
    for item in list.split(',').map(str::trim).filter(|item| !item.is_empty()) {
        // A view may be called `a/b`: only an item that is not a name is split.
        if let Some(view) = scene.view_named(item) {
            chosen.push(view);
            continue;
        }
        let (range, step) = match item.rsplit_once('/') {
            Some((range, step)) => {
                let step: usize = step.parse().unwrap_or(0);
                if step == 0 {
                    return Err(SelectionError::BadStep(item.to_owned()));
                }
                (range, step)
            }
            None => (item, 1),
        };
        if range == "all" {
            chosen.extend((0..scene.views.len()).filter(|&view| scene.views[view].image.is_some()).step_by(step));
        } else if let Some(part) = part_named(scene, range) {
            chosen.extend(part.into_iter().step_by(step));
        } else if let Some((first, last)) = range.split_once("..") {
            let bad_range = || SelectionError::BadRange(item.to_owned());
            if first.is_empty() || last.is_empty() {
                return Err(bad_range());
            }
            let (first, last) = (find(first)?, find(last)?);
            if first > last {
                return Err(bad_range());
            }
            chosen.extend((first..=last).step_by(step));
        } else {
            chosen.push(find(range)?);
        }
    }
    chosen.sort_unstable();
    chosen.dedup();
    Ok(chosen)
}

/// A view as an item of a list ([`view_list`]): its name, or its index where a list takes the name for something else.
pub fn item_of(scene: &Scene, view: usize) -> String {
    let name = &scene.views[view].name;
    let is_clear = view_list(scene, name).is_ok_and(|views| views == [view]);
    if is_clear { name.clone() } else { format!("#{view}") }
}

/// The photographs of a split of the scene, if a text names a split that it has.
fn part_named(scene: &Scene, text: &str) -> Option<Vec<usize>> {
    let part: Split = text.parse().ok()?;
    let is_in = |view: &View| view.image.is_some() && view.split == Some(part);
    let views: Vec<usize> = (0..scene.views.len()).filter(|&view| is_in(&scene.views[view])).collect();
    (!views.is_empty()).then_some(views)
}

/// The cameras of a path for these sources.
fn along(choice: &PathChoice, scene: &Scene, sources: &[usize]) -> Result<CameraPath, SelectionError> {
    let cameras: Vec<Camera> = sources.iter().map(|&view| scene.views[view].camera).collect();
    let pinhole = cameras[0].pinhole;
    let (what, cameras) = match choice {
        PathChoice::File(file) => return Ok(CameraPath::open(file, scene, &pinhole)?),
        PathChoice::Orbit(count) | PathChoice::FullOrbit(count) => {
            let is_full = matches!(choice, PathChoice::FullOrbit(_));
            let arc = if is_full { Arc::full(&cameras) } else { Arc::covered(&cameras) };
            let orbit = generated::orbit(&cameras, &arc, pinhole, *count);
            ("orbit", orbit.map_err(|error| SelectionFault::NoOrbit(error).in_scene(scene))?)
        }
        PathChoice::Between { first, last, count } => {
            let [first, last] = [view_of(scene, first)?, view_of(scene, last)?].map(|view| &scene.views[view]);
            let up = Rig::of(&cameras).up;
            let between = generated::between(&first.camera, &last.camera, up, *count);
            let failed = |error| SelectionFault::NoWay(first.name.clone(), last.name.clone(), error).in_scene(scene);
            ("between", between.map_err(failed)?)
        }
        PathChoice::Spiral(count) => {
            let bounds: Vec<[f32; 2]> = sources.iter().filter_map(|&view| scene.views[view].near_far).collect();
            let spiral = generated::spiral(&cameras, pinhole, &bounds, *count);
            ("spiral", spiral.ok_or_else(|| SelectionFault::NoSpiral.in_scene(scene))?)
        }
    };
    let named = |(index, camera)| NamedCamera { name: numbered(what, index), camera };
    let cameras = cameras.into_iter().enumerate().map(named).collect();
    Ok(CameraPath { cameras, frames_per_second: None, warning: None })
}
