//! Sources on a device. What is kept of them has one of four lives, and is dropped whole at its end: that of the
//! sources, of an effort, of a weighting, and of the views of a target.

use super::kept::{Cache, Kept};
use super::matching::{Images, Range};
use super::scratch::Scratch;
use super::sources::SourceMaps;
use super::target::{TargetViews, Volume};
use super::{Sweep, holes, search, unseen};
use crate::training_free::space::Space;
use crate::variant::erased;
use crate::{
    AnyOptions, DepthMap, Drawing, Encoding, FieldError, Geometry, Prepared, Purpose, Rendered, Request, Surfaces,
    Variant,
};
use std::borrow::Cow;
use viewfuse_core::camera::CameraBlock;
use viewfuse_device::Device;
use viewfuse_device::cpu::Cpu;
use viewfuse_device::parallel::map;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::{SourceImage, SourceImages, longest_side};
use viewfuse_weighting::sources::SourceWeights;

/// Most views that contribute to a picture: more of less weight lose (`host/results/training_free.md`, "Many sources").
const MAX_VIEWS: usize = 9;
/// Pixels that are enough work for a thread.
const MIN_PIXELS: usize = 1 << 14;

/// Photographs on the device at two sizes, and their disparity maps.
pub(super) struct Views<'a, D: Device> {
    pub(super) scene: SceneViews<'a, D>,
    pub(super) settings: Sweep,
    /// For an effort.
    pub(super) matched: Matched<D>,
    /// For an effort and a weighting.
    pub(super) maps: SourceMaps<'a, D>,
    /// For the views of the last target, as long as their maps stay: by the first disparities, and by the second ones.
    pub(super) targets: [Option<TargetViews<'a, D>>; 2],
    pub(super) scratch: Scratch<D>,
}

/// What stays as long as the sources do.
pub(super) struct SceneViews<'a, D: Device> {
    pub(super) device: &'a D,
    pub(super) has_silhouettes: bool,
    background: [f32; 3],
    /// At the size of the pictures.
    pub(super) pictures: Images<D>,
    /// At the field's own size of the comparison.
    pub(super) small: Vec<SourceImage>,
    space: Space,
    /// What is found of the sources, in a folder.
    pub(super) kept: Option<Kept>,
}

/// The sources at the size of the comparison.
pub(super) struct Matched<D: Device> {
    pub(super) images: Images<D>,
    /// Their texels on the host, for the gains.
    pub(super) texels: Vec<[f32; 4]>,
}

impl<D: Device> Matched<D> {
    pub(super) fn upload(device: &D, images: &[SourceImage]) -> Result<Matched<D>, FieldError> {
        let (images, texels) = Images::upload_kept(device, images)?;
        Ok(Matched { images, texels })
    }
}

impl<'a, D: Device> Views<'a, D> {
    /// Takes sources to the device; nothing is encoded.
    pub(super) fn upload(
        settings: Sweep,
        device: &'a D,
        sources: &SourceImages,
        cache: Option<&Cache>,
        progress: &dyn Progress,
    ) -> Result<Views<'a, D>, FieldError> {
        let kept = cache.map(|cache| Kept::new(cache.clone(), device, progress)).transpose()?;
        let reduced = |side: u32| -> Result<Vec<SourceImage>, FieldError> {
            let images = sources.images.iter().map(|image| image.reduced(side));
            images.collect::<Result<_, _>>().map_err(FieldError::unsuitable)
        };
        let has_silhouettes = sources.has_silhouettes;
        let known = Space::of(sources);
        let space = match known.is_known() {
            true => known,
            false => {
                let matching = settings.matching(device, has_silhouettes);
                matching.kept_space(&reduced(search::SIDE)?, kept.as_ref(), progress)?
            }
        };
        let small = reduced(settings.match_side)?;
        // With silhouettes, alpha 0 is the background.
        let pictures: Vec<Cow<'_, SourceImage>> = match has_silhouettes {
            true => sources.images.iter().map(Cow::Borrowed).collect(),
            false => sources.images.iter().map(unseen::filled).collect(),
        };
        let matched = Matched::upload(device, &small)?;
        let maps = SourceMaps::new(device, &matched, Vec::new())?;
        let (background, pictures) = (sources.background, Images::upload(device, &pictures)?);
        let scene = SceneViews { device, has_silhouettes, background, pictures, small, space, kept };
        Ok(Views { scene, settings, matched, maps, targets: [None, None], scratch: Scratch::default() })
    }

    /// Planes for a camera.
    pub(super) fn range(&self, camera: &CameraBlock) -> Range {
        Range::new(self.scene.space.disparities(camera), self.settings.plane_count)
    }

    /// The views that are encoded.
    fn encoded(&self) -> Vec<usize> {
        (0..self.maps.steps.len()).filter(|view| self.maps.steps[*view] > 0.0).collect()
    }

    /// A view's depths, of the disparities of all views.
    fn depth_map(&self, view: usize, maps: &[[f32; 2]]) -> DepthMap {
        let (camera, step) = (self.matched.images.cameras[view], self.maps.steps[view]);
        let pixels = &maps[camera.first_texel as usize..][..(camera.width * camera.height) as usize];
        // Below half a step a disparity is that of the farthest plane: it bounds nothing.
        let depth = |disparity: f32| if step > 0.0 && disparity > 0.5 * step { 1.0 / disparity } else { 0.0 };
        DepthMap {
            camera: CameraBlock { first_texel: 0, ..camera },
            depths: map(pixels.len(), MIN_PIXELS, |pixel| depth(pixels[pixel][0])),
            confidences: map(pixels.len(), MIN_PIXELS, |pixel| pixels[pixel][1]),
        }
    }
}

impl<'a, D: Device> Prepared<'a> for Views<'a, D> {
    fn encoding(&self) -> Encoding {
        Encoding::Greatest(MAX_VIEWS)
    }

    fn encode(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        self.find(view, progress)
    }

    fn render(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Rendered, FieldError> {
        self.draw(request, progress)?()
    }

    fn advance(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<bool, FieldError> {
        self.advance_target(request.views, progress)
    }

    fn draw(&mut self, request: &Request<'_>, progress: &dyn Progress) -> Result<Drawing<'a>, FieldError> {
        let mut target = self.target_views(request.views, progress)?;
        let Volume { block, views: blended, costs } = self.volume(&mut target, request, progress)?;
        let device = self.scene.device;
        let (width, height) = (block.target.width, block.target.height);
        let count = (width * height) as usize;
        let (mut colours, mut depths, mut confidences) =
            (device.zeros::<[f32; 4]>(count)?, device.zeros::<f32>(count)?, device.zeros::<f32>(count)?);
        device.blend_planes(
            &block,
            0,
            height,
            &device.table(&blended)?,
            &self.scene.pictures.texels,
            &target.maps,
            &costs,
            &mut colours,
            &mut depths,
            &mut confidences,
        )?;
        let colours = device.download_later(&colours)?;
        let (depths, confidences) = (device.download_later(&depths)?, device.download_later(&confidences)?);
        device.submit()?;
        let (background, has_silhouettes) = (self.scene.background, self.scene.has_silhouettes);
        let used = if has_silhouettes { &[] } else { request.views };
        let used: Vec<DepthMap> = used.iter().map(|view| self.depth_map(*view, &target.maps_on_host)).collect();
        self.keep(target);
        Ok(Box::new(move || {
            let mut colours = colours.get()?;
            for colour in &mut colours {
                let behind = 1.0 - colour[3];
                (0..3).for_each(|channel| colour[channel] += behind * background[channel]);
            }
            let (depths, confidences) = (depths.get()?, confidences.get()?);
            let mut rendered = Rendered { colours, depths, confidences, width, height };
            if !has_silhouettes {
                holes::fill(&mut rendered, &block.target, &used);
            }
            Ok(rendered)
        }))
    }

    fn is_weighted(&self) -> bool {
        true
    }

    fn weigh(&mut self, relevance: &[SourceWeights]) -> Result<(), FieldError> {
        self.targets = [None, None];
        self.maps = SourceMaps::new(self.scene.device, &self.matched, relevance.to_vec())?;
        Ok(())
    }

    fn set(&mut self, options: &AnyOptions) -> Result<(), FieldError> {
        options.of().map_or(Ok(()), |settings| self.go_on_with(*settings))
    }

    fn efforts(&self, options: &AnyOptions, _pixel_count: u64) -> Vec<Variant<AnyOptions>> {
        let side = self.scene.small.iter().map(|image| longest_side(&image.camera)).max().unwrap_or(1);
        erased(options.of::<Sweep>().map_or_else(Vec::new, |settings| settings.efforts(side)))
    }

    fn reduced(&self, options: &AnyOptions, purpose: Purpose) -> AnyOptions {
        options.of::<Sweep>().map_or_else(|| options.clone(), |settings| AnyOptions::new(settings.reduced(purpose)))
    }

    fn candidates(&self, chosen: &AnyOptions, step: usize) -> Vec<AnyOptions> {
        let candidates = chosen.of::<Sweep>().map_or_else(Vec::new, |settings| settings.candidates(step));
        candidates.into_iter().map(AnyOptions::new).collect()
    }

    fn mixtures(&self, chosen: &AnyOptions) -> Vec<Variant<Vec<AnyOptions>>> {
        match chosen.of::<Sweep>() {
            Some(settings) if !self.scene.has_silhouettes => {
                let parts = settings.parts().map(|(part, stated)| AnyOptions::stated(part, stated)).to_vec();
                vec![Variant::to_measure("three depths of the sweep", parts)]
            }
            _ => Vec::new(),
        }
    }

    fn geometry(&self) -> Option<&dyn Geometry> {
        Some(self)
    }
}

impl<D: Device> Geometry for Views<'_, D> {
    fn surfaces(&self) -> Surfaces {
        self.scene.space.surfaces()
    }

    fn ask_for_depths(&self) -> Result<bool, FieldError> {
        if self.known(&self.encoded()).is_some() { Ok(true) } else { self.ask_for_found() }
    }

    fn source_depths(&self) -> Result<Vec<DepthMap>, FieldError> {
        let of = |maps: &[[f32; 2]]| (0..self.maps.steps.len()).map(|view| self.depth_map(view, maps)).collect();
        let encoded = self.encoded();
        if let Some(known) = self.known(&encoded) {
            return Ok(of(known));
        }
        let mut maps = self.found()?.to_vec();
        self.add_kept(&mut maps);
        Ok(of(&self.confirmed(&Cpu, &encoded, &maps)?))
    }
}
