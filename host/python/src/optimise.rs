//! A scene's photographs to a file of Gaussians, with the defaults of the command.

use crate::error::Failure;
use crate::request::{device, render_options};
use pyo3::prelude::*;
use std::fs::canonicalize;
use std::path::PathBuf;
use viewfuse::field::gaussians::{MAX_COUNT, MAX_ITERATIONS, Quality, RecipeOptions};
use viewfuse::field::optimise::SceneOptimisation;
use viewfuse::job::files::check_writable;
use viewfuse::job::progress::Progress;
use viewfuse::output::gaussian_page::{check_name, holds_harmonics, write_optimised};
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::Selection;
use viewfuse::scene::gaussians::{GaussianFile, GaussianScene};
use viewfuse::weighting::{Weighting, WeightingSpec};

/// A file of Gaussians that was optimised.
#[pyclass(name = "Gaussians", module = "viewfuse", frozen, get_all)]
pub(crate) struct PyGaussians {
    /// The file.
    path: PathBuf,
    /// The number of Gaussians.
    count: usize,
    /// The iterations that were made.
    iterations: u32,
    /// Iteration and mean PSNR in decibels of the held-out views, on the way. Empty without such views.
    scores: Vec<(u32, f64)>,
    /// Mean PSNR of some of the sources themselves, which says nothing of new views. None where views were held out.
    fit: Option<f64>,
}

#[pymethods]
impl PyGaussians {
    fn __repr__(&self) -> String {
        format!("<viewfuse.Gaussians {}, {} Gaussians>", self.path.display(), self.count)
    }
}

/// The arguments of an optimisation.
pub(crate) struct Optimisation {
    pub(crate) output: PathBuf,
    pub(crate) selection: Selection,
    pub(crate) weights: Option<String>,
    pub(crate) left_out: Option<String>,
    pub(crate) towards: Option<String>,
    pub(crate) quality: String,
    pub(crate) count: Option<u32>,
    pub(crate) iterations: Option<u32>,
    pub(crate) resume: Option<PathBuf>,
    pub(crate) antialias: bool,
    pub(crate) size: Option<(u32, u32)>,
    pub(crate) device: String,
    pub(crate) background: String,
    pub(crate) seed: u64,
}

impl Optimisation {
    /// Optimises, and writes the file: after a cancellation what there is so far.
    pub(crate) fn carry_out(&self, scene: &Scene, progress: &dyn Progress) -> Result<PyGaussians, Failure> {
        let output = &self.output;
        check_name(output).map_err(|problem| Failure::Input(format!("{}: {problem}", output.display())))?;
        let weighting = match &self.weights {
            Some(name) => name.parse::<WeightingSpec>()?.open()?,
            None => Weighting::default_scheme(),
        };
        let given = |name: &str, value: Option<u32>, most: u32| match value {
            Some(value) if !(1..=most).contains(&value) => {
                Err(Failure::Input(format!("{name}: {value} is not a whole number from 1 to {most}")))
            }
            value => Ok(value),
        };
        let count = given("count", self.count, MAX_COUNT)?;
        let iterations = given("iterations", self.iterations, MAX_ITERATIONS)?;
        let quality = self.quality.parse::<Quality>()?;
        let is_of_one_colour = !holds_harmonics(output);
        let of_scene =
            SceneOptimisation::new(scene, &self.selection, self.left_out.as_deref(), self.towards.as_deref())?;
        check_writable(output)?;
        self.keep_inputs(scene)?;
        GaussianScene::check_place(output, scene)?;
        let before = self.resume.as_ref().map(|path| GaussianFile::open(path, scene)).transpose()?;
        let is_antialiased = self.antialias || before.as_ref().is_some_and(|before| before.scene.is_antialiased);
        if is_antialiased && is_of_one_colour {
            let problem = "no .html and no .splat says that Gaussians are antialiased; write a .ply or a .spz";
            return Err(Failure::Input(problem.to_owned()));
        }
        let recipe = RecipeOptions { quality, iterations, count, is_of_one_colour, is_antialiased, seed: self.seed };
        let optimisation = SceneOptimisation {
            weighting,
            options: render_options(self.size, &self.background)?,
            recipe,
            before,
            ..of_scene
        };
        let device = device(&self.device)?;
        let is_resumable = output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ply"));
        let ended = optimisation.run(&device, progress, |so_far| match is_resumable {
            true => so_far.write(output, &scene.frame),
            false => Ok(()),
        })?;
        write_optimised(output, scene, &optimisation.sources, &ended)?;
        Ok(PyGaussians {
            path: output.clone(),
            count: ended.gaussians.gaussians.len(),
            iterations: ended.done,
            fit: ended.fit.map(|(psnr, _)| psnr),
            scores: ended.scores,
        })
    }

    /// An output is none of the files that are read.
    fn keep_inputs(&self, scene: &Scene) -> Result<(), Failure> {
        let output = self.output.display();
        if scene.reads_file(&self.output) {
            let scene = scene.path.display();
            let text = format!("{output}: the scene {scene} is read from this file; give another file");
            return Err(Failure::Input(text));
        }
        let same = |input: &&PathBuf| match (canonicalize(input), canonicalize(&self.output)) {
            (Ok(input), Ok(output)) => input == output,
            _ => false,
        };
        match self.resume.as_ref().filter(same) {
            Some(input) => Err(Failure::Input(format!(
                "{output}: is the input {} itself, which is not replaced; give another name",
                input.display()
            ))),
            None => Ok(()),
        }
    }
}
