//! Protocols as text, and the view lists that were published.

use super::{Benchmark, CLOSE_DEGREES, CLOSE_SOURCES, COUNTS, Protocol, RANDOM_SOURCES};
use std::fmt;
use std::str::FromStr;
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_scene::few_shot::SelectionError;
use viewfuse_weighting::sources::MAX_SOURCES;

const GRAMMAR: &str = "random[:sources=N], close[:sources=N,degrees=D], count[:sources=N+N+...], \
     fixed[:cars|chairs|pixelnerf-1|pixelnerf-2], fixed:SOURCES:TARGETS, nearest:K[:TARGETS], llff:K (3, 6, 9), \
     dtu:K[,masks=given] (3, 6, 9), blender:8";

/// Lists of views by name, sources and targets. `cars` and `chairs` are those of the paper's published evaluation
/// scripts for SRN's test scenes; `pixelnerf-1` and `pixelnerf-2` are those of pixelNeRF's (one and two sources, all
/// other views).
const PUBLISHED: [(&str, &str, &str); 4] = [
    ("cars", "56,58,67,75,91,113,241,244", "40,44,54,149,159,173,181,245"),
    ("chairs", "5,8,14", "3,10,18"),
    ("pixelnerf-1", "64", "all"),
    ("pixelnerf-2", "64,104", "all"),
];

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum ProtocolError {
    /// No protocol has this name.
    #[error("unknown protocol '{text}'; there are: {GRAMMAR}")]
    Unknown {
        /// The given text.
        text: String,
    },
    /// A protocol's value is not usable.
    #[error("protocol '{protocol}': {key} must be {wanted}, not '{value}'")]
    BadValue {
        /// The protocol.
        protocol: String,
        /// The key.
        key: &'static str,
        /// The expected value.
        wanted: String,
        /// The given text.
        value: String,
    },
    /// The field needs more sources than the protocol has.
    #[error("protocol '{protocol}' has too few sources: the field needs at least {least_sources}")]
    FewSources {
        /// The protocol.
        protocol: String,
        /// The field's least number of sources.
        least_sources: usize,
    },
    /// No scene meets the protocol's requirements.
    #[error("protocol '{protocol}' fits none of the scenes: {notes}")]
    NoJobs {
        /// The protocol.
        protocol: String,
        /// What the scenes lack.
        notes: String,
    },
    /// A value is given twice.
    #[error("protocol '{protocol}': {key} is given twice")]
    Repeated {
        /// The protocol.
        protocol: String,
        /// The value's name.
        key: String,
    },
    /// The lists do not fit a scene.
    #[error(transparent)]
    Selection(#[from] SelectionError),
}

impl Hinted for ProtocolError {
    /// Of a selection only what is wrong with a list: the views of a protocol are not those of options.
    fn hint(&self) -> Option<Hint> {
        match self {
            ProtocolError::Selection(error) => error.hint().filter(|hint| *hint == Hint::ViewList),
            _ => None,
        }
    }
}

impl fmt::Display for Protocol {
    /// In the form that is parsed, with every value.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Protocol::Random { sources } => write!(f, "random:sources={sources}"),
            Protocol::Close { sources, degrees } => write!(f, "close:sources={sources},degrees={degrees}"),
            Protocol::Count { sources } => {
                let counts: Vec<String> = sources.iter().map(usize::to_string).collect();
                write!(f, "count:sources={}", counts.join("+"))
            }
            Protocol::Fixed { sources, targets } => {
                match PUBLISHED
                    .iter()
                    .find(|(_, own_sources, own_targets)| own_sources == sources && own_targets == targets)
                {
                    Some((name, ..)) => write!(f, "fixed:{name}"),
                    None => write!(f, "fixed:{sources}:{targets}"),
                }
            }
            Protocol::Nearest { sources, targets: None } => write!(f, "nearest:{sources}"),
            Protocol::Nearest { sources, targets: Some(targets) } => write!(f, "nearest:{sources}:{targets}"),
            Protocol::Benchmark { benchmark, sources, masks_given } => {
                write!(f, "{benchmark}:{sources}{}", if *masks_given { ",masks=given" } else { "" })
            }
        }
    }
}

impl FromStr for Protocol {
    type Err = ProtocolError;

    fn from_str(text: &str) -> Result<Protocol, ProtocolError> {
        let unknown = || ProtocolError::Unknown { text: text.to_owned() };
        let (name, rest) = text.split_once(':').unwrap_or((text, ""));
        if name == "fixed" {
            let named = |name: &str| PUBLISHED.iter().find(|(row, ..)| *row == name);
            let (sources, targets) = match (rest.split_once(':'), named(if rest.is_empty() { "cars" } else { rest })) {
                (Some((sources, targets)), _) if !sources.is_empty() && !targets.is_empty() => (sources, targets),
                (None, Some((_, sources, targets))) => (*sources, *targets),
                _ => return Err(unknown()),
            };
            return Ok(Protocol::Fixed { sources: sources.to_owned(), targets: targets.to_owned() });
        }
        if name == "nearest" {
            let (count, targets) = rest.split_once(':').map_or((rest, None), |(count, list)| (count, Some(list)));
            if targets.is_some_and(str::is_empty) {
                return Err(unknown());
            }
            let sources = source_count(name, count, [1, MAX_SOURCES])?;
            return Ok(Protocol::Nearest { sources, targets: targets.map(str::to_owned) });
        }
        if let Some(benchmark) = Benchmark::ALL.into_iter().find(|benchmark| benchmark.name() == name) {
            let (count, masks) = rest.split_once(',').map_or((rest, None), |(count, masks)| (count, Some(masks)));
            let masks_given = match masks {
                None => false,
                Some("masks=given") if benchmark.is_masked() => true,
                Some(_) => return Err(unknown()),
            };
            let sources = source_count(name, count, benchmark.source_range())?;
            return Ok(Protocol::Benchmark { benchmark, sources, masks_given });
        }
        let mut protocol = match name {
            "random" => Protocol::Random { sources: RANDOM_SOURCES },
            "close" => Protocol::Close { sources: CLOSE_SOURCES, degrees: CLOSE_DEGREES },
            "count" => Protocol::Count { sources: COUNTS.to_vec() },
            _ => return Err(unknown()),
        };
        let mut keys = Vec::new();
        for pair in rest.split(',').filter(|pair| !pair.is_empty()) {
            let (key, value) = pair.split_once('=').ok_or_else(unknown)?;
            if keys.contains(&key) {
                return Err(ProtocolError::Repeated { protocol: name.to_owned(), key: key.to_owned() });
            }
            keys.push(key);
            let count = |text: &str| source_count(name, text, [1, MAX_SOURCES]);
            match (&mut protocol, key) {
                (Protocol::Random { sources }, "sources") => *sources = count(value)?,
                (Protocol::Close { sources, .. }, "sources") => *sources = count(value)?,
                (Protocol::Close { degrees, .. }, "degrees") => {
                    let given = value.parse().ok().filter(|degrees| *degrees > 0.0 && *degrees <= 180.0);
                    *degrees = given.ok_or_else(|| bad(name, "degrees", "above 0 and at most 180", value))?;
                }
                (Protocol::Count { sources }, "sources") => {
                    *sources = value.split('+').map(count).collect::<Result<_, _>>()?;
                    sources.sort_unstable();
                    sources.dedup();
                }
                _ => return Err(unknown()),
            }
        }
        Ok(protocol)
    }
}

fn bad(protocol: &str, key: &'static str, wanted: &str, value: &str) -> ProtocolError {
    let (protocol, wanted, value) = (protocol.to_owned(), wanted.to_owned(), value.to_owned());
    ProtocolError::BadValue { protocol, key, wanted, value }
}

/// A number of sources between these, both included.
fn source_count(protocol: &str, text: &str, [least, most]: [usize; 2]) -> Result<usize, ProtocolError> {
    let count = text.parse().ok().filter(|count| (least..=most).contains(count));
    let wanted = || if least == most { least.to_string() } else { format!("a whole number from {least} to {most}") };
    count.ok_or_else(|| bad(protocol, "sources", &wanted(), text))
}
