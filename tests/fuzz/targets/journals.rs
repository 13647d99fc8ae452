//! The journal that an interrupted run goes on from.

use super::{Target, Verdict, folder, verdict};
use serde_json::json;
use std::fs;
use tempfile::TempDir;
use viewfuse::output::journal::{FrameJournal, JOURNAL};

/// The run that goes on.
const RUN: &str = "0123456789abcdef";

/// A folder with a picture; every input is its journal.
pub(crate) struct Journals(TempDir);

impl Journals {
    pub(crate) fn new() -> Journals {
        let folder = folder();
        fs::write(folder.path().join("20.png"), "a picture").expect("a file");
        Journals(folder)
    }
}

fn line(target: &str, file: &str) -> String {
    let frame = json!({
        "target": target, "world_from_camera": [[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
        "weights": [0.75, 0.25], "weights_before": [0.7, 0.3], "left_out": [], "left_out_weight": 0.0,
        "psnr": 24.5, "expected": null, "ssim": 0.9, "depth_step": null, "seconds": 0.1, "encode_seconds": 0.0,
    });
    format!("{}\n", json!({ "frame": frame, "files": [file] }))
}

impl Target for Journals {
    fn seeds(&self) -> Vec<Vec<u8>> {
        let head = format!("{{\"run\":\"{RUN}\"}}\n");
        let (first, other) = (line("20", "20.png"), line("21", "21.png"));
        let cut = &first[..first.len() / 2];
        let texts = [
            head.clone(),
            format!("{head}{first}"),
            format!("{head}{first}{other}{cut}"),
            format!("{{\"run\":\"another\"}}\n{first}"),
            "{\"run\":\"01".to_owned(),
        ];
        texts.into_iter().map(String::into_bytes).collect()
    }

    fn words(&self) -> &'static [&'static str] {
        &["\n", "{\"run\":\"", RUN, "\"files\":[", "20.png", "../20.png", "null", "1e999"]
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        let folder = self.0.path();
        fs::write(folder.join(JOURNAL), bytes).expect("a file");
        let (mut journal, frames) = match FrameJournal::open(folder, RUN, &[]) {
            Ok(opened) => opened,
            Err(error) => {
                let kept = fs::read(folder.join(JOURNAL)).map_err(|error| error.to_string())?;
                return if kept == bytes {
                    verdict::<(), _>(Err(error), folder)
                } else {
                    Err("it was changed".to_owned())
                };
            }
        };
        let targets = |frames: &[viewfuse::output::journal::FinishedFrame]| -> Vec<String> {
            frames.iter().map(|frame| frame.frame.target.clone()).collect()
        };
        // Going on keeps exactly the whole lines of this run, and is read as the same.
        journal.begin().map_err(|error| format!("it was opened, but does not go on: {error}"))?;
        let (_, again) =
            FrameJournal::open(folder, RUN, &[]).map_err(|error| format!("what goes on is no journal: {error}"))?;
        if targets(&again) != targets(&frames) {
            return Err(format!("{:?} became {:?}", targets(&frames), targets(&again)));
        }
        Ok(if frames.is_empty() { Verdict::Refused("no frames".to_owned()) } else { Verdict::Read })
    }
}
