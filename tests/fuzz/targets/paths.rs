//! Camera paths: tables, the paths of nerfstudio's viewer, and `transforms.json` as a path.

use super::{OneFile, Target, Verdict, verdict};
use serde_json::json;
use viewfuse::scene::Scene;
use viewfuse::scene::path::CameraPath;
use viewfuse_tests::places::data;

/// A file of one ending, beside the sample scene.
pub(crate) struct Paths {
    file: OneFile,
    scene: Scene,
    seeds: Vec<String>,
    words: &'static [&'static str],
}

impl Paths {
    fn new(name: &str, seeds: Vec<String>, words: &'static [&'static str]) -> Paths {
        Paths { file: OneFile::new(name), scene: Scene::open(data("toy")).expect("the sample scene"), seeds, words }
    }

    pub(crate) fn tables() -> Paths {
        let texts = [
            "name,x,y,z,look_x,look_y,look_z\nfirst,1,1,1,0,0,0\nsecond,1,0.5,1,0,0,0\n",
            "x,y,z,qw,qx,qy,qz,fov\n0,0,-1.3,1,0,0,0,40\n",
            "x,y,z,look_x,look_y,look_z,up_x,up_y,up_z\n1,1,1,0,0,0,0,0,1\n",
        ];
        let words = &[",", "\n", "name", "fov", "look_x", "up_z", "qw", "\"", "nan", "1e39"];
        Paths::new("path.csv", texts.map(str::to_owned).to_vec(), words)
    }

    pub(crate) fn json() -> Paths {
        let matrix = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.3, 0.0, 0.0, 0.0, 1.0];
        let rows: Vec<&[f64]> = matrix.chunks(4).collect();
        let frame = json!({ "camera_to_world": matrix, "fov": 40.0, "aspect": 1.0 });
        let path = json!({ "camera_type": "perspective", "render_height": 12, "render_width": 16, "fps": 24,
            "camera_path": [frame, frame] });
        let transforms = json!({ "camera_angle_x": 0.7, "w": 16, "h": 12, "frames": [
            { "file_path": "a", "transform_matrix": rows }, { "file_path": "b", "transform_matrix": rows }] });
        let words = &["\"camera_path\"", "\"frames\"", "\"fov\"", "[", "]", "{", "}", "null", "1e39", "-1"];
        Paths::new("path.json", vec![path.to_string(), transforms.to_string()], words)
    }
}

impl Target for Paths {
    fn seeds(&self) -> Vec<Vec<u8>> {
        self.seeds.iter().map(|text| text.clone().into_bytes()).collect()
    }

    fn words(&self) -> &'static [&'static str] {
        self.words
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        let path = self.file.write(bytes);
        let outcome = CameraPath::open(path, &self.scene, &self.scene.views[0].camera.pinhole);
        if let Ok(CameraPath { cameras, frames_per_second, .. }) = &outcome {
            let mut names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
            names.sort_unstable();
            names.dedup();
            if names.len() != cameras.len() || cameras.is_empty() || names.iter().any(|name| name.contains('/')) {
                return Err(format!("{} cameras are called {names:?}", cameras.len()));
            }
            if frames_per_second.is_some_and(|rate| !(rate > 0.0 && rate.is_finite())) {
                return Err(format!("{frames_per_second:?} frames per second"));
            }
            if let Some(camera) = cameras.iter().find(|camera| !camera.camera.pose.centre_world().is_finite()) {
                return Err(format!("the camera {} is nowhere", camera.name));
            }
        }
        verdict(outcome, path)
    }
}
