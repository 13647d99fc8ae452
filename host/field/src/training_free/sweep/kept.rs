//! What was found of the sources, kept in a folder between runs, so that a second command on the same scene need not
//! find it again.
//!
//! A file's name is the SHA-256 of all that its content depends on: photographs at the size of the comparison, cameras,
//! weights, settings, and what this program finds on this device in three small fixed images. Another version, driver
//! or photograph whose results could differ so finds nothing, and makes a file of its own. A person may delete any
//! file, or the folder. A file that is damaged, was kept under another name, or is not of this program, is not used:
//! what it should hold is found anew, and a warning says so.

use super::Sweep;
use super::matching::{Images, Matching, Range, swept};
use super::scratch::Scratch;
use crate::FieldError;
use bytemuck::{AnyBitPattern, NoUninit, bytes_of, cast_slice, pod_collect_to_vec};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock, Pinhole};
use viewfuse_core::pose::Pose;
use viewfuse_device::Device;
use viewfuse_job::digest::{SEAL, sealed, sha256, unsealed};
use viewfuse_job::files::{WriteError, check_writable, is_ordinary, read_at_most, write_whole};
use viewfuse_job::progress::Progress;
use viewfuse_kernels::plane_sweep::PLANES;
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};
use viewfuse_scene::photographs::SourceImage;

/// Of the form of the files.
const FORM: u32 = 2;
/// Columns and rows of the fixed images.
const PROBE: [u32; 2] = [24, 16];

/// A folder of what was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cache {
    folder: PathBuf,
}

/// A cache on a device.
#[derive(Clone, Debug)]
pub(super) struct Kept {
    cache: Cache,
    /// Digest of what the device finds in the fixed images.
    probe: String,
}

/// The name of what is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Key(String);

impl Cache {
    /// The cache in a folder, which is made if it is missing.
    ///
    /// # Errors
    /// [`WriteError`] if nothing can be written there.
    pub fn open(folder: &Path) -> Result<Cache, WriteError> {
        let failed = |cause| WriteError::Io { path: folder.to_path_buf(), cause };
        std::fs::create_dir_all(folder).map_err(failed)?;
        check_writable(&folder.join("file"))?;
        Ok(Cache { folder: folder.to_path_buf() })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }
}

impl Kept {
    pub(super) fn new<D: Device>(cache: Cache, device: &D, progress: &dyn Progress) -> Result<Kept, FieldError> {
        Ok(Kept { cache, probe: probe(device, progress)? })
    }

    /// The name of a source's disparities, from all that they depend on.
    pub(super) fn of_source(
        &self,
        settings: &Sweep,
        frustum: &FrustumBlock,
        swept: &[SweptView],
        texels: &[[f32; 4]],
    ) -> Key {
        // Where images lie in the buffers depends on other sources, and without maps nothing can be contradicted.
        let camera = CameraBlock { first_texel: 0, ..frustum.camera };
        let whole = FrustumBlock { camera, dissent_share: 0.0, ..*frustum };
        let mut bytes = bytes_of(&whole).to_vec();
        bytes.extend(settings.near_cost.to_le_bytes());
        for view in swept {
            let CameraBlock { first_texel, width, height, .. } = view.camera;
            let camera = CameraBlock { first_texel: 0, ..view.camera };
            bytes.extend(bytes_of(&SweptView { camera, first_disparity: 0, ..*view }));
            bytes.extend(cast_slice::<_, u8>(&texels[first_texel as usize..][..(width * height) as usize]));
        }
        self.key("disparities", &bytes)
    }

    /// The name of a scene's points, from its images.
    pub(super) fn of_scene(&self, images: &[SourceImage]) -> Key {
        let mut bytes = Vec::new();
        for image in images {
            bytes.extend(bytes_of(&image.camera.block(0)));
            bytes.extend(cast_slice::<_, u8>(&image.texels));
        }
        self.key("points", &bytes)
    }

    fn key(&self, what: &str, bytes: &[u8]) -> Key {
        let version = env!("CARGO_PKG_VERSION");
        Key(sha256(format!("{version} {FORM} {what} {} {}", self.probe, sha256(bytes)).as_bytes()))
    }

    fn path(&self, key: &Key) -> PathBuf {
        self.cache.folder.join(format!("{}.kept", key.0))
    }

    /// So many values that are kept under a name, all of finite numbers; `None` if there are none, or not as they were
    /// written.
    pub(super) fn read<T: NoUninit + AnyBitPattern>(
        &self,
        key: &Key,
        counts: RangeInclusive<usize>,
        progress: &dyn Progress,
    ) -> Option<Vec<T>> {
        let path = self.path(key);
        if is_ordinary(&path).is_ok_and(|is_there| !is_there) {
            return None;
        }
        let values = || {
            is_ordinary(&path).ok()?;
            let bytes = read_at_most(&path, (SEAL + counts.end() * size_of::<T>()) as u64).ok()?;
            let bytes = unsealed(&key.0, &bytes).filter(|bytes| bytes.len().is_multiple_of(size_of::<T>()))?;
            let values: Vec<T> = pod_collect_to_vec(bytes);
            let is_whole = counts.contains(&values.len());
            (is_whole && cast_slice::<T, f32>(&values).iter().all(|number| number.is_finite())).then_some(values)
        };
        let values = values();
        if values.is_none() {
            let folder = self.cache.folder.display();
            progress
                .warn(&format!("{folder}: holds files that are not as they were kept; what they are of is found anew"));
        }
        values
    }

    /// Keeps values, if there are any. That they cannot be kept costs the next run its time, and is a warning.
    pub(super) fn write<T: NoUninit>(&self, key: &Key, values: &[T], progress: &dyn Progress) {
        if values.is_empty() {
            return;
        }
        if let Err(error) = write_whole(&self.path(key), &sealed(&key.0, cast_slice(values))) {
            progress.warn(&format!("what was found of the sources is not kept: {error}"));
        }
    }
}

/// Digest of the disparities in the middle one of three small images.
fn probe<D: Device>(device: &D, progress: &dyn Progress) -> Result<String, FieldError> {
    let [width, height] = PROBE;
    let image = |view: u32| -> Result<SourceImage, FieldError> {
        let eye = Vec3::new(0.1 * view as f32, 0.0, 0.0);
        let pose = Pose::look_at(eye, eye + Vec3::Z, -Vec3::Y).map_err(FieldError::unsuitable)?;
        let centre = [0.5 * width as f32, 0.5 * height as f32];
        let pinhole = Pinhole::new([width as f32; 2], centre, width, height).map_err(FieldError::unsuitable)?;
        let shade = |at: u32| ((at + 3 * view).wrapping_mul(2_654_435_761) >> 24) as f32 / 255.0;
        let texel = |at: u32| [shade(at), shade(at + 1), shade(at + 2), 1.0];
        Ok(SourceImage { camera: Camera { pose, pinhole }, texels: (0..width * height).map(texel).collect() })
    };
    let images = Images::upload(device, &[image(0)?, image(1)?, image(2)?])?;
    let Sweep { near_cost, dissent_share, .. } = Sweep::default();
    let matching = Matching { device, has_silhouettes: false, near_cost, dissent_share, front_share: 0.0 };
    let swept = swept(&images.cameras, &images.cameras, &[(1, 1.0), (0, 0.5), (2, 0.25)], None, None);
    let frustum = matching.frustum(images.cameras[1], Range::new([0.1, 2.0], PLANES as u32), &swept);
    let mut maps = device.zeros::<[f32; 2]>(images.cameras.len() * (width * height) as usize)?;
    let mut scratch = Scratch::default();
    let means = matching.compared_means(&frustum, &swept, &images.texels, &maps, &mut scratch, progress)?;
    let costs = matching.costs(frustum, &means, &[], &maps, &mut scratch)?;
    device.pick_disparity(&frustum, &costs, &mut maps)?;
    Ok(sha256(cast_slice(&device.download(&maps)?)))
}
