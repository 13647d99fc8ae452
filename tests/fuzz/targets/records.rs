//! What `report` reads: the folder of an evaluation, a sweep of run times, a training.

use super::{Target, Verdict, folder, verdict};
use image::RgbImage;
use serde_json::json;
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::time::Duration;
use tempfile::TempDir;
use viewfuse::evaluate::Score;
use viewfuse::evaluate::run_folder::{Finished, SceneSettings, Settings};
use viewfuse_lab::report::{Evaluation, Report, ReportError, Sweep, Training, page};

/// A folder one of whose files is broken at a time. The first byte of an input says which.
struct Files {
    folder: TempDir,
    files: Vec<(PathBuf, Vec<u8>)>,
    last: Option<usize>,
}

impl Files {
    fn new(files: &[(&str, Vec<u8>)]) -> Files {
        let folder = folder();
        fs::create_dir(folder.path().join("pictures")).expect("a folder");
        let files: Vec<(PathBuf, Vec<u8>)> =
            files.iter().map(|(name, bytes)| (folder.path().join(name), bytes.clone())).collect();
        files.iter().for_each(|(path, bytes)| fs::write(path, bytes).expect("a file"));
        Files { folder, files, last: None }
    }

    fn seeds(&self) -> Vec<Vec<u8>> {
        let seed = |(index, (_, bytes)): (usize, &(PathBuf, Vec<u8>))| [&[index as u8], bytes.as_slice()].concat();
        self.files.iter().enumerate().map(seed).collect()
    }

    fn write(&mut self, input: &[u8]) {
        let (first, rest) = input.split_first().unwrap_or((&0, &[]));
        let index = usize::from(*first) % self.files.len();
        if let Some(last) = self.last.filter(|last| *last != index) {
            fs::write(&self.files[last].0, &self.files[last].1).expect("a file");
        }
        self.last = Some(index);
        fs::write(&self.files[index].0, rest).expect("a file");
    }

    fn verdict(&self, made: Result<String, ReportError>) -> Result<Verdict, String> {
        if made.as_ref().is_ok_and(|page| page.len() > MAX_PAGE) {
            return Err("a page of more than 64 MiB".to_owned());
        }
        verdict(made, self.folder.path())
    }
}

/// Most bytes of a page of small files.
const MAX_PAGE: usize = 64 << 20;

const WORDS: &[&str] = &[
    "\"inf\"",
    "\"NaN\"",
    "null",
    "[]",
    "{}",
    "\"job_count\":1000000000000000000",
    "\"scene\":18446744073709551615",
    "\"mean\"",
    "\"PSNR\"",
    "\"../../x.png\"",
    "\"/etc/passwd\"",
    "\"count:sources=2+4\"",
    "\"random:sources=3\"",
    "\"source_count\":0",
    "1e308",
    "\n",
];

/// The folder of an evaluation.
pub(crate) struct Run(Files);

impl Run {
    pub(crate) fn new() -> Run {
        let scene =
            SceneSettings { name: "toy".to_owned(), views: 24, masks: 0, size: [16, 16], cameras: "0".repeat(16) };
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
        RgbImage::new(2, 2).save(files.folder.path().join("pictures/a.png")).expect("a picture");
        Run(files)
    }
}

impl Target for Run {
    fn seeds(&self) -> Vec<Vec<u8>> {
        self.0.seeds()
    }

    fn words(&self) -> &'static [&'static str] {
        WORDS
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        self.0.write(bytes);
        let made = Evaluation::open(self.0.folder.path())
            .and_then(|evaluation| page(&Report { evaluations: vec![evaluation], ..Report::default() }));
        self.0.verdict(made)
    }
}

/// A sweep of run times.
pub(crate) struct Sweeps(Files);

impl Sweeps {
    pub(crate) fn new() -> Sweeps {
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
                "device": "CPU", "exact_versus_first": difference, "fastest_without_loss": null, "fastest_of_same_look": "all",
                "points": [point("exact", 2.0, None), point("all", 0.5, Some(42.0))],
            }],
        });
        Sweeps(Files::new(&[("pareto.json", record.to_string().into_bytes())]))
    }
}

impl Target for Sweeps {
    fn seeds(&self) -> Vec<Vec<u8>> {
        self.0.seeds()
    }

    fn words(&self) -> &'static [&'static str] {
        WORDS
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        self.0.write(bytes);
        let made = Sweep::open(self.0.folder.path())
            .and_then(|sweep| page(&Report { sweeps: vec![sweep], ..Report::default() }));
        self.0.verdict(made)
    }
}

/// The folder of a training.
pub(crate) struct Trainings(Files);

impl Trainings {
    pub(crate) fn new() -> Trainings {
        let record = json!({
            "program": "viewfuse 0.1.0", "settings": {"schedule": {"steps": 12, "rate": 0.001}}, "steps": 12,
            "losses": [[1, 0.5], [2, 0.25]], "score": "PSNR dB", "scores": (0..20).collect::<Vec<_>>(),
        });
        let curve = b"<svg width=\"9\" height=\"9\" xmlns=\"http://www.w3.org/2000/svg\"></svg>".to_vec();
        Trainings(Files::new(&[("record.json", record.to_string().into_bytes()), ("curve.svg", curve)]))
    }
}

impl Target for Trainings {
    fn seeds(&self) -> Vec<Vec<u8>> {
        self.0.seeds()
    }

    fn words(&self) -> &'static [&'static str] {
        WORDS
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        self.0.write(bytes);
        let made = Training::open(self.0.folder.path())
            .and_then(|training| page(&Report { trainings: vec![training], ..Report::default() }));
        self.0.verdict(made)
    }
}
