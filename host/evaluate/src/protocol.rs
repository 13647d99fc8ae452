//! Evaluation protocols: which views of a scene are sources and which are targets, so that tables can be compared.
//!
//! ```text
//! random               sources and targets drawn from all photographs (the paper's first table)
//! close                five sources, exactly one of them near the target (its second table)
//! count                2, 8, 16, 32 sources, each set within the next, the same targets (its figures)
//! fixed                the view lists that were published, or the user's own
//! nearest              each target from the views nearest to it
//! llff, dtu, blender   the benchmarks of few-shot papers
//! ```
//!
//! Draws depend only on the seed, the scene's name and the number of the trial: not on which machine runs which job,
//! nor on the order of the scenes. `random` and `count` of one seed draw the same targets.

mod benchmark;
mod draw;
mod drawn;
mod listed;
mod name;
mod published;

pub use benchmark::Benchmark;
pub use name::ProtocolError;
pub use published::{Figure, Published};

use draw::Draw;
use drawn::{close, counted};
use listed::{Listed, fixed, nearest};
use viewfuse_core::Vec3;
use viewfuse_scene::Scene;
use viewfuse_scene::photographs::reduced_size;

/// Default number of sources of `random`.
pub const RANDOM_SOURCES: usize = 3;
/// Default number of sources of `close`: the paper's.
pub const CLOSE_SOURCES: usize = 5;
/// Default angle below which a source is near for `close`, in degrees: the paper's.
pub const CLOSE_DEGREES: f32 = 10.0;
/// Default numbers of sources of `count`: the paper's.
pub const COUNTS: [usize; 4] = [2, 8, 16, 32];

/// How sources and targets are chosen. As text: `NAME` or `NAME:KEY=VALUE[,KEY=VALUE]`, of `fixed` `fixed:LIST` or
/// `fixed:SOURCES:TARGETS`, of `nearest` `nearest:K` or `nearest:K:TARGETS`, of a benchmark `NAME:K`, of one with masks
/// also `NAME:K,masks=given`.
#[derive(Clone, Debug, PartialEq)]
pub enum Protocol {
    /// This many sources; sources and targets are drawn from all photographs.
    Random {
        /// How many sources.
        sources: usize,
    },
    /// Each target has its own sources, of which exactly one is near: seen from the rig's focus, its angle to the
    /// target is below this. The angles of all others are larger.
    Close {
        /// How many sources, the near one included.
        sources: usize,
        /// The largest angle of a near source, in degrees.
        degrees: f32,
    },
    /// Several numbers of sources for the same targets; a smaller set is part of each larger one.
    Count {
        /// The numbers, ascending.
        sources: Vec<usize>,
    },
    /// The same views of every scene, as lists that [`view_list`](viewfuse_scene::few_shot::view_list) reads. A source
    /// is never a target.
    Fixed {
        /// Which views are sources.
        sources: String,
        /// Which are targets.
        targets: String,
    },
    /// Each target has its own sources: the other views whose cameras are nearest to its own.
    Nearest {
        /// How many sources.
        sources: usize,
        /// Which views are targets, as a list of the same kind; otherwise each view with a photograph.
        targets: Option<String>,
    },
    /// The views, the size and the metric of a benchmark.
    Benchmark {
        /// Which.
        benchmark: Benchmark,
        /// How many sources.
        sources: usize,
        /// Whether fields are given the photographs' masks. The papers' methods are not: there, only the metric uses
        /// the truth's mask.
        masks_given: bool,
    },
}

/// The number of draws, and their seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Draws {
    /// Seed of all draws.
    pub seed: u64,
    /// How many times sources and targets are drawn for every scene. Protocols that draw nothing have one trial.
    pub trial_count: u32,
    /// Targets of a trial. Protocols that draw nothing define their targets themselves.
    pub target_count: usize,
}

/// A set of sources with the targets that are rendered from it: the unit of work of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Job {
    /// Index of the scene.
    pub scene: usize,
    /// Number of the trial.
    pub trial: u32,
    /// Source views, ascending.
    pub sources: Vec<usize>,
    /// Target views in the order in which they were drawn; never sources.
    pub targets: Vec<usize>,
}

/// All jobs of an evaluation, in an order that depends only on the scenes' order and the protocol.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// The jobs; a job's number is its place.
    pub jobs: Vec<Job>,
    /// What the protocol requires and a scene lacks, a line each.
    pub notes: Vec<String>,
}

impl Protocol {
    /// The jobs on these scenes. `least_sources` is the least number that the field requires.
    ///
    /// A scene with too few photographs for a number of sources and the targets is skipped for that number, with a
    /// note. [`Protocol::Close`] also skips a view as a target if no other view is near it, or too few views are far
    /// from it; other views replace it.
    ///
    /// # Errors
    /// [`ProtocolError`] if no job is left or the field needs more sources;
    /// [`viewfuse_scene::few_shot::SelectionError`] for a list that does not fit a scene.
    pub fn plan(&self, scenes: &[Scene], draws: Draws, least_sources: usize) -> Result<Plan, ProtocolError> {
        let fewest = match self {
            Protocol::Random { sources }
            | Protocol::Close { sources, .. }
            | Protocol::Nearest { sources, .. }
            | Protocol::Benchmark { sources, .. } => *sources,
            Protocol::Count { sources } => sources.first().copied().unwrap_or(0),
            Protocol::Fixed { .. } => least_sources,
        };
        if fewest < least_sources {
            return Err(ProtocolError::FewSources { protocol: self.to_string(), least_sources });
        }
        let mut plan = Plan::default();
        for (index, scene) in scenes.iter().enumerate() {
            let trials = if self.draws() { draws.trial_count } else { 1 };
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
                        let Listed { sources, targets, notes } = fixed(scene, sources, targets, least_sources)?;
                        add(sources, targets);
                        notes
                    }
                    Protocol::Nearest { sources, targets } => near(scene, *sources, targets.as_deref(), &mut add)?,
                    Protocol::Benchmark { benchmark, sources, .. } => match benchmark.choose(scene, *sources) {
                        Ok((sources, targets)) => {
                            let notes = of_one_pose(scene, &sources, &targets);
                            add(sources, targets);
                            notes
                        }
                        Err(lack) => vec![format!("{} {lack}", scene.name())],
                    },
                };
                // What a scene lacks is the same in every trial.
                plan.notes.extend(notes.into_iter().filter(|_| trial == 0));
            }
        }
        match plan.jobs.is_empty() {
            true => Err(ProtocolError::NoJobs { protocol: self.to_string(), notes: plan.notes.join("; ") }),
            false => Ok(plan),
        }
    }

    /// Whether sources or targets are drawn: the seed and the number of trials matter.
    pub fn draws(&self) -> bool {
        matches!(self, Protocol::Random { .. } | Protocol::Close { .. } | Protocol::Count { .. })
    }

    /// Whether each number of sources has a table of its own.
    pub fn has_table_a_count(&self) -> bool {
        matches!(self, Protocol::Count { .. })
    }

    /// Whether targets are scored by their masks as well.
    pub fn is_masked(&self) -> bool {
        matches!(self, Protocol::Benchmark { benchmark, .. } if benchmark.is_masked())
    }

    /// Whether the photographs' masks are withheld from the field.
    pub fn hides_masks(&self) -> bool {
        matches!(self, Protocol::Benchmark { benchmark, masks_given: false, .. } if benchmark.is_masked())
    }

    /// The size of a scene's pictures that the protocol requires: that of its first view, scaled to the smaller of the
    /// benchmark's longest side and `longest`, the field's limit; never larger than the photograph. `None` for
    /// protocols that leave the size open.
    pub fn picture_size(&self, scene: &Scene, longest: u32) -> Option<[u32; 2]> {
        let Protocol::Benchmark { benchmark, .. } = self else { return None };
        let side = benchmark.published_size().into_iter().max()?.min(longest);
        scene.views.first().map(|view| reduced_size(&view.camera, side).into())
    }

    /// A description of the metric, for records.
    pub fn metric_words(&self) -> &'static str {
        match (self.is_masked(), self.hides_masks()) {
            (false, _) => "full: prediction and photograph over the run's background",
            (true, true) => {
                "full: prediction and whole photograph; masked: both over white by the truth's mask; fields are given \
                    no masks"
            }
            (true, false) => {
                "full: prediction and photograph over the run's background; masked: both over white by the truth's \
                 mask; fields are given the sources' masks"
            }
        }
    }
}

/// A note of the targets of a published list that have the pose of one of its sources.
fn of_one_pose(scene: &Scene, sources: &[usize], targets: &[usize]) -> Vec<String> {
    let poses = scene.same_poses();
    let of_source = |target: &usize| poses.with_pose_of(sources, *target).map(|source| (*target, source));
    let same: Vec<(usize, usize)> = targets.iter().filter_map(of_source).collect();
    let Some((target, source)) = same.first() else { return Vec::new() };
    let name = |view: &usize| &scene.views[*view].name;
    vec![format!(
        "{}: {} of the benchmark's targets have the pose of a source (the first is {}, with {}): their scores are too \
         high",
        scene.name(),
        same.len(),
        name(target),
        name(source)
    )]
}

/// Each target is a job: its sources are its own.
fn near(
    scene: &Scene,
    source_count: usize,
    targets: Option<&str>,
    add: &mut impl FnMut(Vec<usize>, Vec<usize>),
) -> Result<Vec<String>, ProtocolError> {
    let count = scene.same_poses().sources(photographed(scene), &[]).len();
    if count <= source_count {
        return Ok(vec![format!(
            "{}: {count} photographs, {} are needed for {source_count} sources",
            scene.name(),
            source_count + 1
        )]);
    }
    nearest(scene, source_count, targets)?.into_iter().for_each(|(sources, target)| add(sources, vec![target]));
    Ok(Vec::new())
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
