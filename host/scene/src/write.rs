//! Writing a scene out, in each layout that can hold it.
//!
//! Poses are written in the coordinates of the scene's own files ([`crate::SceneFrame`]). Photographs are copied
//! unchanged if the layout can hold their lens and their mask; otherwise they are written undistorted, with the mask as
//! the alpha channel. In NeRF's and COLMAP's layouts masks say which pixels do not count: those of an object become the
//! alpha channel, of photographs that are not undistorted. A layout that cannot hold a scene refuses it with the
//! reason; data that is lost without changing what the cameras see (points, near and far bounds, splits) is listed in
//! [`Written::lost`].
//!
//! The folder appears whole or not at all: it is filled under a temporary name in the same folder, opened as any scene
//! (`readback`), and renamed.

mod colmap;
mod llff;
mod middlebury;
mod names;
mod neus;
mod photographs;
mod readback;
mod srn;
mod transforms;

use std::fs;
use std::path::{Path, PathBuf};

use viewfuse_job::files::WholeFolder;
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_job::progress::{Interrupted, Progress};

use crate::photographs::ignored::shows_object;
use crate::scene::files::has_extension;
use crate::scene::masks::has_alpha;
use crate::{MaskChoice, MaskMeaning, Scene, SceneError, View};
pub use names::check_name;

/// A layout in which scenes can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// `transforms.json`, `images/`, `masks/`, as nerfstudio reads them.
    Transforms,
    /// `sparse/0/*.txt`, `images/`, `masks/`.
    Colmap,
    /// `sparse/0/*.bin`, `images/`, `masks/`.
    ColmapBinary,
    /// `rgb/`, `pose/`, `target_pose/`, `intrinsics.txt`.
    Srn,
    /// `scene_par.txt` next to the photographs.
    Middlebury,
    /// `poses_bounds.npy`, `images/`.
    Llff,
    /// `cameras_sphere.npz`, `image/`, `mask/`, as NeuS reads DTU.
    Neus,
}

viewfuse_job::named! {
    pub Layout: "a layout that is written" {
        Transforms => "transforms",
        Colmap => "colmap",
        ColmapBinary => "colmap-binary",
        Srn => "srn",
        Middlebury => "middlebury",
        Llff => "llff",
        Neus => "neus",
    }
}

impl Layout {
    /// The name of the reader that reads it ([`Scene::layout`]).
    pub const fn reader(self) -> &'static str {
        match self {
            Layout::ColmapBinary => Layout::Colmap.name(),
            text => text.name(),
        }
    }

    /// Whether it keeps reconstructed points and the photographs' lenses.
    const fn is_colmap(self) -> bool {
        matches!(self, Layout::Colmap | Layout::ColmapBinary)
    }
}

/// Why a scene was not written.
#[derive(Debug, thiserror::Error)]
pub enum WriteSceneError {
    /// The layout cannot hold the scene: the content that it cannot hold.
    #[error("{0}: the layout {1} cannot hold this scene: {2}")]
    Unfit(PathBuf, Layout, String),
    /// The path exists already.
    #[error("{}: exists already and is not an empty folder; give another name", .0.display())]
    Occupied(PathBuf),
    /// The operating system reported an error for a file or folder.
    #[error("{0}: cannot be written: {1}")]
    Io(PathBuf, std::io::Error),
    /// A photograph could not be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A photograph could not be encoded.
    #[error("{0}: cannot be encoded: {1}")]
    Encode(PathBuf, image::ImageError),
    /// The person stopped the work.
    #[error("interrupted")]
    Interrupted(#[from] Interrupted),
}

impl Hinted for WriteSceneError {
    fn hint(&self) -> Option<Hint> {
        match self {
            WriteSceneError::Scene(error) => error.hint(),
            _ => None,
        }
    }
}

/// The result of writing a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The folder.
    pub folder: PathBuf,
    /// Number of photographs.
    pub photograph_count: usize,
    /// The content that the layout does not hold, a line each.
    pub lost: Vec<String>,
}

/// Writes a scene in a layout to a folder that does not exist or is empty.
///
/// # Errors
/// [`WriteSceneError`]; no files remain then.
pub fn write(
    scene: &Scene,
    layout: Layout,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<Written, WriteSceneError> {
    write_with(scene, layout, folder, &[], progress)
}

/// As [`write()`], with more files in the folder, each a name and its bytes: they appear with the scene or not at all.
///
/// # Errors
/// [`WriteSceneError`]; no files remain then.
pub fn write_with(
    scene: &Scene,
    layout: Layout,
    folder: &Path,
    beside: &[(&str, Vec<u8>)],
    progress: &dyn Progress,
) -> Result<Written, WriteSceneError> {
    let failed = |cause| WriteSceneError::Io(folder.to_path_buf(), cause);
    let is_empty = || fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
    if folder.is_symlink() || folder.exists() && !is_empty() {
        return Err(WriteSceneError::Occupied(folder.to_path_buf()));
    }
    let unfit = |reason| WriteSceneError::Unfit(scene.path.clone(), layout, reason);
    scene.views.iter().try_for_each(|view| check_name(layout, &view.name)).map_err(unfit)?;
    match layout {
        Layout::Transforms | Layout::Colmap | Layout::ColmapBinary | Layout::Middlebury => all_photographed(scene),
        Layout::Neus => all_photographed(scene).and_then(|()| neus::fits(scene)),
        Layout::Srn => srn::fits(scene),
        Layout::Llff => all_photographed(scene).and_then(|()| llff::fits(scene)),
    }
    .map_err(unfit)?;
    if let MaskMeaning::Unclear { .. } = scene.masks {
        // A layout holds each meaning in a way of its own: the error of the first.
        let first = scene.views.iter().position(|view| view.mask.is_some());
        first.map_or(Ok(()), |view| scene.photograph(view).map(drop))?;
    }

    let unfinished = WholeFolder::create(folder).map_err(failed)?;
    let draft = unfinished.path();
    let names = names_in(scene, layout);
    let mut out = Draft { folder: &draft, scene, names: names.clone(), progress };
    progress.expect(scene.views.iter().filter(|view| view.image.is_some()).count());
    let photograph_count = match layout {
        Layout::Transforms => transforms::write(&mut out)?,
        Layout::Colmap => colmap::write(&mut out, colmap::Form::Text)?,
        Layout::ColmapBinary => colmap::write(&mut out, colmap::Form::Binary)?,
        Layout::Srn => srn::write(&mut out)?,
        Layout::Middlebury => middlebury::write(&mut out)?,
        Layout::Llff => llff::write(&mut out)?,
        Layout::Neus => neus::write(&mut out)?,
    };
    let read = readback::check(scene, layout, &draft, &names).map_err(unfit)?;
    beside.iter().try_for_each(|(name, bytes)| out.put(name, bytes))?;
    // While what was read is where it was read.
    let lost = lost(scene, layout, &read);
    unfinished.finish().map_err(failed)?;
    Ok(Written { folder: folder.to_path_buf(), photograph_count, lost })
}

/// A folder that is being filled.
struct Draft<'a> {
    folder: &'a Path,
    scene: &'a Scene,
    /// Those of its views in the layout.
    names: Vec<String>,
    progress: &'a dyn Progress,
}

impl Draft<'_> {
    /// The path of a file in it; creates the file's folder.
    fn file(&self, name: &str) -> Result<PathBuf, WriteSceneError> {
        let path = self.folder.join(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|cause| WriteSceneError::Io(folder.to_path_buf(), cause))?;
        }
        Ok(path)
    }

    /// Writes a file.
    fn put(&self, name: &str, contents: impl AsRef<[u8]>) -> Result<(), WriteSceneError> {
        let path = self.file(name)?;
        fs::write(&path, contents).map_err(|cause| WriteSceneError::Io(path, cause))
    }
}

/// The names of a scene's views in a layout: their own, unless that numbers them.
fn names_in(scene: &Scene, layout: Layout) -> Vec<String> {
    let numbered = (layout == Layout::Neus).then(|| neus::numbered(scene)).flatten();
    numbered.unwrap_or_else(|| scene.views.iter().map(|view| view.name.clone()).collect())
}

/// Refuses poses without a photograph.
fn all_photographed(scene: &Scene) -> Result<(), String> {
    match scene.views.iter().find(|view| view.image.is_none()) {
        Some(view) => Err(format!("view {:?} is a pose without a photograph, or with one that is excluded", view.name)),
        None => Ok(()),
    }
}

/// The content that a layout does not hold, of a scene that is `read` from it.
fn lost(scene: &Scene, layout: Layout, read: &Scene) -> Vec<String> {
    let views = |has: &dyn Fn(&View) -> bool| scene.views.iter().filter(|view| has(view)).count();
    let mut lines = Vec::new();
    if !layout.is_colmap() && !scene.points.is_empty() {
        lines.push(format!("{} reconstructed points", scene.points.len()));
    }
    if let Some([least, greatest]) = llff::differing_focals(scene).filter(|_| layout == Layout::Llff) {
        lines.push(format!(
            "for NeRF's own program, the focal lengths: it takes the first photograph's for all, which are {least:.1} to \
             {greatest:.1} pixels here"
        ));
    }
    let depths = views(&|view| view.near_far.is_some());
    if layout != Layout::Llff && !(layout == Layout::Neus && neus::has_unit_sphere(scene)) && depths > 0 {
        lines.push(format!("near and far depths of {depths} views"));
    }
    let names = names_in(scene, layout);
    if layout == Layout::Neus && neus::numbered(scene).is_some() {
        lines.push("the names of the photographs, which are numbered".to_owned());
    }
    if !names.iter().eq(read.views.iter().map(|view| &view.name)) {
        lines.push("the order of the views, which is that of their names there".to_owned());
    }
    if layout.is_colmap() && scene.points.iter().any(|point| !point.views.is_empty()) {
        lines.push(
            "where features were found in the photographs: the points' projections stand there, so that a bundle \
             adjustment has nothing to refine"
                .to_owned(),
        );
    }
    let is_said = |view: &View| {
        let may_have_alpha = |file: &Path| !has_extension(file, &["jpg", "jpeg"]);
        view.mask.is_none() && view.image.as_deref().is_some_and(may_have_alpha)
    };
    // NeuS's masks say it.
    if scene.mask_choice == MaskChoice::Object && layout != Layout::Neus && scene.views.iter().any(is_said) {
        lines.push("that alpha channels say where the object is, which must be said of this folder, too".to_owned());
    }
    let are_masks =
        |scene: &Scene| scene.masks == MaskMeaning::Ignore && scene.views.iter().any(|view| view.mask.is_some());
    if are_masks(scene) && !are_masks(read) && read.views.iter().any(|view| view.mask.is_some()) {
        lines.push("that masks say which pixels do not count, which must be said of this folder, too".to_owned());
    }
    let has_object = read.views.iter().any(|view| read.has_object_mask(view));
    if layout == Layout::Neus && !has_object {
        lines.push(
            "masks, of which there are none: NeuS's own program needs mask/, in which white pictures will do"
                .to_owned(),
        );
    }
    if layout == Layout::Neus && !neus::has_unit_sphere(scene) && !has_object {
        let (_, radius) = neus::sphere(scene);
        // Three digits that say something, whatever the unit of length.
        let digits = (2.0 - radius.log10().floor()).clamp(0.0, 12.0) as usize;
        lines.push(format!(
            "of whole photographs what is farther than {radius:.digits$} from the point that the cameras look at: \
             programs that read this layout look for surfaces within that sphere"
        ));
    }
    let is_transparent = |(index, view): (usize, &View)| {
        let may_be = view.image.as_deref().is_some_and(has_alpha);
        may_be && read.photograph(index).is_ok_and(|photograph| photograph.has_alpha)
    };
    if layout == Layout::Neus && !has_object && read.views.iter().enumerate().any(is_transparent) {
        lines.push(
            "for NeuS's own program, that what is transparent does not count: it reads no alpha channel".to_owned(),
        );
    }
    if layout == Layout::Neus && neus::is_far(scene) {
        lines.push(
            "for NeuS's own program, where the cameras are: it reads matrices in f32, which is too coarse so far from \
             the origin of coordinates"
                .to_owned(),
        );
    }
    let parts = views(&|view| view.split.is_some());
    if layout != Layout::Transforms && parts > 0 {
        lines.push(format!("the part of the scene that {parts} views belong to"));
    }
    let masks = scene.views.iter().filter(|view| view.mask.is_some() && !scene.has_object_mask(view)).count();
    let become_alpha = layout != Layout::Transforms && !layout.is_colmap() && masks > 0;
    if become_alpha {
        lines.push(format!("the ignore masks of {masks} photographs: what does not count is transparent"));
    }
    // Where they hide most of the border they are read as an object's. What cannot be read was not written.
    let are_ignored = become_alpha || scene.mask_choice == MaskChoice::Ignore && scene.views.iter().any(is_said);
    if are_ignored && shows_object(read).unwrap_or(false) {
        lines.push(
            "that alpha channels say which pixels do not count, which must be said of this folder, too".to_owned(),
        );
    }
    let lenses = match layout {
        Layout::Transforms => views(&|view| view.lens.is_some_and(|lens| !transforms::holds(scene, &lens))),
        Layout::Colmap | Layout::ColmapBinary => views(&|view| view.lens.is_some_and(|lens| !colmap::holds(&lens))),
        _ => views(&|view| view.lens.is_some()),
    };
    if lenses > 0 {
        lines.push(format!(
            "the lens of {lenses} photographs: they are undistorted, and what the lens did not see is not marked"
        ));
    }
    lines
}

/// `[R | t]` of the inverse: world-to-camera, row-major.
fn camera_from_world(scene: &Scene, view: &View) -> [[f64; 4]; 3] {
    let m = scene.frame.file_from_camera(&view.camera.pose);
    let row = |row: usize| {
        let [a, b, c] = [m[0][row], m[1][row], m[2][row]];
        [a, b, c, -(a * m[0][3] + b * m[1][3] + c * m[2][3])]
    };
    [row(0), row(1), row(2)]
}

/// Numbers separated by spaces, with as many digits as needed to read back the same values.
fn words(numbers: impl IntoIterator<Item = f64>) -> String {
    numbers.into_iter().map(|number| number.to_string()).collect::<Vec<_>>().join(" ")
}
