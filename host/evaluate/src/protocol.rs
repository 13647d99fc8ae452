//! Evaluation protocols: which views of a scene are sources and which are targets, so that tables can be compared.
//!
//! ```text
//! random   sources and targets drawn from all photographs (the paper's first table)
//! close    five sources, exactly one of them near the target (its second table)
//! count    2, 8, 16, 32 sources, each set within the next, the same targets (its figures)
//! fixed    the view lists that were published, or a person's own
//! ```
//!
//! What is drawn hangs on the seed, the scene's name and the number of the trial, and on nothing else: not on which
//! machine takes which job, nor on the order of the scenes. `random` and `count` of one seed draw the same targets.

mod draw;
mod name;

pub use name::ProtocolError;

use draw::Draw;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{SelectionError, view_list};
use viewfuse_scene::rig::Rig;
use viewfuse_weighting::sources::MOST_SOURCES;

/// Sources of `random` unless a person says otherwise.
pub const RANDOM_SOURCES: usize = 3;
/// Sources of `close` unless a person says otherwise: the paper's.
pub const CLOSE_SOURCES: usize = 5;
/// What counts as near for `close` unless a person says otherwise, in degrees: the paper's.
pub const CLOSE_DEGREES: f32 = 10.0;
/// Numbers of sources of `count` unless a person says otherwise: the paper's.
pub const COUNTS: [usize; 4] = [2, 8, 16, 32];

/// How sources and targets are chosen. As text: `NAME` or `NAME:KEY=VALUE[,KEY=VALUE]`, of `fixed` `fixed:LIST` or
/// `fixed:SOURCES:TARGETS`.
#[derive(Clone, Debug, PartialEq)]
pub enum Protocol {
    /// So many sources; they and the targets are drawn from all photographs.
    Random {
        /// How many sources.
        sources: usize,
    },
    /// Each target has its own sources, of which exactly one is near: seen from what the cameras look at, it stands less
    /// than this angle away. All others stand farther.
    Close {
        /// How many sources, the near one included.
        sources: usize,
        /// What is near, in degrees.
        degrees: f32,
    },
    /// Several numbers of sources for the same targets; of fewer sources all are among those of more.
    Count {
        /// The numbers, ascending.
        sources: Vec<usize>,
    },
    /// The same views of every scene, as lists that [`view_list`] reads. A source is never a target.
    Fixed {
        /// Which views are sources.
        sources: String,
        /// Which are targets.
        targets: String,
    },
}

/// How much is drawn, and from which seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Draws {
    /// Seed of all draws.
    pub seed: u64,
    /// How many times sources and targets are drawn for every scene; `fixed` draws nothing and has one trial.
    pub trial_count: u32,
    /// Targets of a trial; `fixed` takes those that its list says.
    pub target_count: usize,
}

/// A set of sources with the targets that are rendered from it: what one device does in one go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Job {
    /// Which of the scenes.
    pub scene: usize,
    /// Which draw.
    pub trial: u32,
    /// Source views, ascending.
    pub sources: Vec<usize>,
    /// Target views in the order in which they were drawn; never sources.
    pub targets: Vec<usize>,
}

/// All jobs of an evaluation, in an order that only the scenes' order and the protocol decide.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// The jobs; a job's number is its place.
    pub jobs: Vec<Job>,
    /// What the protocol wanted of a scene and the scene has not, a line each.
    pub notes: Vec<String>,
}

impl Protocol {
    /// The jobs on these scenes. `least_sources` is what the field needs.
    ///
    /// A scene with too few photographs for a number of sources beside the targets is left out for that number, with a note.
    /// So is, for [`Protocol::Close`], a view that no other is near to, or that fewer are far from than sources are wanted;
    /// other views are targets then.
    ///
    /// # Errors
    /// [`ProtocolError`] if no job is left or the field needs more sources; [`SelectionError`] of a list that does not fit
    /// a scene.
    pub fn plan(&self, scenes: &[Scene], draws: Draws, least_sources: usize) -> Result<Plan, ProtocolError> {
        let fewest = match self {
            Protocol::Random { sources } | Protocol::Close { sources, .. } => *sources,
            Protocol::Count { sources } => sources.first().copied().unwrap_or(0),
            Protocol::Fixed { .. } => least_sources,
        };
        if fewest < least_sources {
            return Err(ProtocolError::FewSources { protocol: self.to_string(), least_sources });
        }
        let mut plan = Plan::default();
        for (index, scene) in scenes.iter().enumerate() {
            let trials = if matches!(self, Protocol::Fixed { .. }) { 1 } else { draws.trial_count };
            for trial in 0..trials {
                let draw = Draw::of(draws.seed, &scene.name(), trial);
                let mut add = |sources: Vec<usize>, targets: Vec<usize>| {
                    plan.jobs.push(Job { scene: index, trial, sources, targets });
                };
                let notes = match self {
                    Protocol::Random { sources } => counted(scene, &draw, &[*sources], draws.target_count, &mut add),
                    Protocol::Count { sources } => counted(scene, &draw, sources, draws.target_count, &mut add),
                    Protocol::Close { sources, degrees } => {
                        close(scene, &draw, *sources, *degrees, draws.target_count, &mut add)
                    }
                    Protocol::Fixed { sources, targets } => {
                        let (sources, targets) = fixed(scene, sources, targets, least_sources)?;
                        add(sources, targets);
                        Vec::new()
                    }
                };
                // What a scene has not is the same in every trial.
                plan.notes.extend(notes.into_iter().filter(|_| trial == 0));
            }
        }
        match plan.jobs.is_empty() {
            true => Err(ProtocolError::NoJobs { protocol: self.to_string(), notes: plan.notes.join("; ") }),
            false => Ok(plan),
        }
    }
}

/// The first views of the order are the targets, those behind them the sources: a smaller set is the beginning of a larger.
fn counted(
    scene: &Scene,
    draw: &Draw,
    counts: &[usize],
    target_count: usize,
    add: &mut impl FnMut(Vec<usize>, Vec<usize>),
) -> Vec<String> {
    let order = draw.order(photographed(scene));
    let mut notes = Vec::new();
    for &count in counts {
        if order.len() < target_count + count {
            let (has, wanted) = (order.len(), target_count + count);
            notes.push(format!("{}: {has} photographs, {wanted} are needed for {count} sources", scene.name()));
            continue;
        }
        let (targets, rest) = order.split_at(target_count);
        add(ascending(&rest[..count]), targets.to_vec());
    }
    notes
}

/// Each target is a job: its sources are its own.
fn close(
    scene: &Scene,
    draw: &Draw,
    source_count: usize,
    degrees: f32,
    target_count: usize,
    add: &mut impl FnMut(Vec<usize>, Vec<usize>),
) -> Vec<String> {
    let views: Vec<usize> = photographed(scene).collect();
    let cameras: Vec<Camera> = views.iter().map(|&view| scene.views[view].camera).collect();
    let focus = Rig::of(&cameras).focus;
    let from_focus = |view: usize| scene.views[view].camera.pose.centre_world() - focus;
    let is_near = |a: usize, b: usize| angle(from_focus(a), from_focus(b)).to_degrees() < f64::from(degrees);
    let neighbours = |target: usize| -> (Vec<usize>, Vec<usize>) {
        views.iter().copied().filter(|&view| view != target).partition(|&view| is_near(view, target))
    };
    let fits = |target: &usize| {
        let (near, far) = neighbours(*target);
        !near.is_empty() && far.len() + 1 >= source_count
    };
    let (fitting, others): (Vec<usize>, Vec<usize>) = views.iter().copied().partition(fits);
    for target in draw.order(fitting.iter().copied()).into_iter().take(target_count) {
        let (near, far) = neighbours(target);
        let own = draw.of_view(target);
        let (near, far) = (own.order(near), own.order(far));
        let sources: Vec<usize> = near.into_iter().take(1).chain(far.into_iter().take(source_count - 1)).collect();
        add(ascending(&sources), vec![target]);
    }
    let scene_name = scene.name();
    let mut notes = Vec::new();
    if !others.is_empty() {
        let (count, all, far) = (others.len(), views.len(), source_count - 1);
        notes.push(format!(
            "{scene_name}: {count} of {all} views are no targets: they lack a view within {degrees} degrees, or {far} beyond"
        ));
    }
    if !fitting.is_empty() && fitting.len() < target_count {
        notes.push(format!("{scene_name}: {} targets instead of {target_count}", fitting.len()));
    }
    notes
}

fn fixed(
    scene: &Scene,
    sources: &str,
    targets: &str,
    least_sources: usize,
) -> Result<(Vec<usize>, Vec<usize>), SelectionError> {
    let scene_name = || scene.path.display().to_string();
    let (sources, mut targets) = (view_list(scene, sources)?, view_list(scene, targets)?);
    targets.retain(|target| !sources.contains(target));
    if let Some(&view) = sources.iter().chain(&targets).find(|&&view| scene.views[view].image.is_none()) {
        return Err(SelectionError::NoPhotograph { scene: scene_name(), name: scene.views[view].name.clone() });
    }
    let count = sources.len();
    if count < least_sources {
        return Err(SelectionError::TooFewSources { scene: scene_name(), count, least: least_sources });
    }
    if count > MOST_SOURCES {
        return Err(SelectionError::TooManySources { scene: scene_name(), count });
    }
    if targets.is_empty() {
        return Err(SelectionError::NoTargets { scene: scene_name() });
    }
    Ok((sources, targets))
}

fn photographed(scene: &Scene) -> impl Iterator<Item = usize> {
    scene.views.iter().enumerate().filter(|(_, view)| view.image.is_some()).map(|(index, _)| index)
}

fn ascending(views: &[usize]) -> Vec<usize> {
    let mut views = views.to_vec();
    views.sort_unstable();
    views
}

/// The angle between two directions in radians, exact at 0 and pi; of a zero vector 0.
pub fn angle(a: Vec3, b: Vec3) -> f64 {
    let (a, b) = (a.as_dvec3(), b.as_dvec3());
    a.cross(b).length().atan2(a.dot(b))
}
