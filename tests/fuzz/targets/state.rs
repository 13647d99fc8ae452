//! The saved state of a training.

use super::{OneFile, Target, Verdict, verdict};
use serde_json::json;
use viewfuse_lab::train::check_state;
use viewfuse_tests::checkpoints::safetensors;

pub(crate) struct State(pub(super) OneFile);

impl Target for State {
    fn seeds(&self) -> Vec<Vec<u8>> {
        let progressed = json!({
            "steps": 100, "seconds": 1.5, "losses": [[50, 0.5], [100, 0.25]], "pending": [0.0, 0], "scores": [[100,
            12.0]],
        });
        let settings = json!({"model": "pixelnerf", "schedule": {"steps": 100, "rate": 0.001}});
        let header = json!({
            "__metadata__": {"settings": settings.to_string(), "progressed": progressed.to_string()},
            "parameter.a": {"dtype": "F32", "shape": [2], "data_offsets": [0, 8]},
        });
        vec![safetensors(&header.to_string(), &[0; 8])]
    }

    fn words(&self) -> &'static [&'static str] {
        &["\\\"steps\\\":4294967295", "\\\"losses\\\":[]", "[[1,1e308]]", "null", "\\\"", "\"F64\"", "[]", "1e39"]
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        let path = self.0.write(bytes);
        verdict(check_state(path), path)
    }
}
