//! The settings that determine an evaluation's scores.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use viewfuse_job::digest::{hexadecimal, sha256_of_part};
use viewfuse_scene::Scene;

/// Everything that determines the jobs and their results. Not included: the device (each finished job states its own),
/// the shard, the number of threads, and the paths of the scenes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Version of the program.
    pub viewfuse: String,
    /// The protocol with all its values.
    pub protocol: String,
    /// The schemes in the order of the table.
    pub schemes: Vec<String>,
    /// What makes the pictures.
    pub field: String,
    /// A description of what the metrics compare.
    #[serde(default)]
    pub metric: String,
    /// Every option of the command and its value, defaults included.
    pub options: BTreeMap<String, String>,
    /// SHA-256 of the files of parameters: checkpoints, learned attention.
    pub files: BTreeMap<String, String>,
    /// Number of jobs.
    pub job_count: usize,
    /// What the protocol requires and the scenes lack.
    pub notes: Vec<String>,
    /// The scenes, in order.
    pub scenes: Vec<SceneSettings>,
}

/// The properties of a scene that are known without reading pixels.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneSettings {
    /// Its name.
    pub name: String,
    /// Number of views.
    pub views: usize,
    /// Number of views whose photograph has a mask.
    #[serde(default)]
    pub masks: usize,
    /// Width and height of the pictures at its first view.
    #[serde(default)]
    pub size: [u32; 2],
    /// SHA-256 of the names, cameras, lenses and bounds of its views, of the lengths of their files with what is in
    /// their middle, and of the points, the first eight bytes.
    pub cameras: String,
}

/// Bytes in the middle of a photograph's file that tell it from another one of the same length.
const MIDDLE: u64 = 4096;

/// What the key of a scene's settings begins with.
const OF_SCENE: &str = "cameras of ";

/// What follows from the other settings.
const FOLLOWING: [&str; 2] = ["job_count", "notes"];

impl SceneSettings {
    /// The properties of a scene whose pictures have this size.
    pub fn of(scene: &Scene, size: [u32; 2]) -> SceneSettings {
        let mut digest = Sha256::new();
        for view in &scene.views {
            digest.update(view.name.as_bytes());
            digest.update([0, u8::from(view.image.is_some())]);
            let pinhole = &view.camera.pinhole;
            let bounds = view.near_far.into_iter().flatten();
            let pose = view.camera.pose.to_opencv().into_iter().flatten();
            let numbers = pose.chain(pinhole.focal()).chain(pinhole.principal()).chain(bounds);
            numbers.for_each(|number| digest.update(number.to_le_bytes()));
            [view.camera.pinhole.width(), view.camera.pinhole.height()]
                .iter()
                .for_each(|side| digest.update(side.to_le_bytes()));
            if let Some(lens) = &view.lens {
                digest.update(format!("{lens:?}"));
            }
            // Other photographs under the same names have other lengths, or another middle where they are not compressed;
            // a file's time is that of its copy.
            for file in view.image.iter().chain(&view.mask) {
                let length = std::fs::metadata(file).map_or(0, |file| file.len());
                digest.update(length.to_le_bytes());
                digest.update(sha256_of_part(file, length.saturating_sub(MIDDLE) / 2, MIDDLE).unwrap_or_default());
            }
        }
        for point in &scene.points {
            point.position_world.to_array().iter().for_each(|number| digest.update(number.to_le_bytes()));
        }
        let cameras = hexadecimal(&digest.finalize()[..8]);
        let masks = scene.views.iter().filter(|view| view.mask.is_some()).count();
        SceneSettings { name: scene.name(), views: scene.views.len(), masks, size, cameras }
    }
}

impl Settings {
    /// SHA-256 of all of them but what follows from the others, the first eight bytes.
    pub fn digest(&self) -> String {
        let all = self.flat();
        let lines = all.iter().filter(|(key, _)| !FOLLOWING.contains(&key.as_str()));
        let text: String = lines.map(|(key, value)| format!("{key} {value}\n")).collect();
        hexadecimal(&Sha256::digest(text)[..8])
    }

    /// The differences from `found`, in words: key, value here, value there. Of a scene what may differ: digests say
    /// nothing to a person.
    pub fn differences(&self, found: &Settings) -> Vec<String> {
        let (here, there) = (self.flat(), found.flat());
        let keys = here.keys().chain(there.keys().filter(|key| !here.contains_key(*key)));
        let differs = |key: &&String| here.get(*key) != there.get(*key);
        let all: Vec<&String> = keys.filter(differs).collect();
        let causes: Vec<&String> = all.iter().copied().filter(|key| !FOLLOWING.contains(&key.as_str())).collect();
        let told = if causes.is_empty() { all } else { causes };
        let words = |values: &BTreeMap<String, String>, key: &String| {
            let text = values.get(key).map_or("none", String::as_str);
            if text.chars().count() <= 60 {
                text.to_owned()
            } else {
                format!("{}...", text.chars().take(57).collect::<String>())
            }
        };
        // Which scenes only one has is told by their names.
        let are_same_scenes = here.get("scenes") == there.get("scenes");
        let is_of_both = |key: &str| here.contains_key(key) && there.contains_key(key);
        let told = told.into_iter().filter(|key| !key.starts_with(OF_SCENE) || are_same_scenes || is_of_both(key));
        let told = told.map(|key| match key.strip_prefix(OF_SCENE) {
            Some(scene) => format!("cameras, photographs, masks or sizes of {scene}"),
            None => format!("{key}: {} here, {} there", words(&here, key), words(&there, key)),
        });
        told.collect()
    }

    /// Values as text by key, options and files one by one.
    fn flat(&self) -> BTreeMap<String, String> {
        let text = |value: Value| if let Value::String(text) = value { text } else { value.to_string() };
        let Ok(Value::Object(all)) = serde_json::to_value(self) else { return BTreeMap::new() };
        let mut flat = BTreeMap::new();
        for (key, value) in all {
            match value {
                Value::Object(inner) => flat.extend(inner.into_iter().map(|(key, value)| (key, text(value)))),
                Value::Array(items) if key == "scenes" => {
                    let name = |item: &Value| item["name"].as_str().unwrap_or_default().to_owned();
                    flat.insert(key, items.iter().map(name).collect::<Vec<_>>().join(", "));
                    // Scenes may have one name.
                    let cameras = items.into_iter().enumerate().map(|(index, item)| {
                        let numbered = if index == 0 { String::new() } else { format!(" (scene {})", index + 1) };
                        (format!("{OF_SCENE}{}{numbered}", name(&item)), item.to_string())
                    });
                    flat.extend(cameras);
                }
                value => {
                    flat.insert(key, text(value));
                }
            }
        }
        flat
    }
}
