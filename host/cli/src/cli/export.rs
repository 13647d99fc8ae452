//! `viewfuse export`.

use super::options::MaskOption;
use super::outputs::keep_folder_apart;
use super::printing::say;
use super::terminal::Terminal;
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse_scene::write::{Layout, write};

#[derive(Args)]
#[command(after_help = "Examples:\n  viewfuse export photos/ --layout colmap -o photos_colmap\n  \
    viewfuse export fern/ --layout transforms -o fern_nerfstudio\n\n\
    Photographs are copied as they are where the layout holds their lens and mask, otherwise written as the pinhole's \
    pictures. A layout that cannot hold the scene refuses it with the reason.")]
pub(crate) struct Arguments {
    /// The scene
    scene: PathBuf,
    /// How to lay it out: transforms, colmap, colmap-binary, srn, middlebury, llff or neus
    #[arg(long)]
    layout: Layout,
    /// Folder to write; must not be there yet, or be empty
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    #[command(flatten)]
    masks: MaskOption,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let scene = arguments.masks.open(&arguments.scene)?;
    keep_folder_apart([&scene], &arguments.output)?;
    let progress = Terminal::new("writing the photographs");
    let written = write(&scene, arguments.layout, &arguments.output, &progress)?;
    drop(progress);
    say(format_args!("read       {} ({})", scene.path.display(), scene.layout))?;
    let warnings = scene.pose_warnings();
    scene.warnings.iter().chain(&warnings).try_for_each(|warning| say(format_args!("warning    {warning}")))?;
    say(format_args!(
        "written    {} ({}): {} photographs",
        written.folder.display(),
        arguments.layout,
        written.photograph_count
    ))?;
    written.lost.iter().try_for_each(|line| say(format_args!("omitted    {line}")))?;
    Ok(ExitCode::SUCCESS)
}
