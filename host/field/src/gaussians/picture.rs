//! Pictures of Gaussians and their derivatives, on a device.

use super::tiles::Tiles;
use crate::{Rendered, Rounded};
use viewfuse_core::camera::CameraBlock;
use viewfuse_device::{Device, DeviceError, Later};
use viewfuse_kernels::gaussians::shown::bytes_of_pixel;
use viewfuse_kernels::gaussians::{SplatBlock, TileBlock};
use viewfuse_kernels::rows::{
    GaussianBlock, HarmonicTerm, ListBlock, ParticleBlock, ProjectedGaussian, STATUS_NUMBERS, TILE_RUN,
};

/// Makes pictures of Gaussians on a device.
#[derive(Debug)]
pub struct Splatter<'d, D: Device> {
    /// The device.
    pub device: &'d D,
    /// Depth along the principal axis from which on Gaussians are seen, world units, above 0.
    pub near: f32,
    /// What is seen where nothing is: red, green, blue.
    pub background: [f32; 3],
    /// Whether splats keep their integral when they are dilated.
    pub is_antialiased: bool,
    /// Spherical harmonics of their colours, `[gaussian][term]`, and how many terms each has; without them, colours are
    /// the same from everywhere.
    pub harmonics: Option<(&'d D::Buffer<HarmonicTerm>, u32)>,
}

/// Most masks of a picture's bins, 256 MiB: where there are more, the host makes the lists.
const MAX_MASKS: u64 = 1 << 26;

/// Whether a device's memory takes the masks from which it makes the lists of a camera's picture.
pub(super) fn can_be_listed<D: Device>(device: &D, camera: &CameraBlock, gaussian_count: usize) -> bool {
    mask_count(camera, gaussian_count) <= MAX_MASKS.min(device.most_elements::<u32>() as u64)
}

/// Masks of a picture's bins.
fn mask_count(camera: &CameraBlock, gaussian_count: usize) -> u64 {
    let CameraBlock { width, height, .. } = *camera;
    let block = ListBlock { width, height, splat_count: gaussian_count as u32, capacity: 0 };
    u64::from(block.bin_count()) * u64::from(block.mask_count())
}

/// A picture on the device, with what its derivatives need.
#[derive(Debug)]
pub struct Splatted<D: Device> {
    block: SplatBlock,
    tiles: TileBlock,
    /// Which splats each tile shows.
    pub lists: Tiles,
    starts: D::Buffer<u32>,
    entries: D::Buffer<u32>,
    splats: D::Buffer<ProjectedGaussian>,
    /// `[row][column]`: red, green, blue over the background, opacity.
    pub colours: D::Buffer<[f32; 4]>,
    /// `[row][column]`: weighted sums of depths; over the opacity, the depth along the principal axis.
    pub depths: D::Buffer<f32>,
}

/// What the lists of a picture are made from.
struct Listed<'d, D: Device> {
    block: ListBlock,
    splats: D::Buffer<ProjectedGaussian>,
    masks: D::Buffer<u32>,
    before: D::Buffer<u32>,
    starts: D::Buffer<u32>,
    /// The last number is how many entries they have.
    status: Later<'d, u32>,
}

/// Pictures that are begun.
pub struct Begun<'d, D: Device> {
    cameras: Vec<CameraBlock>,
    /// Whether the device makes their lists...
    is_listed: bool,
    /// ... those of the first ones, as many as have room.
    listed: Vec<Listed<'d, D>>,
}

/// A picture on the device, alone.
#[derive(Debug)]
pub struct Drawn<D: Device> {
    /// `[row][column]`: red, green, blue over the background, opacity.
    pub colours: D::Buffer<[f32; 4]>,
    /// `[row][column]`: weighted sums of depths; over the opacity, the depth along the principal axis.
    pub depths: D::Buffer<f32>,
}

impl<'d, D: Device> Splatter<'d, D> {
    fn block(&self, camera: CameraBlock, gaussian_count: u32) -> SplatBlock {
        let (near, is_antialiased) = (self.near, u32::from(self.is_antialiased));
        SplatBlock { camera, near, gaussian_count, is_antialiased, padding: 0 }
    }

    /// The Gaussians as a camera sees them.
    fn splats(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: u32,
        camera: CameraBlock,
    ) -> Result<D::Buffer<ProjectedGaussian>, DeviceError> {
        let mut splats = self.device.zeros(gaussian_count.max(1) as usize)?;
        let block = self.block(camera, gaussian_count);
        match self.harmonics {
            None => self.device.project_gaussians(&block, gaussians, &mut splats)?,
            Some((terms, term_count)) => {
                let SplatBlock { camera, near, gaussian_count, is_antialiased, .. } = block;
                let block = ParticleBlock { camera, near, gaussian_count, term_count, is_antialiased, has_states: 0 };
                self.device.project_particles(&block, gaussians, terms, None, &mut splats)?;
            }
        }
        Ok(splats)
    }

    /// The picture of these Gaussians from a camera.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn picture(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: usize,
        camera: &CameraBlock,
    ) -> Result<Splatted<D>, DeviceError> {
        let device = self.device;
        let gaussian_count = gaussian_count as u32;
        let camera = CameraBlock { first_texel: 0, ..*camera };
        let block = self.block(camera, gaussian_count);
        let splats = self.splats(gaussians, gaussian_count, camera)?;
        let tiles = TileBlock::new(camera.width, camera.height, self.background);
        let lists = Tiles::of(&tiles, &device.download(&splats)?);
        let starts = device.upload(&lists.starts)?;
        // No device has empty buffers.
        let entries = if lists.entries.is_empty() { device.upload(&[0])? } else { device.upload(&lists.entries)? };
        let pixel_count = (camera.width * camera.height) as usize;
        let (mut colours, mut depths) = (device.zeros(pixel_count)?, device.zeros(pixel_count)?);
        device.blend_splats(&tiles, &starts, &entries, &splats, &mut colours, &mut depths)?;
        Ok(Splatted { block, tiles, lists, starts, entries, splats, colours, depths })
    }

    /// The picture alone. On the device, its lists are made there, and the host
    /// hears how many entries they have; otherwise the host makes them. Both are the same lists.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn drawn(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: usize,
        camera: &CameraBlock,
        are_lists_on_device: bool,
    ) -> Result<Drawn<D>, DeviceError> {
        if !are_lists_on_device {
            let Splatted { colours, depths, .. } = self.picture(gaussians, gaussian_count, camera)?;
            return Ok(Drawn { colours, depths });
        }
        self.blended(self.listed(gaussians, gaussian_count, camera)?)
    }

    /// Counts the entries of a picture's lists on the device.
    fn listed(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: usize,
        camera: &CameraBlock,
    ) -> Result<Listed<'d, D>, DeviceError> {
        let device = self.device;
        let camera = CameraBlock { first_texel: 0, ..*camera };
        let CameraBlock { width, height, .. } = camera;
        let gaussian_count = gaussian_count as u32;
        let splats = self.splats(gaussians, gaussian_count, camera)?;
        let block = ListBlock { width, height, splat_count: gaussian_count, capacity: u32::MAX };
        let zeros = |count: u32| device.zeros(count.max(1) as usize);
        let mut masks = zeros(block.bin_count() * block.mask_count())?;
        let (mut counts, mut before) = (zeros(block.most_counts())?, zeros(block.most_counts())?);
        let (mut sums, mut starts) = (zeros(block.run_count() * TILE_RUN)?, zeros(block.tile_count() + 1)?);
        let (earlier, mut status) = (zeros(STATUS_NUMBERS)?, zeros(STATUS_NUMBERS)?);
        device.mark_bins(&block, &splats, &mut masks)?;
        device.count_entries(&block, &splats, &masks, &mut counts)?;
        device.sum_entries(&block, &counts, &mut before, &mut sums)?;
        device.start_tiles(&block, &sums, &earlier, &mut starts, &mut status)?;
        let status = device.download_later(&status)?;
        Ok(Listed { block, splats, masks, before, starts, status })
    }

    /// Makes the lists, and the picture.
    fn blended(&self, listed: Listed<'d, D>) -> Result<Drawn<D>, DeviceError> {
        let Listed { block, splats, masks, before, starts, status } = listed;
        let device = self.device;
        let entry_count = status.get()?.last().copied().unwrap_or(0);
        let block = ListBlock { capacity: entry_count, ..block };
        let entry_len = entry_count.max(1) as usize;
        let (mut keys, mut entries) = (device.zeros(entry_len)?, device.zeros(entry_len)?);
        device.list_entries(&block, &splats, &masks, &starts, &before, &mut keys)?;
        device.sort_entries(&block, &starts, &keys, &mut entries)?;

        let pixel_count = (block.width * block.height) as usize;
        let (mut colours, mut depths) = (device.zeros(pixel_count)?, device.zeros(pixel_count)?);
        let tiles = block.tiles(self.background);
        device.blend_splats(&tiles, &starts, &entries, &splats, &mut colours, &mut depths)?;
        Ok(Drawn { colours, depths })
    }

    /// Begins pictures from these cameras: their lists are made where that is faster, and on the device the host asks
    /// how many entries those have.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn begin(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: usize,
        cameras: &[CameraBlock],
    ) -> Result<Begun<'d, D>, DeviceError> {
        let is_listed = |camera: &CameraBlock| can_be_listed(self.device, camera, gaussian_count);
        let is_listed = !self.device.is_software() && cameras.iter().all(is_listed);
        let largest = cameras.iter().map(|camera| mask_count(camera, gaussian_count)).max().unwrap_or(1);
        let count = if is_listed { (MAX_MASKS / largest.max(1)).max(1) as usize } else { 0 };
        let listed = cameras.iter().take(count).map(|camera| self.listed(gaussians, gaussian_count, camera));
        Ok(Begun { cameras: cameras.to_vec(), is_listed, listed: listed.collect::<Result<_, _>>()? })
    }

    /// Pictures that were begun; the lists of as many as have room are waited for at once.
    fn drawn_usually(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: usize,
        begun: Begun<'d, D>,
    ) -> Result<Vec<Drawn<D>>, DeviceError> {
        let Begun { cameras, is_listed, listed } = begun;
        if !is_listed {
            return cameras.iter().map(|camera| self.drawn(gaussians, gaussian_count, camera, false)).collect();
        }
        let (mut drawn, mut listed) = (Vec::with_capacity(cameras.len()), listed);
        while !listed.is_empty() {
            for listed in listed {
                drawn.push(self.blended(listed)?);
            }
            listed = self.begin(gaussians, gaussian_count, &cameras[drawn.len()..])?.listed;
        }
        Ok(drawn)
    }

    /// Pictures as a field gives them, to be waited for together: depths where the opacity is at least
    /// `least_opacity`, 0 elsewhere; confidences are the opacities.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn rendered(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: usize,
        begun: Begun<'d, D>,
        least_opacity: f32,
    ) -> Result<impl FnOnce() -> Result<Vec<Rendered>, DeviceError> + use<'d, D>, DeviceError> {
        let (cameras, device) = (begun.cameras.clone(), self.device);
        let drawn = self.drawn_usually(gaussians, gaussian_count, begun)?;
        let later = |Drawn { colours, depths }: &Drawn<D>| {
            Ok((device.download_later(colours)?, device.download_later(depths)?))
        };
        let later = drawn.iter().map(later).collect::<Result<Vec<_>, DeviceError>>()?;
        let rendered = move |((colours, depths), camera): ((Later<'_, [f32; 4]>, Later<'_, f32>), CameraBlock)| {
            let (mut colours, mut depths) = (colours.get()?, depths.get()?);
            let confidences: Vec<f32> = colours.iter().map(|colour| colour[3]).collect();
            for (depth, opacity) in depths.iter_mut().zip(&confidences) {
                *depth = if *opacity >= least_opacity { *depth / opacity } else { 0.0 };
            }
            for colour in &mut colours {
                (0..3).for_each(|channel| colour[channel] = colour[channel].clamp(0.0, 1.0));
            }
            let CameraBlock { width, height, .. } = camera;
            Ok(Rendered { colours, depths, confidences, width, height })
        };
        Ok(move || later.into_iter().zip(cameras).map(rendered).collect())
    }

    /// The same, rounded on the device.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn rounded(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: usize,
        camera: &CameraBlock,
        least_opacity: f32,
    ) -> Result<Rounded, DeviceError> {
        let device = self.device;
        let begun = self.begin(gaussians, gaussian_count, &[*camera])?;
        let Drawn { colours, depths } = self.drawn_usually(gaussians, gaussian_count, begun)?.remove(0);
        let CameraBlock { width, height, .. } = *camera;
        let pixel_count = width * height;
        let (mut shown, mut surfaces) = (device.zeros(pixel_count as usize)?, device.zeros(pixel_count as usize)?);
        device.show_pixels(&least_opacity, pixel_count, &colours, &depths, &mut shown, &mut surfaces)?;
        let (shown, surfaces) = (device.download_later(&shown)?, device.download_later(&surfaces)?);
        let pixels = shown.get()?.into_iter().map(bytes_of_pixel).collect();
        Ok(Rounded { pixels, depths: surfaces.get()?, width, height })
    }

    /// Derivatives of a loss by the Gaussians' parameters, in the places of these, from those by the picture's pixels,
    /// `[row][column]` (by red, green, blue and opacity); and of how many tiles each Gaussian is seen in. Those by a
    /// colour are by the colour that the camera sees.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn gradients(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        picture: &Splatted<D>,
        by_pixels: &[[f32; 4]],
    ) -> Result<Vec<GaussianBlock>, DeviceError> {
        let device = self.device;
        let Splatted { block, tiles, lists, starts, entries, splats, colours, .. } = picture;
        let by_pixels = device.upload(by_pixels)?;
        let mut sums = device.zeros(lists.entries.len().max(1))?;
        device.blend_gradient(tiles, starts, entries, splats, colours, &by_pixels, &mut sums)?;
        let (use_starts, uses) = lists.uses(block.gaussian_count as usize);
        let uses = if uses.is_empty() { device.upload(&[0])? } else { device.upload(&uses)? };
        let uploaded = device.upload(&use_starts)?;
        let mut gradients = device.zeros(block.gaussian_count as usize)?;
        device.project_gradients(block, gaussians, splats, &uploaded, &uses, &sums, &mut gradients)?;
        device.download(&gradients)
    }
}
