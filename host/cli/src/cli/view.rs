//! `viewfuse view`.

use super::model::{ModelOptions, chosen_scheme, of_fields, scene_help};
use super::options::{BoundOptions, DeviceOptions, OmissionOptions, PictureOptions, SourceOptions};
use super::posed::PoseOption;
use super::printing::{counted, say, warn_of};
use super::terminal::Terminal;
use super::threads::on_threads;
use super::weighting::choice_help;
use clap::Args;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use viewfuse_device::choice::Chosen;
use viewfuse_field::gaussians::GivenGaussians;
use viewfuse_field::render::RenderOptions;
use viewfuse_job::shell::quoted;
use viewfuse_scene::few_shot::item_of;
use viewfuse_view::{Commands, ViewError, Viewed, Viewer};
use viewfuse_weighting::{Weighting, WeightingChoice};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse view photos/\n      drag to turn around the subject, scroll or pinch to move; see which photographs \
    count\n  viewfuse view car/ --model genvs.safetensors --sources 1,5,9 --device vulkan\n      a learned field, from \
    three views\n  viewfuse view photos/ --gaussians photos.ply\n      the Gaussians that `optimise` wrote: thirty \
    pictures a second while the hand drags\n  viewfuse view photos/ --port 8000 --no-browser\n      only prints the \
    address: for another browser, or through a tunnel (ssh -L 8000:127.0.0.1:8000)\n\n\
    The page is for this machine alone, under an address that nobody can guess. Ctrl-C ends it.")]
pub(crate) struct Arguments {
    #[arg(help = scene_help())]
    scene: PathBuf,
    #[command(flatten)]
    pose: PoseOption,
    #[command(flatten)]
    sources: SourceOptions,
    #[arg(long, value_name = "SCHEME", help = choice_help())]
    weights: Option<WeightingChoice>,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    omissions: OmissionOptions,
    #[command(flatten)]
    bound: BoundOptions,
    #[command(flatten)]
    model: ModelOptions,
    /// Show the Gaussians of this file, of `optimise` or of another program, in the coordinates of the scene's files
    #[arg(long, value_name = "FILE", conflicts_with_all = of_fields(false))]
    gaussians: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceOptions,
    /// Seed of every random draw (the training-free field makes none)
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Port of the page [default: any that is free]
    #[arg(long, value_name = "PORT", default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Print the address, and open no browser
    #[arg(long)]
    no_browser: bool,
}

/// Options that only this command has, or that the page gives anew.
const NOT_OF_RENDER: [&str; 6] = ["port", "no-browser", "weights", "sources", "views", "pose"];

/// `given` are the options on the command line, by long name, each with its value if it takes one.
pub(crate) fn run(arguments: &Arguments, given: &[(String, Option<String>)]) -> anyhow::Result<ExitCode> {
    let scheme = chosen_scheme(arguments.weights.as_ref(), &arguments.model, arguments.gaussians.as_deref())?;
    let (chooses, weighting) = (scheme.is_none(), scheme.unwrap_or_else(Weighting::default_scheme));
    let (folder, scene) = arguments.pose.open(&arguments.scene, &arguments.picture.masks)?;
    warn_of(&scene);
    let field = match &arguments.gaussians {
        Some(path) => GivenGaussians::open(path, &scene)?.into(),
        None => arguments.model.open(arguments.seed, None)?,
    };
    let about = field.about();
    let sources = arguments.sources.to_selection(None, None).sources_without(&scene, &[], about.least_sources)?;
    let options = arguments.omissions.omitting(arguments.picture.to_render_options(), arguments.model.exact, &about)?;
    let options = arguments.bound.bounded(options, &about, arguments.model.says_omissions());
    let options = RenderOptions { is_rounded: true, ..options };
    let Chosen { device, reason } = arguments.device.open()?;
    on_threads(arguments.picture.threads, || -> anyhow::Result<()> {
        let viewed = Viewed {
            scene: &scene,
            sources: &sources,
            field: &field,
            device: &device,
            options: &options,
            weighting: &weighting,
            chooses,
        };
        let commands = commands(&folder, given, &viewed);
        let viewer = Viewer::listen(viewed, commands, arguments.port).map_err(plain)?;
        let (count, path) = (counted(sources.len(), "source"), folder.display());
        say(format_args!("{path}: {count}, {} on {}, {reason}", about.name, viewer.device_name))?;
        say(format_args!("{}", viewer.address()))?;
        if !arguments.no_browser && !start_browser(&viewer.address().to_string()) {
            say("no browser could be started: open this address")?;
        }
        viewer.serve(&Terminal::without_bar()).map_err(plain)
    })??;
    Ok(ExitCode::SUCCESS)
}

/// Shows a page with the system's own opener; whether there is one.
fn start_browser(address: &str) -> bool {
    let (program, arguments): (&str, &[&str]) = match std::env::consts::OS {
        "windows" => ("cmd", &["/c", "start", ""]),
        "macos" => ("open", &[]),
        _ => ("xdg-open", &[]),
    };
    let mut command = Command::new(program);
    command.args(arguments).arg(address).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().is_ok()
}

/// The error behind a viewer's, so that its hint is found.
fn plain(error: ViewError) -> anyhow::Error {
    match error {
        ViewError::Listen(error) => error.into(),
        ViewError::Render(error) => error.into(),
    }
}

/// The command line that renders a view of the page.
fn commands(folder: &Path, given: &[(String, Option<String>)], viewed: &Viewed<'_>) -> Commands {
    let Viewed { scene, sources, weighting: first, .. } = viewed;
    let mut options = String::new();
    if given.iter().any(|(name, _)| name == "sources" || name == "views") {
        let items: Vec<String> = sources.iter().map(|&view| item_of(scene, view)).collect();
        options = format!(" --sources {}", quoted(items.join(",")));
    }
    for (name, value) in given.iter().filter(|(name, _)| !NOT_OF_RENDER.contains(&name.as_str())) {
        options += &format!(" --{name}");
        options.extend(value.iter().map(|value| format!(" {}", quoted(value))));
    }
    let first_weights = if viewed.chooses { WeightingChoice::Auto.to_string() } else { first.to_string() };
    let render = format!("viewfuse render {}", quoted(folder));
    Commands { render, options, first_weights: quoted(first_weights) }
}
