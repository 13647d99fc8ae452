//! Which format a file of Gaussians has, by what is in it, and what it means for a scene.

use std::path::{Path, PathBuf};

use viewfuse_job::files::read_at_most;

use super::comments::Comments;
use super::place::GaussianPlace;
use super::{GaussianScene, compressed, harmonics, ply, refused, splat, spz};
use crate::parser_world::{PARSER, ParserWorld};
use crate::ply::PlyHeader;
use crate::scene::files::{has_extension, unreadable};
use crate::{Scene, SceneError, SceneFrame};

/// Most bytes of a file: 18 million Gaussians of degree 3.
const MAX_BYTES: u64 = 4 << 30;

/// Formats that are not read: how they begin or are called, what they are, the way out.
const OTHERS: [(&[u8], &str, &str); 4] = [
    (b"PK\x03\x04", "sog", "an archive, as a .sog of PlayCanvas"),
    (b"glTF", "glb", "a glTF file"),
    (b"NGSP", "", "a .spz without gzip, of version 4 or later"),
    (b"\x00\x01", "ksplat", "a .ksplat of GaussianSplats3D"),
];
/// The way out for them.
const WAY_OUT: &str = "it is not read; convert it to .ply with splat-transform or SuperSplat";

/// A file of Gaussians that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct GaussianFile {
    /// The Gaussians.
    pub scene: GaussianScene,
    /// What the file says beyond the Gaussians, what was done with it, and what is not known, one sentence each.
    pub notes: Vec<String>,
}

impl GaussianFile {
    /// Reads a file of Gaussians for a scene. If nerfstudio's `dataparser_transforms.json` is beside the file, or in
    /// the scene's folder, Gaussians that viewfuse did not write are in the world that it states.
    ///
    /// # Errors
    /// As [`GaussianScene::read`]; a file without Gaussians.
    pub fn open(path: &Path, scene: &Scene) -> Result<GaussianFile, SceneError> {
        let mut world = None;
        for place in parser_files(path, scene) {
            if world.is_none() {
                world = ParserWorld::beside(&place, scene)?.map(|world| (world, place));
            }
        }
        let file = read(path, &scene.frame, world.as_ref())?;
        match file.scene.gaussians.is_empty() {
            true => Err(refused(path, "the file has no Gaussians: there is nothing to show")),
            false => Ok(file),
        }
    }

    /// Reads a file in the coordinates of a scene's files: `frame` is the scene's.
    ///
    /// # Errors
    /// As [`GaussianScene::read`].
    pub fn read(path: &Path, frame: &SceneFrame) -> Result<GaussianFile, SceneError> {
        read(path, frame, None)
    }
}

/// Where the world may be stated that a file of Gaussians is in: beside the file, and in the scene's folder.
pub(super) fn parser_files(path: &Path, scene: &Scene) -> Vec<PathBuf> {
    let folder = if scene.path.is_dir() { Some(scene.path.as_path()) } else { scene.path.parent() };
    [Some(path.with_file_name(PARSER)), folder.map(|folder| folder.join(PARSER))].into_iter().flatten().collect()
}

fn read(path: &Path, frame: &SceneFrame, world: Option<&(ParserWorld, PathBuf)>) -> Result<GaussianFile, SceneError> {
    let bytes = read_at_most(path, MAX_BYTES).map_err(|cause| unreadable(path, cause))?;
    if bytes.is_empty() {
        return Err(refused(path, "the file is empty"));
    }
    let mut notes = Vec::new();
    let mut place = GaussianPlace::new(path, frame, world.map(|(world, _)| world));
    let known = |(magic, extension, _): &&(&[u8], &str, &str)| match *extension {
        // Two bytes are no proof.
        "ksplat" => bytes.starts_with(magic) && has_extension(path, &["ksplat"]),
        _ => bytes.starts_with(magic),
    };
    // First of all: such a file begins with the bytes of a number, which may be those that others begin with.
    let mut scene = if splat::is_likely(&bytes) {
        splat::read(path, &bytes, &place)?
    } else if bytes.starts_with(&[0x1f, 0x8b]) {
        if spz::is_by_viewfuse(&bytes) {
            place = GaussianPlace::new(path, frame, None);
        }
        spz::read(path, &bytes, &place, &mut notes)?
    } else if bytes.trim_ascii_start().starts_with(b"<") {
        return Err(refused(path, "a page or another text: Gaussians are not read from it; write them as .ply, too"));
    } else if let Some((_, _, what)) = OTHERS.iter().find(known) {
        return Err(refused(path, &format!("{what}: {WAY_OUT}")));
    } else if !bytes.starts_with(b"ply") && has_extension(path, &["splat"]) {
        splat::read(path, &bytes, &place)?
    } else {
        let header = PlyHeader::read(path, &bytes)?;
        let said = Comments::read(path, &header.comments)?;
        if said.is_by_viewfuse {
            place = GaussianPlace::new(path, frame, None);
        }
        place.origin = said.origin;
        notes
            .extend(said.unknown.iter().map(|comment| format!("comment \"{comment}\" is not known and has no effect")));
        let read = match compressed::is_of(&header) {
            true => compressed::read(path, &bytes, &header, &place)?,
            false => ply::read(path, &bytes, &header, &place, &mut notes)?,
        };
        if (read.is_antialiased || said.is_antialiased) && !said.is_by_viewfuse {
            notes.push(
                "splats are dilated by 0.3 square pixels: programs that dilate by 0.1 (mip-splatting, Brush) draw those \
                 of less than a pixel sharper"
                    .to_owned(),
            );
        }
        GaussianScene { is_antialiased: said.is_antialiased || read.is_antialiased, ..read }
    };
    if scene.is_antialiased {
        notes.push("antialiased: each splat is fainter by as much as its dilation widens it".to_owned());
    }
    if let (Some(rotation), Some((_, file))) = (place.rotation(), world) {
        harmonics::rotate(&mut scene.f_rest, scene.degree, rotation);
        notes.push(format!("in the world of nerfstudio's training, which {} states", file.display()));
    }
    let notes = notes.into_iter().map(|note| format!("{}: {note}", path.display())).collect();
    Ok(GaussianFile { scene, notes })
}
