//! The disparities of the sources: found in each one's own frustum, found a second time by what they say of one
//! another, and kept between runs.

use super::kept::Key;
use super::matching::swept;
use super::views::{Matched, Views};
use super::{DEFAULT, Sweep};
use crate::FieldError;
use std::cell::{Cell, OnceCell};
use std::ops::Range;
use viewfuse_core::camera::CameraBlock;
use viewfuse_device::{Device, Later};
use viewfuse_job::progress::Progress;
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};
use viewfuse_kernels::plane_sweep::{MAX_MATCHED, Planes};
use viewfuse_weighting::sources::SourceWeights;

/// Most bytes of the means that are kept: those of eight sources of 256x256 pixels and 64 planes.
const MAX_BYTES: usize = 128 << 20;

/// `[view][row][column]` of the matched ones: disparity and confidence.
struct Disparities<'d, D: Device> {
    on_device: D::Buffer<[f32; 2]>,
    /// The same on their way to the host...
    coming: Cell<Option<Later<'d, [f32; 2]>>>,
    /// ... and there, from when it first needs them.
    on_host: OnceCell<Vec<[f32; 2]>>,
}

impl<'d, D: Device> Disparities<'d, D> {
    /// So many, of which none is found.
    fn none(device: &D, len: usize) -> Result<Disparities<'d, D>, FieldError> {
        Ok(Disparities { on_device: device.zeros(len)?, coming: Cell::default(), on_host: OnceCell::new() })
    }

    /// Those of the device, to be found anew: the host's are out of date.
    fn changed(&mut self) -> &mut D::Buffer<[f32; 2]> {
        (self.coming, self.on_host) = (Cell::default(), OnceCell::new());
        &mut self.on_device
    }

    /// Asks the device for them. Returns whether they were asked for before.
    fn ask(&self, device: &'d D) -> Result<bool, FieldError> {
        if self.on_host.get().is_some() {
            return Ok(true);
        }
        let coming = self.coming.take();
        let is_coming = coming.is_some();
        self.coming.set(coming.map_or_else(|| device.download_later(&self.on_device), Ok).map(Some)?);
        Ok(is_coming)
    }

    fn on_host(&self, device: &D) -> Result<&[[f32; 2]], FieldError> {
        if let Some(known) = self.on_host.get() {
            return Ok(known);
        }
        let found = match self.coming.take() {
            Some(coming) => coming.get()?,
            None => device.download(&self.on_device)?,
        };
        Ok(self.on_host.get_or_init(|| found))
    }
}

/// What is found of the sources under a weighting.
pub(super) struct SourceMaps<'d, D: Device> {
    /// `[view]`: the weights of all sources for source `view` as a target.
    pub(super) relevance: Vec<SourceWeights>,
    disparities: Disparities<'d, D>,
    /// Those found the second time.
    settled: Option<Settled<'d, D>>,
    /// From a plane's disparity to the next one's, of each view; 0 if it is not encoded.
    pub(super) steps: Vec<f32>,
    /// Disparities that were kept, and are not on the device yet...
    found: Vec<(usize, Vec<[f32; 2]>)>,
    /// ... and those on the device that are to be kept.
    unkept: Vec<(usize, Key)>,
    /// The means of sources' planes, for their second disparities: those that were found last.
    means: Vec<SourceMeans<D>>,
}

/// Disparities and confidences of some views, found the second time.
struct Settled<'d, D: Device> {
    /// The settings under which they were found.
    settings: Sweep,
    /// Of each view, by which others and with which weights; none where it was not found.
    voters: Vec<Option<Vec<(usize, f32)>>>,
    disparities: Disparities<'d, D>,
}

impl<'d, D: Device> SourceMaps<'d, D> {
    /// Nothing is found.
    pub(super) fn new(
        device: &D,
        matched: &Matched<D>,
        relevance: Vec<SourceWeights>,
    ) -> Result<SourceMaps<'d, D>, FieldError> {
        Ok(SourceMaps {
            relevance,
            disparities: Disparities::none(device, matched.texels.len())?,
            settled: None,
            steps: vec![0.0; matched.images.cameras.len()],
            found: Vec::new(),
            unkept: Vec::new(),
            means: Vec::new(),
        })
    }
}

/// The means of a source's planes, which other views' disparities do not change.
pub(super) struct SourceMeans<D: Device> {
    frustum: FrustumBlock,
    /// The views that were compared.
    views: Vec<SweptView>,
    near_cost: f32,
    /// As of [`Matching::means`](super::matching::Matching::means).
    means: D::Buffer<Planes>,
}

impl<D: Device> SourceMeans<D> {
    fn bytes(&self) -> usize {
        let FrustumBlock { camera: CameraBlock { width, height, .. }, group_count, .. } = self.frustum;
        (width * height * group_count) as usize * size_of::<Planes>()
    }
}

impl<'a, D: Device> Views<'a, D> {
    /// The sources' disparities and confidences, each from the costs of its planes alone.
    pub(super) fn found(&self) -> Result<&[[f32; 2]], FieldError> {
        self.current().on_host(self.scene.device)
    }

    /// The same on the device.
    pub(super) fn found_on_device(&self) -> &D::Buffer<[f32; 2]> {
        &self.current().on_device
    }

    /// Asks the device for what [`Views::found`] gives; returns whether it was asked for before.
    pub(super) fn ask_for_found(&self) -> Result<bool, FieldError> {
        self.current().ask(self.scene.device)
    }

    fn current(&self) -> &Disparities<'a, D> {
        let settled = self.maps.settled.as_ref().filter(|_| self.settings.second_share > 0.0);
        settled.map_or(&self.maps.disparities, |settled| &settled.disparities)
    }

    /// Finds the disparities of these views the second time, if the settings ask for it, where others say something of
    /// them than the last time.
    pub(super) fn settle(&mut self, views: &[usize], progress: &dyn Progress) -> Result<(), FieldError> {
        if self.settings.second_share <= 0.0 {
            return Ok(());
        }
        // A source's own planes contradict no maps, and the temperature is the picture's: with them the same maps are
        // found.
        let Sweep { dissent_share, temperature, .. } = DEFAULT;
        let settings = Sweep { front_share: self.settings.second_share, dissent_share, temperature, ..self.settings };
        let known = self.maps.settled.take().filter(|known| known.settings == settings);
        let Settled { mut voters, mut disparities, .. } = match known {
            Some(known) => known,
            None => {
                let voters = vec![None; self.maps.steps.len()];
                let disparities = Disparities::none(self.scene.device, self.matched.texels.len())?;
                Settled { settings, voters, disparities }
            }
        };
        for &view in views {
            let mut others = self.others(view);
            others.retain(|(other, weight)| views.contains(other) && *weight > 0.0);
            others.truncate(MAX_MATCHED);
            if voters[view].as_ref() != Some(&others) {
                let cameras = &self.matched.images.cameras;
                let voting = swept(cameras, cameras, &others, Some(&self.maps.steps), None);
                let (frustum, swept) = self.source_frustum(view, settings);
                let costs = self.source_costs(frustum, swept, &voting, settings, progress)?;
                self.scene.device.pick_disparity(&frustum, &costs, disparities.changed())?;
                voters[view] = Some(others);
                self.targets[1] = None;
            }
        }
        self.maps.settled = Some(Settled { settings, voters, disparities });
        Ok(())
    }

    /// The other views with their weights for a source, the greatest first.
    pub(super) fn others(&self, view: usize) -> Vec<(usize, f32)> {
        let relevance = &self.maps.relevance[view];
        let others = (0..self.matched.images.cameras.len()).filter(|other| *other != view);
        let mut weights: Vec<(usize, f32)> = others.map(|other| (other, relevance.get(other as u32))).collect();
        weights.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        weights
    }

    /// A source's frustum, and the views that are compared in it.
    fn source_frustum(&self, view: usize, settings: Sweep) -> (FrustumBlock, Vec<SweptView>) {
        let cameras = &self.matched.images.cameras;
        let camera = cameras[view];
        let mut weights = self.others(view);
        weights.truncate(settings.neighbours);
        weights.push((view, 1.0));
        let matching = settings.matching(self.scene.device, self.scene.has_silhouettes);
        let swept = swept(cameras, cameras, &weights, None, None);
        (matching.frustum(camera, self.range(&camera), &swept), swept)
    }

    /// The costs of a source's planes. Their means are kept, and taken if they were.
    fn source_costs(
        &mut self,
        frustum: FrustumBlock,
        views: Vec<SweptView>,
        voters: &[SweptView],
        settings: Sweep,
        progress: &dyn Progress,
    ) -> Result<D::Buffer<Planes>, FieldError> {
        let matching = settings.matching(self.scene.device, self.scene.has_silhouettes);
        let SourceMaps { disparities, means: kept, .. } = &mut self.maps;
        let disparities = &disparities.on_device;
        let scratch = &mut self.scratch;
        let is_same = |known: &SourceMeans<D>| {
            known.frustum == frustum && known.views == views && known.near_cost == settings.near_cost
        };
        let source = match kept.iter().position(is_same) {
            Some(known) => kept.remove(known),
            None => {
                let texels = &self.matched.images.texels;
                let means = matching.compared_means(&frustum, &views, texels, disparities, scratch, progress)?;
                SourceMeans { frustum, views, near_cost: settings.near_cost, means }
            }
        };
        let costs = matching.costs(frustum, &source.means, voters, disparities, scratch)?;
        kept.push(source);
        while kept.iter().map(SourceMeans::bytes).sum::<usize>() > MAX_BYTES {
            kept.remove(0);
        }
        Ok(costs)
    }

    /// Brings what was kept to the device, and keeps what is new on it: once for all sources that were encoded since.
    pub(super) fn exchange(&mut self, progress: &dyn Progress) -> Result<(), FieldError> {
        let Some(kept) = &self.scene.kept else { return Ok(()) };
        if self.maps.found.is_empty() && self.maps.unkept.is_empty() {
            return Ok(());
        }
        let mut maps = self.maps.disparities.on_host(self.scene.device)?.to_vec();
        self.add_kept(&mut maps);
        for (view, key) in &self.maps.unkept {
            kept.write(key, &maps[self.place(*view)], progress);
        }
        self.maps.unkept.clear();
        if !self.maps.found.is_empty() {
            self.maps.found.clear();
            *self.maps.disparities.changed() = self.scene.device.upload(&maps)?;
            self.maps.disparities.on_host = maps.into();
        }
        Ok(())
    }

    /// Adds the disparities that were kept and are not on the device yet to those of the device.
    pub(super) fn add_kept(&self, maps: &mut [[f32; 2]]) {
        self.maps.found.iter().for_each(|(view, found)| maps[self.place(*view)].copy_from_slice(found));
    }

    /// Where a view's map lies among all.
    fn place(&self, view: usize) -> Range<usize> {
        let CameraBlock { first_texel, width, height, .. } = self.matched.images.cameras[view];
        first_texel as usize..(first_texel + width * height) as usize
    }

    /// Finds a source's disparities, or takes those that were kept.
    pub(super) fn find(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        self.maps.settled = None;
        self.targets = [None, None];
        let settings = Sweep { dissent_share: DEFAULT.dissent_share, ..self.settings };
        let (frustum, swept) = self.source_frustum(view, settings);
        self.maps.steps[view] = frustum.disparity_step;
        let kept = self.scene.kept.as_ref();
        let key = kept.map(|kept| kept.of_source(&settings, &frustum, &swept, &self.matched.texels));
        let len = (frustum.camera.width * frustum.camera.height) as usize;
        let found = kept.zip(key.as_ref()).and_then(|(kept, key)| kept.read(key, len..=len, progress));
        if let Some(found) = found {
            self.maps.found.push((view, found));
            return Ok(());
        }
        let costs = self.source_costs(frustum, swept, &[], settings, progress)?;
        self.scene.device.pick_disparity(&frustum, &costs, self.maps.disparities.changed())?;
        self.maps.unkept.extend(key.map(|key| (view, key)));
        Ok(())
    }
}
