//! `viewfuse render`: prepare, then stream or write.

mod identity;
mod outputs;
mod prepare;
mod stream;
mod summary;
mod write;

use super::model::{Flags, ModelOptions, SEQUENCE, chosen_scheme, of_fields, scene_help};
use super::options::{BoundOptions, DeviceOptions, OmissionOptions, PictureOptions, SourceOptions};
use super::path::PathOptions;
use super::posed::PoseOption;
use super::terminal::Terminal;
use super::weighting::choice_help;
use clap::Args;
use outputs::OutputOptions;
use prepare::Prepared;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viewfuse_field::AnyField;
use viewfuse_field::auto;
use viewfuse_field::gaussians::GivenGaussians;
use viewfuse_scene::Scene;
use viewfuse_weighting::{Weighting, WeightingChoice};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse render photos/ --orbit 24 -o out\n      24 views around what the cameras look at, from photograph to \
    photograph\n  viewfuse render dino/ --targets '#1,#4,#7' --size 160x120 -o out\n      views 1, 4 and 7 from the other \
    thirteen, with scores\n  viewfuse render car/ --targets 5 --sources all/3 --weights mean -o out\n      view 5 from \
    every third view, averaged instead of weighted\n  viewfuse render photos/ --between 3 7 --frames 120 --video \
    webp,mp4 -o out\n      the way from view 3 to view 7 as a video\n  viewfuse render photos/ --camera-path \
    camera_path.json -o - | ffplay -\n      a path from nerfstudio's viewer, played as it comes\n  viewfuse render \
    photos/ --gaussians photos.ply --orbit 24 -o out\n      the Gaussians that `optimise` wrote\n\n\
    Writes NAME.png, NAME_depth.png (16 bit; scale in run.json; none with a GeNVS), NAME_confidence.png (8 bit; where \
    the field tells) and, where there is a photograph to compare it with, NAME_sheet.png for each target, and \
    run.json. A run that was interrupted continues where it was when it is started again. With `-o -` the pictures go to \
    standard output as y4m, and nothing is written.\n\n\
    Real photographs, seconds of two cores for the first picture, of it the choice: seven of 512x341 pixels 18 and 11, \
    with --fast 6; ten of 320x240 in which Gaussians are mixed 40 and 15, with --fast 6. With --cache the choice is \
    kept for the same sources and options: the next picture takes 8 and 21.")]
pub(crate) struct Arguments {
    #[arg(help = scene_help())]
    scene: PathBuf,
    #[command(flatten)]
    pose: PoseOption,
    /// Views to render, as for --sources; they are no sources, unless all views are rendered from --gaussians [default: the
    /// scene's target poses]
    #[arg(long, value_name = "VIEWS")]
    targets: Option<String>,
    #[command(flatten)]
    path: PathOptions,
    #[command(flatten)]
    sources: SourceOptions,
    #[arg(long, value_name = "SCHEME", help = choice_help())]
    weights: Option<WeightingChoice>,
    /// Try nothing: take the scheme that is best for most scenes, distance:power=2, and mix nothing, in a sixth to a
    /// third of the time; there is no expected PSNR
    #[arg(long, conflicts_with = "weights")]
    fast: bool,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    omissions: OmissionOptions,
    #[command(flatten)]
    bound: BoundOptions,
    #[command(flatten)]
    model: ModelOptions,
    #[command(flatten)]
    sequence: Flags<SEQUENCE>,
    /// Render the Gaussians of this file, of `optimise` or of another program, in the coordinates of the scene's files
    #[arg(long, value_name = "FILE", conflicts_with_all = of_fields(true), conflicts_with = "fast")]
    gaussians: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceOptions,
    /// Seed of every random draw (the training-free field makes none)
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    outputs: OutputOptions,
    /// Folder for the results, made if missing; `-` for y4m on standard output
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

impl Arguments {
    /// The weighting; `None` where the scene is to decide.
    fn weighting(&self) -> anyhow::Result<Option<Weighting>> {
        let chosen = chosen_scheme(self.weights.as_ref(), &self.model, self.gaussians.as_deref())?;
        Ok(chosen.or_else(|| self.fast.then(auto::usual)))
    }

    /// The field that renders the scene.
    fn field(&self, scene: &Scene) -> anyhow::Result<AnyField> {
        match &self.gaussians {
            Some(path) => Ok(GivenGaussians::open(path, scene)?.into()),
            None => self.model.open(self.seed, Some(&self.sequence)),
        }
    }

    /// Whether the pictures go to standard output.
    fn is_stream(&self) -> bool {
        self.output == Path::new("-")
    }

    /// The files of the field.
    fn files(&self) -> impl Iterator<Item = &Path> {
        self.model.network.file().into_iter().chain(self.gaussians.as_deref())
    }
}

/// `values` are all options and their values as a person would write them.
pub(crate) fn run(arguments: &Arguments, values: &BTreeMap<String, String>) -> anyhow::Result<ExitCode> {
    let prepared = Prepared::open(arguments, values)?;
    let progress = Terminal::new("rendering");
    prepared.warn_of_leaving(arguments, &progress);
    if arguments.is_stream() {
        stream::to_stdout(arguments, &prepared, &progress)?;
    } else {
        write::to_folder(arguments, prepared, progress)?;
    }
    Ok(ExitCode::SUCCESS)
}
