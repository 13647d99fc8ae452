//! What a person types: schemes, protocols, shards, devices, colours, layouts, lists of views.

use super::{Target, Verdict};
use std::fmt::Display;
use std::str::FromStr;
use viewfuse::device::choice::DeviceChoice;
use viewfuse::evaluate::protocol::Protocol;
use viewfuse::evaluate::run_folder::Shard;
use viewfuse::scene::few_shot::{Selection, view_list};
use viewfuse::scene::photographs::BackgroundChoice;
use viewfuse::scene::write::Layout;
use viewfuse::scene::{Scene, Split};
use viewfuse::weighting::{WeightingChoice, WeightingSpec};
use viewfuse_tests::places::data;

/// Texts of options.
pub(crate) struct Specs;

/// What a parser says: whether the text is read, and the message.
fn parsed<T: FromStr<Err: Display>>(text: &str) -> Result<bool, String> {
    match text.parse::<T>() {
        Ok(_) => Ok(true),
        Err(error) => match error.to_string() {
            message if message.is_empty() || message.len() > 4000 + 4 * text.len() => {
                Err(format!("the message is {message:?}"))
            }
            _ => Ok(false),
        },
    }
}

/// A text that is read means the same when it is written and read again.
fn means_the_same<T: FromStr<Err: Display> + Display + PartialEq>(text: &str) -> Result<bool, String> {
    if let Ok(value) = text.parse::<T>() {
        let again = value.to_string().parse::<T>();
        if !again.is_ok_and(|again| again == value) {
            return Err(format!("{text:?} is written as {:?}, which does not mean the same", value.to_string()));
        }
    }
    parsed::<T>(text)
}

/// The same for a weighting; one with a label is written as the label, which is then no weighting itself.
fn weighting_means_the_same(text: &str) -> Result<bool, String> {
    let label = text.parse::<WeightingSpec>().ok().map(|value| value.to_string());
    let rest = label.as_ref().and_then(|label| text.strip_prefix(label.as_str())?.strip_prefix('='));
    match (label, rest) {
        (Some(label), Some(rest)) if label.parse::<WeightingSpec>().is_err() => means_the_same::<WeightingSpec>(rest),
        _ => means_the_same::<WeightingSpec>(text),
    }
}

impl Target for Specs {
    fn seeds(&self) -> Vec<Vec<u8>> {
        let texts = "mean error:alpha=0.5,angle=full gaussian:beta=2 distance:power=2 attention:file.safetensors auto \
                     half=error:alpha=0.5 random:sources=3 close:sources=5,degrees=10 count:sources=2+8 fixed:cars \
                     fixed:1,2:all/3 nearest:4 llff:3 dtu:9,masks=given blender:8 0/4 vulkan:1 cpu 10,20,30 white \
                     transforms train";
        texts.split(' ').map(|text| text.as_bytes().to_vec()).collect()
    }

    fn words(&self) -> &'static [&'static str] {
        &[":", ",", "=", "+", "/", "alpha=", "beta=", "sources=", "degrees=", "masks=given", "error", "vulkan:", "256"]
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        let text = &String::from_utf8_lossy(bytes);
        let outcomes = [
            weighting_means_the_same(text)?,
            parsed::<WeightingChoice>(text)?,
            means_the_same::<Protocol>(text)?,
            means_the_same::<Shard>(text)?,
            parsed::<DeviceChoice>(text)?,
            parsed::<BackgroundChoice>(text)?,
            means_the_same::<Layout>(text)?,
            parsed::<Split>(text)?,
        ];
        match outcomes.contains(&true) {
            true => Ok(Verdict::Read),
            false => {
                Ok(Verdict::Refused(text.parse::<Protocol>().map_or_else(|error| error.to_string(), |_| String::new())))
            }
        }
    }
}

/// Lists of views of the sample scene.
pub(crate) struct ViewLists(Scene);

impl ViewLists {
    pub(crate) fn new() -> ViewLists {
        ViewLists(Scene::open(data("toy")).expect("the sample scene"))
    }
}

impl Target for ViewLists {
    fn seeds(&self) -> Vec<Vec<u8>> {
        ["20", "1,4,7", "3..9", "all/3", "000001..000007/2", "all", "train"]
            .iter()
            .map(|text| text.as_bytes().to_vec())
            .collect()
    }

    fn words(&self) -> &'static [&'static str] {
        &["..", "/", ",", "all", "000023", "train", "val", " "]
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        let list = String::from_utf8_lossy(bytes).into_owned();
        match view_list(&self.0, &list) {
            Ok(views) => {
                let is_sorted = views.windows(2).all(|pair| pair[0] < pair[1]);
                if !is_sorted || views.iter().any(|view| *view >= self.0.views.len()) {
                    return Err(format!("{list:?} gives {views:?}"));
                }
                let selection =
                    Selection { sources: Some(list), targets: Some("23".to_owned()), ..Selection::default() };
                Ok(selection
                    .resolve(&self.0, 1)
                    .map_or_else(|error| Verdict::Refused(error.to_string()), |_| Verdict::Read))
            }
            Err(error) => Ok(Verdict::Refused(error.to_string())),
        }
    }
}
