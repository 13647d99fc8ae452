//! What `report` reads: the folder of an evaluation, a sweep of run times, a training.

use super::files::Files;
use super::{Target, Verdict, verdict};
use image::RgbImage;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;
use viewfuse::evaluate::Score;
use viewfuse::evaluate::run_folder::{Finished, SceneSettings, Settings};
use viewfuse_lab::report::{Evaluation, Report, ReportError, Sweep, Training, page};

/// Most bytes of a page of small files.
const MAX_PAGE: usize = 64 << 20;

const WORDS: &[&str] = &[
    "\"inf\"", "\"NaN\"", "null", "[]", "{}", "\"job_count\":1000000000000000000", "\"scene\":18446744073709551615",
    "\"mean\"", "\"PSNR\"", "\"../../x.png\"", "\"/etc/passwd\"", "\"count:sources=2+4\"", "\"random:sources=3\"",
    "\"source_count\":0", "1e308", "\n",
];

/// Records of a run, and the page that shows them.
pub(crate) struct Records {
    files: Files,
    open: fn(&Path) -> Result<Report, ReportError>,
}

impl Target for Records {
    fn seeds(&self) -> Vec<Vec<u8>> {
        self.files.seeds()
    }

    fn words(&self) -> &'static [&'static str] {
        WORDS
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        self.files.write(bytes);
        let made = (self.open)(self.files.path()).and_then(|report| page(&report));
        if made.as_ref().is_ok_and(|page| page.len() > MAX_PAGE) {
            return Err("a page of more than 64 MiB".to_owned());
        }
        verdict(made, self.files.path())
    }
}

/// The folder of an evaluation.
pub(crate) fn evaluation() -> Records {
    let scene = SceneSettings { name: "toy".to_owned(), views: 24, masks: 0, size: [16, 16], cameras: "0".repeat(16) };
    let settings = Settings {
        viewfuse: "0.1.0".to_owned(),
        protocol: "count:sources=2+4".to_owned(),
        schemes: vec!["mean".to_owned(), "error:alpha=1".to_owned()],
        field: "training-free".to_owned(),
        metric: "PSNR of 8-bit values".to_owned(),
        options: BTreeMap::from([("seed".to_owned(), "0".to_owned())]),
        files: BTreeMap::new(),
        job_count: 5,
        notes: vec!["a note".to_owned()],
        scenes: vec![scene],
    };
    let score = |scheme: &str, psnr: f64, source_count: usize| Score {
        scheme: scheme.to_owned(),
        target: "000020".to_owned(),
        source_count,
        values: vec![("PSNR".to_owned(), psnr), ("SSIM".to_owned(), 0.75)],
        time: Duration::from_millis(12),
    };
    let job = |job: usize| {
        let count = [2, 4][job % 2];
        let psnr = 20.0 + job as f64;
        let finished = Finished {
            job,
            scene: 0,
            scene_name: "toy".to_owned(),
            trial: job as u32,
            device: "CPU".to_owned(),
            settings: String::new(),
            sources: vec!["000001".to_owned(); count],
            scores: vec![
                score("nearest view", psnr - 3.0, count),
                score("mean", psnr, count),
                score("error:alpha=1", psnr + 0.5, count),
            ],
        };
        serde_json::to_string(&finished).expect("JSON") + "\n"
    };
    let shown = json!({
        "job": 0, "scene": "toy", "target": "000020", "truth": "a.png",
        "sources": [{"name": "000001", "file": "a.png"}],
        "schemes": [{"scheme": "mean", "file": "a.png", "weights": [1.0], "values": [["PSNR", 20.0], ["SSIM", null]]}],
    });
    let files = Files::new(&[
        ("run.json", serde_json::to_vec_pretty(&settings).expect("JSON")),
        ("scores-0-of-1.jsonl", (0..4).map(job).collect::<String>().into_bytes()),
        ("pictures/job-00000.json", shown.to_string().into_bytes()),
    ]);
    RgbImage::new(2, 2).save(files.path().join("pictures/a.png")).expect("a picture");
    let open = |path: &Path| Ok(Report { evaluations: vec![Evaluation::open(path)?], ..Report::default() });
    Records { files, open }
}

/// A sweep of run times.
pub(crate) fn sweep() -> Records {
    let difference = json!({"root_mean_square": 0.01, "psnr": 40.0, "largest": 0.25});
    let point = |setting: &str, seconds: f64, psnr: Option<f64>| {
        json!({
            "setting": setting, "best": true, "seconds": seconds, "seconds_range": [0.9 * seconds, 1.1 * seconds],
            "encode_seconds": 0.5 * seconds, "gain": 1.0 / seconds,
            "versus_exact": {"root_mean_square": 0.0, "psnr": psnr, "largest": 0.0},
            "truth_psnr": 30.0, "truth_loss": 0.0, "repeatable": true,
        })
    };
    let record = json!({
        "viewfuse": "0.1.0", "scene": "toy", "field": "training-free", "model": null, "weighting": "mean", "seed": 0,
        "size": [16, 16], "sources": ["000001"], "targets": ["000020"], "round_count": 1, "failures": [],
        "devices": [{
            "device": "CPU", "exact_versus_first": difference, "fastest_without_loss": null,
            "fastest_of_same_look": "all",
            "points": [point("exact", 2.0, None), point("all", 0.5, Some(42.0))],
        }],
    });
    let files = Files::new(&[("pareto.json", record.to_string().into_bytes())]);
    let open = |path: &Path| Ok(Report { sweeps: vec![Sweep::open(path)?], ..Report::default() });
    Records { files, open }
}

/// The folder of a training.
pub(crate) fn training() -> Records {
    let record = json!({
        "program": "viewfuse 0.1.0", "settings": {"schedule": {"steps": 12, "rate": 0.001}}, "steps": 12,
        "losses": [[1, 0.5], [2, 0.25]], "score": "PSNR dB", "scores": (0..20).collect::<Vec<_>>(),
    });
    let curve = b"<svg width=\"9\" height=\"9\" xmlns=\"http://www.w3.org/2000/svg\"></svg>".to_vec();
    let files = Files::new(&[("record.json", record.to_string().into_bytes()), ("curve.svg", curve)]);
    let open = |path: &Path| Ok(Report { trainings: vec![Training::open(path)?], ..Report::default() });
    Records { files, open }
}
