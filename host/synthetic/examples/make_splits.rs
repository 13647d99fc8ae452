//! Makes what `evaluate --protocol blender:8` needs of a scene in the layout of NeRF's synthetic ones, the toy lorry at 400 x 400:
//! `cargo run --release -p viewfuse-synthetic --example make_splits -- FOLDER`.
//!
//! The training split has the protocol's eight source views of a hundred random ones, the test split every eighth of two
//! hundred on a spiral, each with its number in its name.

use anyhow::{Context, bail};
use std::path::PathBuf;
use viewfuse_job::progress::Silent;
use viewfuse_synthetic::cameras::{random_views, sphere, spiral_views};
use viewfuse_synthetic::splits::write_splits;
use viewfuse_synthetic::toy::lorry;

/// Sources of the protocol.
const SOURCES: [u32; 8] = [26, 86, 2, 55, 75, 93, 16, 73];
/// Rays of a pixel along each axis.
const RAYS_PER_SIDE: u32 = 3;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args_os().skip(1);
    let (Some(folder), None) = (arguments.next().map(PathBuf::from), arguments.next()) else {
        bail!("usage: make_splits FOLDER, where FOLDER does not exist yet");
    };
    let sphere = sphere(400)?;
    let number = |views: Vec<_>| (0..).zip(views).collect::<Vec<(u32, _)>>();
    let mut train = number(random_views(&sphere, 0, 0, 100)?);
    train.retain(|(view, _)| SOURCES.contains(view));
    let mut test = number(spiral_views(&sphere, 200)?);
    test.retain(|(view, _)| view % 8 == 0);
    let validation = test.iter().take(1).copied().collect();
    let splits = [("train", train), ("val", validation), ("test", test)];
    write_splits(&folder, &lorry().context("the toy lorry")?, &splits, RAYS_PER_SIDE, &Silent)?;
    println!("{}: {} views", folder.display(), splits.iter().map(|(_, views)| views.len()).sum::<usize>());
    Ok(())
}
