//! Regenerates the repository's sample of a room: `cargo run --release -p viewfuse-synthetic --example make_room -- FOLDER`.
//!
//! The checked-in result is `tests/data/room`.

use anyhow::{Context, bail};
use std::path::PathBuf;
use viewfuse_job::progress::Silent;
use viewfuse_synthetic::photograph::RAYS_PER_SIDE;
use viewfuse_synthetic::{shoot, write_shoot};

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args_os().skip(1);
    let (Some(folder), None) = (arguments.next().map(PathBuf::from), arguments.next()) else {
        bail!("usage: make_room FOLDER, where FOLDER does not exist yet");
    };
    let room = shoot::sample().context("the sample of a room")?;
    write_shoot(&folder, &room, RAYS_PER_SIDE, &Silent)?;
    println!("{}: {} views", folder.display(), room.cameras().len());
    Ok(())
}
