//! `viewfuse inspect`.

use clap::Args;
use image::DynamicImage;
use std::path::PathBuf;
use std::process::ExitCode;
use viewfuse::files::{check_writable, write_png};
use viewfuse::inspect::{Inspection, camera_map, inspect};
use viewfuse::photographs::BackgroundChoice;
use viewfuse::scene::Scene;

#[derive(Args)]
#[command(after_help = "Example:\n  viewfuse inspect photos/ -o cameras.png")]
pub(crate) struct Arguments {
    /// The scene
    scene: PathBuf,
    /// What is behind the object: auto, black, white, or RED,GREEN,BLUE (0 to 255)
    #[arg(long, value_name = "COLOUR", default_value = "auto")]
    background: BackgroundChoice,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
    /// Write a picture of the cameras seen from above
    #[arg(short, long, value_name = "PNG")]
    output: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let scene = Scene::open(&arguments.scene)?;
    arguments.output.as_deref().map_or(Ok(()), check_writable)?;
    let inspection = inspect(&scene, arguments.background);
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&inspection)?);
    } else {
        print_text(&inspection);
    }
    if let Some(path) = &arguments.output {
        write_png(path, &DynamicImage::ImageRgb8(camera_map(&scene, &inspection)))?;
        if !arguments.json {
            println!("cameras    {}", path.display());
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn print_text(inspection: &Inspection) {
    let point = |p: [f32; 3]| format!("({:.4}, {:.4}, {:.4})", p[0], p[1], p[2]);
    let i = inspection;
    println!("scene      {} ({})", i.path, i.layout);
    println!("views      {} photographs, {} target poses without one", i.photograph_count, i.target_count);
    println!(
        "image      {}x{}, focal {:.2} {:.2}, principal point {:.2} {:.2}",
        i.size[0], i.size[1], i.focal[0], i.focal[1], i.principal[0], i.principal[1]
    );
    println!("focus      {}, missed by the axes by {:.4} (root mean square)", point(i.focus), i.axis_miss);
    println!("distance   {:.4} to {:.4}", i.distances[0], i.distances[1]);
    println!("up         {}", point(i.up));
    match i.object {
        Some([low, high]) => println!("object     {} to {}", point(low), point(high)),
        None => println!("object     not found"),
    }
    println!("depth      near {:.4}, far {:.4}", i.near, i.far);
    match i.warnings.len() {
        0 => println!("warnings   none"),
        _ => i.warnings.iter().for_each(|warning| println!("warning    {warning}")),
    }
}
