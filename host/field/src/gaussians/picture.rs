//! Pictures of Gaussians and their derivatives, on a device.

use super::tiles::Tiles;
use crate::{Rendered, Rounded};
use std::cell::Cell;
use viewfuse_core::camera::CameraBlock;
use viewfuse_device::{Device, DeviceError, Later};
use viewfuse_kernels::gaussians::lists::ListStatus;
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

/// How many entries the lists of a scene's last picture needed: the device does not tell before they are made.
#[derive(Debug, Default)]
pub struct Room(Cell<usize>);

/// Entries that lists have room for at first: so many for each Gaussian, at least these, and of pictures at most those.
pub(super) const ENTRIES_A_GAUSSIAN: usize = 8;
pub(super) const MIN_ENTRIES: usize = 4096;
const MAX_ENTRIES: usize = 1 << 24;

impl Room {
    /// The entries that the next picture of so many Gaussians gets room for, at most those of a device.
    fn next(&self, gaussian_count: usize, most: usize) -> usize {
        let first = (gaussian_count * ENTRIES_A_GAUSSIAN).clamp(MIN_ENTRIES, MAX_ENTRIES);
        let last = self.0.get();
        first.max(last + last / 4).min(most)
    }

    /// How many entries lists need that had no room for them; `None` where they had, and of lists that the host made.
    fn missing(&self, status: Option<Later<'_, u32>>) -> Result<Option<usize>, DeviceError> {
        let Some(status) = status else { return Ok(None) };
        let numbers = status.get()?;
        let status = ListStatus::of([0, 1, 2].map(|number| numbers.get(number).copied().unwrap_or(0)));
        if status.is_over {
            return Ok(Some(status.most as usize));
        }
        self.0.set(status.most as usize);
        Ok(None)
    }
}

/// A picture on the device, alone.
pub struct Drawn<'d, D: Device> {
    /// `[row][column]`: red, green, blue over the background, opacity.
    pub colours: D::Buffer<[f32; 4]>,
    /// `[row][column]`: weighted sums of depths; over the opacity, the depth along the principal axis.
    pub depths: D::Buffer<f32>,
    /// The numbers of [`ListStatus`] of lists that the device made: the picture is empty where these had no room.
    pub status: Option<Later<'d, u32>>,
}

/// A picture on its way to the host.
pub struct Begun<'d> {
    camera: CameraBlock,
    colours: Later<'d, [f32; 4]>,
    depths: Later<'d, f32>,
    status: Option<Later<'d, u32>>,
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

    /// The picture alone, with lists made on the device that have room for so many entries, at least one.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn drawn(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: usize,
        camera: &CameraBlock,
        capacity: usize,
    ) -> Result<Drawn<'d, D>, DeviceError> {
        let device = self.device;
        let camera = CameraBlock { first_texel: 0, ..*camera };
        let CameraBlock { width, height, .. } = camera;
        let gaussian_count = gaussian_count as u32;
        let splats = self.splats(gaussians, gaussian_count, camera)?;
        let block = ListBlock { width, height, splat_count: gaussian_count, capacity: capacity as u32 };
        let zeros = |count: u32| device.zeros(count.max(1) as usize);
        let mut masks = zeros(block.bin_count() * block.mask_count())?;
        let (mut counts, mut before) = (zeros(block.most_counts())?, zeros(block.most_counts())?);
        let (mut sums, mut starts) = (zeros(block.run_count() * TILE_RUN)?, zeros(block.tile_count() + 1)?);
        let (earlier, mut status) = (zeros(STATUS_NUMBERS)?, zeros(STATUS_NUMBERS)?);
        let (mut keys, mut entries) = (device.zeros(capacity)?, device.zeros(capacity)?);
        device.mark_bins(&block, &splats, &mut masks)?;
        device.count_entries(&block, &splats, &masks, &mut counts)?;
        device.sum_entries(&block, &counts, &mut before, &mut sums)?;
        device.start_tiles(&block, &sums, &earlier, &mut starts, &mut status)?;
        device.list_entries(&block, &splats, &masks, &starts, &before, &mut keys)?;
        device.sort_entries(&block, &starts, &keys, &mut entries)?;

        let pixel_count = (width * height) as usize;
        let (mut colours, mut depths) = (device.zeros(pixel_count)?, device.zeros(pixel_count)?);
        let tiles = block.tiles(self.background);
        device.blend_splats(&tiles, &starts, &entries, &splats, &mut colours, &mut depths)?;
        Ok(Drawn { colours, depths, status: Some(device.download_later(&status)?) })
    }

    /// The picture alone, its lists made where that is faster: both are the same lists. On the device they have room for
    /// `needed` entries at the least, or it has not.
    fn drawn_usually(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: usize,
        camera: &CameraBlock,
        room: &Room,
        needed: usize,
    ) -> Result<Drawn<'d, D>, DeviceError> {
        if self.device.is_software() || !can_be_listed(self.device, camera, gaussian_count) {
            let Splatted { colours, depths, .. } = self.picture(gaussians, gaussian_count, camera)?;
            return Ok(Drawn { colours, depths, status: None });
        }
        let capacity = room.next(gaussian_count, self.device.most_elements::<[u32; 2]>());
        self.drawn(gaussians, gaussian_count, camera, capacity.max(needed))
    }

    /// Begins the picture from a camera: [`Splatter::rendered`] waits for it.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn begin(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: usize,
        camera: &CameraBlock,
        room: &Room,
    ) -> Result<Begun<'d>, DeviceError> {
        self.begin_within(gaussians, gaussian_count, camera, room, 0)
    }

    /// As [`Splatter::begin`], where so many entries are needed.
    fn begin_within(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: usize,
        camera: &CameraBlock,
        room: &Room,
        needed: usize,
    ) -> Result<Begun<'d>, DeviceError> {
        let Drawn { colours, depths, status } = self.drawn_usually(gaussians, gaussian_count, camera, room, needed)?;
        let (colours, depths) = (self.device.download_later(&colours)?, self.device.download_later(&depths)?);
        Ok(Begun { camera: *camera, colours, depths, status })
    }

    /// A picture as a field gives it: depths where the opacity is at least `least_opacity`, 0 elsewhere; confidences are
    /// the opacities.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn rendered(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: usize,
        mut begun: Begun<'d>,
        room: &Room,
        least_opacity: f32,
    ) -> Result<Rendered, DeviceError> {
        while let Some(needed) = room.missing(begun.status.take())? {
            begun = self.begin_within(gaussians, gaussian_count, &begun.camera, room, needed)?;
        }
        let Begun { camera: CameraBlock { width, height, .. }, colours, depths, .. } = begun;
        let (mut colours, mut depths) = (colours.get()?, depths.get()?);
        let confidences: Vec<f32> = colours.iter().map(|colour| colour[3]).collect();
        for (depth, opacity) in depths.iter_mut().zip(&confidences) {
            *depth = if *opacity >= least_opacity { *depth / opacity } else { 0.0 };
        }
        for colour in &mut colours {
            (0..3).for_each(|channel| colour[channel] = colour[channel].clamp(0.0, 1.0));
        }
        Ok(Rendered { colours, depths, confidences, width, height })
    }

    /// The same from a camera, rounded on the device.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn rounded(
        &self,
        gaussians: &D::Buffer<GaussianBlock>,
        gaussian_count: usize,
        camera: &CameraBlock,
        room: &Room,
        least_opacity: f32,
    ) -> Result<Rounded, DeviceError> {
        let device = self.device;
        let CameraBlock { width, height, .. } = *camera;
        let pixel_count = width * height;
        let (mut shown, mut surfaces) = (device.zeros(pixel_count as usize)?, device.zeros(pixel_count as usize)?);
        let mut needed = 0;
        loop {
            let drawn = self.drawn_usually(gaussians, gaussian_count, camera, room, needed)?;
            let Drawn { colours, depths, status } = drawn;
            device.show_pixels(&least_opacity, pixel_count, &colours, &depths, &mut shown, &mut surfaces)?;
            let (shown, surfaces) = (device.download_later(&shown)?, device.download_later(&surfaces)?);
            needed = match room.missing(status)? {
                Some(needed) => needed,
                None => {
                    let pixels = shown.get()?.into_iter().map(bytes_of_pixel).collect();
                    return Ok(Rounded { pixels, depths: surfaces.get()?, width, height });
                }
            };
        }
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
