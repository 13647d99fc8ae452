//! `viewfuse inspect`.

mod quality;

use super::options::MaskOption;
use super::outputs::{keep_file_apart, keep_others, refuse_extension};
use super::posed::PoseOption;
use super::printing::say;
use super::table::table;
use super::terminal::Terminal;
use clap::Args;
use image::DynamicImage;
use quality::Quality;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse_job::files::check_writable;
use viewfuse_output::camera_map::camera_map;
use viewfuse_output::png::write_marked_png;
use viewfuse_scene::inspect::{Inspection, inspect};
use viewfuse_scene::listing::{ListedView, Neighbour, list_views};
use viewfuse_scene::photographs::BackgroundChoice;

#[derive(Args)]
#[command(after_help = "Examples:\n  viewfuse inspect photos/ -o cameras.png\n  \
    viewfuse inspect photos/ --quality\n      \
    how good pictures will be, before they are rendered\n  viewfuse inspect photos/ --views\n      names, and the \
    numbers that stand for them: --targets '#3' is the view of index 3")]
pub(crate) struct Arguments {
    /// The scene
    scene: PathBuf,
    #[command(flatten)]
    pose: PoseOption,
    /// Background of the object: auto, black, white, or RED,GREEN,BLUE (0 to 255)
    #[arg(long, value_name = "COLOUR", default_value = "auto")]
    background: BackgroundChoice,
    #[command(flatten)]
    masks: MaskOption,
    /// List the views: index, name, size, and the nearest views with the angle to each, seen from what the cameras look
    /// at
    #[arg(long, conflicts_with = "output")]
    views: bool,
    /// Leave photographs out, one at a time, render them coarsely from the others, and say which PSNR to expect: as
    /// long as `render` takes before its first picture, seconds for a dozen photographs
    #[arg(long, conflicts_with = "views")]
    quality: bool,
    /// List the keys and files of the scene that are not read, too
    #[arg(short, long)]
    verbose: bool,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
    /// Write a picture of the cameras seen from above
    #[arg(short, long, value_name = "PNG")]
    output: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let (_, scene) = arguments.pose.open(&arguments.scene, &arguments.masks)?;
    if arguments.views {
        return print_views(&list_views(&scene), arguments.json);
    }
    arguments.output.as_deref().map_or(Ok(()), check_writable)?;
    arguments.output.as_deref().map_or(Ok(()), |path| keep_file_apart([&scene], path))?;
    arguments.output.as_deref().map_or(Ok(()), |path| refuse_extension(path, "a picture as PNG", &["png"]))?;
    arguments.output.as_deref().map_or(Ok(()), keep_others)?;
    let progress = Terminal::new("reading the photographs");
    let inspection = inspect(&scene, arguments.background, &progress)?;
    let measure = || Quality::of(&scene, arguments.background, &progress);
    let quality = arguments.quality.then(measure).transpose()?;
    drop(progress);
    if arguments.json {
        let document = Document { inspection: &inspection, quality: quality.as_ref() };
        say(format_args!("{}", serde_json::to_string_pretty(&document)?))?;
    } else {
        print_text(&inspection)?;
        if arguments.verbose {
            inspection.unused.iter().try_for_each(|unused| say(format_args!("not read   {unused}")))?;
        }
        match &quality {
            Some(quality) => quality.print()?,
            None => say("expected   --quality leaves photographs out and says which PSNR to expect")?,
        }
        print_warnings(&inspection)?;
    }
    if let Some(path) = &arguments.output {
        write_marked_png(path, &DynamicImage::ImageRgb8(camera_map(&scene, &inspection)))?;
        if !arguments.json {
            say(format_args!("cameras    {}", path.display()))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// What is printed as JSON.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    inspection: &'a Inspection,
    #[serde(skip_serializing_if = "Option::is_none")]
    quality: Option<&'a Quality>,
}

fn print_views(views: &[ListedView], as_json: bool) -> anyhow::Result<ExitCode> {
    if as_json {
        say(format_args!("{}", serde_json::to_string_pretty(views)?))?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut rows = table(["index", "name", "size", "nearest views"].map(str::to_owned));
    for view in views {
        let near = |neighbour: &Neighbour| format!("{} ({:.1}\u{b0})", views[neighbour.index].name, neighbour.degrees);
        let neighbours: Vec<String> = view.neighbours.iter().map(near).collect();
        let [width, height] = view.size;
        let size = format!("{width}x{height}{}", if view.has_photograph { "" } else { ", no photograph" });
        rows.add_row([format!("#{}", view.index), view.name.clone(), size, neighbours.join(", ")]);
    }
    say(rows)?;
    Ok(ExitCode::SUCCESS)
}

fn print_text(inspection: &Inspection) -> std::io::Result<()> {
    let i = inspection;
    // Four decimals of the scene's own unit: of one that is measured in thousandths, all would be zeros.
    let usual = (0.1..1.0e4).contains(&i.distances[1]);
    let number = |x: f32| if usual { format!("{x:.4}") } else { format!("{x:.4e}") };
    let point = |p: [f32; 3]| format!("({}, {}, {})", number(p[0]), number(p[1]), number(p[2]));
    say(format_args!("scene      {} ({})", i.path, i.layout))?;
    say(format_args!("views      {} photographs, {} target poses without one", i.photograph_count, i.target_count))?;
    say(format_args!(
        "image      {}x{}, focal {:.2} {:.2}, principal point {:.2} {:.2}",
        i.size[0], i.size[1], i.focal[0], i.focal[1], i.principal[0], i.principal[1]
    ))?;
    if i.lens_count + i.mask_count + i.point_count > 0 {
        let (lenses, masks, points) = (i.lens_count, i.mask_count, i.point_count);
        say(format_args!("with       {lenses} lenses to undo, {masks} masks, {points} reconstructed points"))?;
    }
    i.conventions.iter().try_for_each(|convention| say(format_args!("read as    {convention}")))?;
    if i.origin != [0.0; 3] || i.unit != 1.0 {
        let [x, y, z] = i.origin;
        say(format_args!("frame      the file's ({x}, {y}, {z}) is the origin, its {} the unit", i.unit))?;
    }
    let miss = number(i.axis_miss);
    say(format_args!("focus      {}, missed by the axes by {miss} (root mean square)", point(i.focus)))?;
    say(format_args!("distance   {} to {}", number(i.distances[0]), number(i.distances[1])))?;
    say(format_args!("up         {}", point(i.up)))?;
    if let Some([median, greatest]) = i.gaps {
        say(format_args!("neighbours {median:.0} degrees apart (median), at most {greatest:.0}"))?;
        // Without a minus before a zero.
        let [low, high] = i.elevations.map(|angle| angle.round() + 0.0);
        let around = match i.arc {
            360.0.. => "all around the focus".to_owned(),
            arc => format!("{arc:.0} of 360 degrees around the focus"),
        };
        say(format_args!("coverage   {around}, from {low:.0} to {high:.0} degrees above it"))?;
    }
    match i.object {
        Some([low, high]) => say(format_args!("object     {} to {}", point(low), point(high)))?,
        None => say(format_args!("object     none cut out: whole photographs"))?,
    }
    say(format_args!("depth      near {}, far {}", number(i.near), number(i.far)))
}

fn print_warnings(inspection: &Inspection) -> std::io::Result<()> {
    if inspection.warnings.is_empty() {
        say("warnings   none")?;
    }
    inspection.warnings.iter().try_for_each(|warning| say(format_args!("warning    {warning}")))
}
