//! Benchmarks of few-shot papers: which views of a scene each takes, at which size, and how it is scored.
//!
//! | name | sources | targets | longest side | metric |
//! |---|---|---|---|---|
//! | `llff:K` | K evenly spaced among the other views | every 8th view, the first included | 504 | full |
//! | `dtu:K` | the first K of 25, 22, 28, 40, 44, 48, 0, 8, 13 | 25 named ones of the 49 views | 400 | full and masked |
//! | `blender:8` | 8 named views of the training split | every 8th view of the test split | 400 | full |
//!
//! `llff` is the protocol of RegNeRF and its successors on LLFF: `numpy.linspace(0, n - 1, K)` over the n other views,
//! rounded half to even. `dtu` is pixelNeRF's split, whose order RegNeRF fixed, without the 15 views of wrong exposure.
//! `blender` is that of DietNeRF and FreeNeRF.
//!
//! Every 8th view is counted in the order of the published loaders, which sort the photographs' paths character by
//! character (`1, 10, 11, 2`), whatever the layout: NeRF's and RegNeRF's by `sorted(os.listdir(..))`, 3DGS's by the
//! images' names, nerfstudio's by `file_path`. DTU's numbers are those of its camera positions, Blender's those of the
//! frames in their file: there the order is the reader's.
//!
//! A benchmark's views have numbers. In a scene with all of the benchmark's views, the number is the position;
//! otherwise it is the number at the end of the view's name.

use super::{ascending, photographed};
use std::fmt;
use viewfuse_scene::dataset::Split;
use viewfuse_scene::{Scene, View};

/// A benchmark of few-shot papers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Benchmark {
    /// Forward-facing photographs by hand.
    Llff,
    /// Objects on a table, photographed by a robot.
    Dtu,
    /// Objects made with Blender (NeRF-synthetic).
    Blender,
}

/// Every view with an index divisible by this is a target.
const EVERY: usize = 8;
/// Sources of DTU in the order in which more are added.
const DTU_SOURCES: [usize; 9] = [25, 22, 28, 40, 44, 48, 0, 8, 13];
/// Targets of DTU: no source, and none of the 15 views of wrong exposure.
const DTU_TARGETS: [usize; 25] =
    [1, 2, 9, 10, 11, 12, 14, 15, 23, 24, 26, 27, 29, 30, 31, 32, 33, 34, 35, 41, 42, 43, 45, 46, 47];
/// Views of a scene of DTU.
const DTU_VIEWS: usize = 49;
/// Sources of NeRF-synthetic.
const BLENDER_SOURCES: [usize; 8] = [26, 86, 2, 55, 75, 93, 16, 73];
/// Views of its training split.
const BLENDER_VIEWS: usize = 100;
/// Views of its test split.
const BLENDER_TEST_VIEWS: usize = 200;

/// Sources and targets as indices into a scene's views.
pub(super) type Chosen = (Vec<usize>, Vec<usize>);

impl Benchmark {
    /// All of them.
    pub const ALL: [Benchmark; 3] = [Benchmark::Llff, Benchmark::Dtu, Benchmark::Blender];

    /// Its name in protocols.
    pub const fn name(self) -> &'static str {
        match self {
            Benchmark::Llff => "llff",
            Benchmark::Dtu => "dtu",
            Benchmark::Blender => "blender",
        }
    }

    /// Its name in papers.
    pub const fn title(self) -> &'static str {
        match self {
            Benchmark::Llff => "LLFF",
            Benchmark::Dtu => "DTU",
            Benchmark::Blender => "NeRF-synthetic",
        }
    }

    /// Fewest and most sources that it is defined for.
    pub(super) const fn source_range(self) -> [usize; 2] {
        match self {
            Benchmark::Llff => [1, viewfuse_weighting::sources::MAX_SOURCES],
            Benchmark::Dtu => [1, DTU_SOURCES.len()],
            Benchmark::Blender => [BLENDER_SOURCES.len(), BLENDER_SOURCES.len()],
        }
    }

    /// Width and height of the pictures that papers score.
    pub const fn published_size(self) -> [u32; 2] {
        match self {
            Benchmark::Llff => [504, 378],
            Benchmark::Dtu => [400, 300],
            Benchmark::Blender => [400, 400],
        }
    }

    /// Whether papers score by the truth's mask.
    pub const fn is_masked(self) -> bool {
        matches!(self, Benchmark::Dtu)
    }

    /// The scenes that published means are over.
    pub const fn scenes(self) -> &'static [&'static str] {
        match self {
            Benchmark::Llff => &["fern", "flower", "fortress", "horns", "leaves", "orchids", "room", "trex"],
            Benchmark::Dtu => &[
                "scan8", "scan21", "scan30", "scan31", "scan34", "scan38", "scan40", "scan41", "scan45", "scan55",
                "scan63", "scan82", "scan103", "scan110", "scan114",
            ],
            Benchmark::Blender => &["chair", "drums", "ficus", "hotdog", "lego", "materials", "mic", "ship"],
        }
    }

    /// Whether a scene of this name is one of [`Benchmark::scenes`]: the name contains that scene's name as a whole
    /// word.
    pub fn has_scene(self, name: &str) -> bool {
        let name = name.to_ascii_lowercase();
        let mut words = name.split(|letter: char| !letter.is_ascii_alphanumeric());
        words.any(|word| self.scenes().contains(&word))
    }

    /// How many targets a scene has; `None` where that follows from its photographs.
    pub(super) const fn target_count(self) -> Option<usize> {
        match self {
            Benchmark::Llff => None,
            Benchmark::Dtu => Some(DTU_TARGETS.len()),
            Benchmark::Blender => Some(BLENDER_TEST_VIEWS.div_ceil(EVERY)),
        }
    }

    /// The benchmark's views of a scene for this many sources; otherwise what the scene lacks, in words.
    pub(super) fn choose(self, scene: &Scene, source_count: usize) -> Result<Chosen, String> {
        match self {
            Benchmark::Llff => {
                let (sources, targets) = evenly(&by_character(scene), source_count)?;
                Ok((ascending(&sources), targets))
            }
            Benchmark::Dtu => {
                let views: Vec<usize> = photographed(scene).collect();
                let sources = numbered(scene, &views, DTU_VIEWS, &DTU_SOURCES[..source_count]);
                let targets = numbered(scene, &views, DTU_VIEWS, &DTU_TARGETS);
                Ok((all_of(sources, "source view")?, some_of(targets)?))
            }
            Benchmark::Blender => {
                let [train, test] = [Split::Train, Split::Test].map(|split| of_split(scene, split));
                if train.is_empty() || test.is_empty() {
                    let missing = match (train.is_empty(), test.is_empty()) {
                        (true, true) => "views of a training split and of a test split",
                        (true, false) => "views of a training split",
                        _ => "views of a test split",
                    };
                    return Err(format!("has no {missing} (transforms_train.json and transforms_test.json)"));
                }
                let sources = numbered(scene, &train, BLENDER_VIEWS, &BLENDER_SOURCES[..source_count]);
                let every: Vec<usize> = (0..BLENDER_TEST_VIEWS).step_by(EVERY).collect();
                let targets = numbered(scene, &test, BLENDER_TEST_VIEWS, &every);
                Ok((all_of(sources, "view of the training split")?, some_of(targets)?))
            }
        }
    }
}

impl fmt::Display for Benchmark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The views with a photograph, sorted by its path character by character.
fn by_character(scene: &Scene) -> Vec<usize> {
    let path = |view: &usize| scene.views[*view].image.as_deref().map(|path| path.as_os_str().as_encoded_bytes());
    let mut views: Vec<usize> = photographed(scene).collect();
    views.sort_by(|a, b| path(a).cmp(&path(b)));
    views
}

/// Every eighth view as a target, and of the others this many that are evenly spaced.
fn evenly(views: &[usize], source_count: usize) -> Result<Chosen, String> {
    let is_target = |place: usize| place.is_multiple_of(EVERY);
    let views_where = |wanted: bool| {
        let places = views.iter().enumerate().filter(move |(place, _)| is_target(*place) == wanted);
        places.map(|(_, view)| *view).collect::<Vec<usize>>()
    };
    let (targets, others) = (views_where(true), views_where(false));
    if others.len() < source_count {
        return Err(format!(
            "{} photographs, of which every {EVERY}th is a target, leave {} sources; {source_count} are needed",
            views.len(),
            others.len()
        ));
    }
    Ok((evenly_spaced(others.len(), source_count).into_iter().map(|place| others[place]).collect(), targets))
}

/// `numpy.linspace(0, length - 1, count)` rounded half to even. `count` must be at most `length`, so that no index
/// occurs twice.
fn evenly_spaced(length: usize, count: usize) -> Vec<usize> {
    let last = length.saturating_sub(1);
    let step = last as f64 / count.saturating_sub(1).max(1) as f64;
    (0..count).map(|place| (place as f64 * step).round_ties_even() as usize).map(|place| place.min(last)).collect()
}

/// The views with a photograph in a split.
fn of_split(scene: &Scene, split: Split) -> Vec<usize> {
    photographed(scene).filter(|&view| scene.views[view].split == Some(split)).collect()
}

/// The views with these numbers; `whole` is how many the benchmark has. A number that the scene lacks is an error.
fn numbered(scene: &Scene, views: &[usize], whole: usize, numbers: &[usize]) -> Vec<Result<usize, usize>> {
    let named = |number: usize| {
        let mut found = views.iter().copied().filter(|&view| number_of(&scene.views[view]) == Some(number));
        // Two views with the same number: ambiguous.
        found.next().filter(|_| found.next().is_none())
    };
    let find = |&number: &usize| {
        let view = if views.len() == whole { views.get(number).copied() } else { named(number) };
        view.ok_or(number)
    };
    numbers.iter().map(find).collect()
}

/// The number that a view's name ends in.
fn number_of(view: &View) -> Option<usize> {
    let letters = view.name.trim_end_matches(|letter: char| letter.is_ascii_digit());
    view.name[letters.len()..].parse().ok()
}

/// Every view, ascending, or which are missing.
fn all_of(found: Vec<Result<usize, usize>>, what: &str) -> Result<Vec<usize>, String> {
    let missing: Vec<String> = found.iter().filter_map(|view| view.err()).map(|number| number.to_string()).collect();
    if !missing.is_empty() {
        return Err(format!("has no {what} {}", missing.join(", ")));
    }
    let mut views: Vec<usize> = found.into_iter().flatten().collect();
    views.sort_unstable();
    Ok(views)
}

/// The views that exist.
fn some_of(found: Vec<Result<usize, usize>>) -> Result<Vec<usize>, String> {
    let views: Vec<usize> = found.into_iter().flatten().collect();
    if views.is_empty() { Err("has none of the target views".to_owned()) } else { Ok(views) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spaces_are_those_of_numpy() {
        // numpy.linspace(0, n - 1, k) rounded by numpy.round.
        assert_eq!(evenly_spaced(17, 3), [0, 8, 16]);
        assert_eq!(evenly_spaced(17, 6), [0, 3, 6, 10, 13, 16]);
        assert_eq!(evenly_spaced(17, 9), [0, 2, 4, 6, 8, 10, 12, 14, 16]);
        // Halves go to the even neighbour: 0, 2.5, 5, 7.5, 10.
        assert_eq!(evenly_spaced(11, 5), [0, 2, 5, 8, 10]);
        assert_eq!(evenly_spaced(4, 4), [0, 1, 2, 3]);
        assert_eq!((evenly_spaced(5, 1), evenly_spaced(1, 1)), (vec![0], vec![0]));
    }

    #[test]
    fn ferns_views_are_the_papers() {
        let views: Vec<usize> = (0..20).collect();
        assert_eq!(evenly(&views, 3), Ok((vec![1, 10, 19], vec![0, 8, 16])));
        let error = evenly(&views[..5], 6).expect_err("four are left");
        assert_eq!(error, "5 photographs, of which every 8th is a target, leave 4 sources; 6 are needed");
    }

    #[test]
    fn dtus_sources_are_no_targets() {
        assert!(DTU_SOURCES.iter().all(|source| !DTU_TARGETS.contains(source)));
        assert!(DTU_TARGETS.is_sorted() && DTU_TARGETS.iter().chain(&DTU_SOURCES).all(|view| *view < DTU_VIEWS));
    }

    #[test]
    fn scenes_are_known_by_whole_words() {
        assert!(Benchmark::Llff.has_scene("fern") && Benchmark::Llff.has_scene("nerf_llff-fern"));
        assert!(!Benchmark::Llff.has_scene("ferns") && !Benchmark::Dtu.has_scene("dtu_scan65"));
        assert!(Benchmark::Dtu.has_scene("dtu_Scan8") && !Benchmark::Dtu.has_scene("scan80"));
    }
}
