//! The keys of a `transforms.json`: which are read, which say something that is not done, and which are not read.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde_json::Value;

use super::super::camera_models::{LENS_KEYS, LENS_LIST, REFUSED_FLAGS};
use super::super::json::Object;

/// Keys of intrinsics, beside those of lenses.
const INTRINSICS: &str = "fl_x fl_y cx cy w h camera_angle_x camera_angle_y x_fov y_fov camera_model is_fisheye";

/// The other keys that are read; the applied ones and `fps` with camera paths.
const READ: &str = "frames file_path transform_matrix mask_path depth_file_path time train_filenames val_filenames \
                    test_filenames applied_transform applied_scale fps";

/// Keys that are not read and change which pictures a program makes that reads them (instant-ngp, nerfstudio).
const TELLING: &str = "rolling_shutter transform_matrix_start transform_matrix_end white_transparent \
                       black_transparent n_frames sharpness_discard_threshold normal_mts_args \
                       fisheye_crop_radius";

/// Whether a key is one of those that a text lists.
fn is_in(keys: &str, key: &str) -> bool {
    keys.split(' ').any(|known| known == key)
}

/// What was found of the keys of a file.
pub(super) struct Keys<'a> {
    top: Object<'a>,
    frame_count: usize,
    /// Keys of frames that are not read, with how many frames have them.
    unused: BTreeMap<&'a str, usize>,
    /// Keys of intrinsics that frames state otherwise than the top.
    overridden: BTreeSet<&'a str>,
    overriding_count: usize,
    telling: BTreeSet<&'a str>,
    /// The first frame's time, and whether another differs.
    time: Option<f64>,
    is_moving: bool,
}

impl<'a> Keys<'a> {
    /// Of the top of a file.
    pub(super) fn new(top: &Object<'a>) -> Keys<'a> {
        let telling = top.entries().filter(is_telling).map(|(key, _)| key).collect();
        Keys {
            top: top.clone(),
            frame_count: 0,
            unused: BTreeMap::new(),
            overridden: BTreeSet::new(),
            overriding_count: 0,
            telling,
            time: None,
            is_moving: false,
        }
    }

    /// Adds a frame.
    pub(super) fn add(&mut self, frame: &Object<'a>) {
        self.frame_count += 1;
        let differs = |(key, value): &(&str, &Value)| {
            let is_camera = is_in(INTRINSICS, key) || is_in(LENS_KEYS, key) || *key == LENS_LIST.0;
            // `1` and `1.0` are one number.
            let same = |top: &Value| top == *value || top.as_f64().is_some_and(|top| value.as_f64() == Some(top));
            is_camera && self.top.get(key).is_some_and(|top| !same(top))
        };
        let overridden: Vec<&str> = frame.entries().filter(differs).map(|(key, _)| key).collect();
        self.overriding_count += usize::from(!overridden.is_empty());
        self.overridden.extend(overridden);
        self.telling.extend(frame.entries().filter(is_telling).map(|(key, _)| key));
        for (key, _) in frame.entries().filter(|(key, _)| !is_read(key)) {
            *self.unused.entry(key).or_default() += 1;
        }
        if let Some(time) = frame.get("time").and_then(Value::as_f64) {
            self.is_moving |= *self.time.get_or_insert(time) != time;
        }
    }

    /// How frames state what the top of the file states otherwise.
    pub(super) fn convention(&self) -> Option<String> {
        let (all, count, keys) = (self.frame_count, self.overriding_count, list(&self.overridden));
        (count > 0).then(|| {
            format!(
                "{count} of {all} frames state {keys} otherwise than the top of the file: each frame's values are \
                 taken (nerfstudio takes those at the top)"
            )
        })
    }

    /// What changes pictures, a line each.
    pub(super) fn warnings(&self, path: &Path) -> Vec<String> {
        let path = path.display();
        let mut lines = Vec::new();
        if !self.telling.is_empty() {
            lines.push(format!("{path}: {} change pictures and are not read", list(&self.telling)));
            if self.telling.contains("fisheye_crop_radius") {
                lines.push(format!(
                    "{path}: what is outside of the circle of fisheye_crop_radius counts as picture: give masks of it \
                     (mask_path, 0 outside)"
                ));
            }
        }
        if self.is_moving {
            lines.push(format!(
                "{path}: the frames are of different times (time): the scene moves, and is rendered as if it stood \
                    still"
            ));
        }
        lines
    }

    /// All keys that are not read, in a line.
    pub(super) fn unused(&self, path: &Path) -> Option<String> {
        let top = self.top.entries().filter(|(key, _)| !is_read(key)).map(|(key, _)| key.to_owned());
        let frames = self.unused.iter().map(|(key, count)| format!("{key} of {count} frames"));
        let keys = top.chain(frames).collect::<Vec<_>>().join(", ");
        (!keys.is_empty()).then(|| format!("{}: {keys}", path.display()))
    }
}

fn list(keys: &BTreeSet<&str>) -> String {
    keys.iter().copied().collect::<Vec<_>>().join(", ")
}

fn is_read(key: &str) -> bool {
    [INTRINSICS, READ, LENS_KEYS].into_iter().any(|keys| is_in(keys, key))
        || REFUSED_FLAGS.contains(&key)
        || key == LENS_LIST.0
}

/// Whether a key that changes pictures has a value that says something.
fn is_telling((key, value): &(&str, &Value)) -> bool {
    fn is_idle(value: &Value) -> bool {
        match value {
            Value::Null | Value::Bool(false) => true,
            Value::Number(number) => number.as_f64() == Some(0.0),
            Value::Array(values) => values.iter().all(is_idle),
            _ => false,
        }
    }
    is_in(TELLING, key) && !is_idle(value)
}
