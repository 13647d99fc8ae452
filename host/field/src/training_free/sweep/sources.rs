//! The disparities of the sources: found in each one's own frustum, found a second time by what they say of one another, and
//! kept between runs.

use super::{Settled, Sweep, Views, swept};
use crate::FieldError;
use std::ops::Range;
use viewfuse_core::camera::CameraBlock;
use viewfuse_device::Device;
use viewfuse_job::progress::Progress;
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};
use viewfuse_kernels::plane_sweep::{MAX_MATCHED, Planes};

/// Most bytes of the means that are kept: those of eight sources of 256x256 pixels and 64 planes.
const MAX_BYTES: usize = 128 << 20;

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

impl<D: Device> Views<'_, D> {
    /// The sources' disparities and confidences, with what the current views say of one another if it is known.
    pub(super) fn maps(&self) -> &D::Buffer<[f32; 2]> {
        self.assessed.as_ref().map_or_else(|| self.found(), |own| &own.maps)
    }

    /// The sources' disparities and confidences, each from the costs of its planes alone.
    pub(super) fn found(&self) -> &D::Buffer<[f32; 2]> {
        let is_settled = self.settings.second_share > 0.0;
        let settled = self.settled.as_ref().filter(|_| is_settled);
        settled.map_or(&self.disparities, |settled| &settled.maps)
    }

    /// Finds the disparities of these views the second time, if the settings ask for it, where others say something of them than
    /// the last time.
    pub(super) fn settle(&mut self, views: &[usize], progress: &dyn Progress) -> Result<(), FieldError> {
        if self.settings.second_share <= 0.0 {
            return Ok(());
        }
        // A source's own planes contradict no maps, and the temperature is the picture's: with them the same maps are found.
        let settings = Sweep {
            front_share: self.settings.second_share,
            dissent_share: self.defaults.dissent_share,
            temperature: self.defaults.temperature,
            ..self.settings
        };
        let Settled { mut voters, mut maps, .. } = match self.settled.take().filter(|own| own.settings == settings) {
            Some(settled) => settled,
            None => {
                let voters = vec![None; self.steps.len()];
                Settled { settings, voters, maps: self.device.zeros(self.texels.len())? }
            }
        };
        for &view in views {
            let mut others = self.others(view);
            others.retain(|(other, weight)| views.contains(other) && *weight > 0.0);
            others.truncate(MAX_MATCHED);
            if voters[view].as_ref() != Some(&others) {
                let cameras = &self.matched.cameras;
                let own = swept(cameras, cameras, &others, Some(&self.steps), None);
                let (frustum, swept) = self.source_frustum(view, settings);
                let costs = self.source_costs(frustum, swept, &own, settings, progress)?;
                self.device.pick_disparity(&frustum, &costs, &mut maps)?;
                voters[view] = Some(others);
                self.assessed = None;
            }
        }
        self.settled = Some(Settled { settings, voters, maps });
        Ok(())
    }

    /// The other views with their weights for a source, the greatest first.
    pub(super) fn others(&self, view: usize) -> Vec<(usize, f32)> {
        let relevance = &self.relevance[view];
        let others = (0..self.matched.cameras.len()).filter(|other| *other != view);
        let mut weights: Vec<(usize, f32)> = others.map(|other| (other, relevance.get(other as u32))).collect();
        weights.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        weights
    }

    /// A source's frustum, and the views that are compared in it.
    fn source_frustum(&self, view: usize, settings: Sweep) -> (FrustumBlock, Vec<SweptView>) {
        let cameras = &self.matched.cameras;
        let camera = cameras[view];
        let mut weights = self.others(view);
        weights.truncate(settings.neighbours);
        weights.push((view, 1.0));
        let matching = settings.matching(self.device, self.has_silhouettes);
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
        let matching = settings.matching(self.device, self.has_silhouettes);
        let mut scratch = std::mem::take(&mut self.scratch);
        let is_same =
            |own: &SourceMeans<D>| own.frustum == frustum && own.views == views && own.near_cost == settings.near_cost;
        let own = match self.means.iter().position(is_same) {
            Some(known) => self.means.remove(known),
            None => {
                let (texels, maps) = (&self.matched.texels, &self.disparities);
                let means = matching.compared_means(&frustum, &views, texels, maps, &mut scratch, progress)?;
                SourceMeans { frustum, views, near_cost: settings.near_cost, means }
            }
        };
        let costs = matching.costs(frustum, &own.means, voters, &self.disparities, &mut scratch)?;
        self.scratch = scratch;
        self.means.push(own);
        while self.means.iter().map(SourceMeans::bytes).sum::<usize>() > MAX_BYTES {
            self.means.remove(0);
        }
        Ok(costs)
    }

    /// Brings what was kept to the device, and keeps what is new on it: once for all sources that were encoded since.
    pub(super) fn exchange(&mut self, progress: &dyn Progress) -> Result<(), FieldError> {
        let Some(kept) = &self.kept else { return Ok(()) };
        if self.found.is_empty() && self.unkept.is_empty() {
            return Ok(());
        }
        let mut maps = self.device.download(&self.disparities)?;
        self.add_kept(&mut maps);
        for (view, key) in &self.unkept {
            kept.write(key, &maps[self.place(*view)], progress);
        }
        self.unkept.clear();
        if !self.found.is_empty() {
            self.found.clear();
            self.disparities = self.device.upload_owned(maps)?;
        }
        Ok(())
    }

    /// Adds the disparities that were kept and are not on the device yet to those of the device.
    pub(super) fn add_kept(&self, maps: &mut [[f32; 2]]) {
        self.found.iter().for_each(|(view, found)| maps[self.place(*view)].copy_from_slice(found));
    }

    /// Where a view's map lies among all.
    fn place(&self, view: usize) -> Range<usize> {
        let CameraBlock { first_texel, width, height, .. } = self.matched.cameras[view];
        first_texel as usize..(first_texel + width * height) as usize
    }

    /// Finds a source's disparities, or takes those that were kept.
    pub(super) fn find(&mut self, view: usize, progress: &dyn Progress) -> Result<(), FieldError> {
        self.settled = None;
        self.assessed = None;
        let settings = Sweep { dissent_share: self.defaults.dissent_share, ..self.settings };
        let (frustum, swept) = self.source_frustum(view, settings);
        self.steps[view] = frustum.disparity_step;
        let key = self.kept.as_ref().map(|kept| kept.of_source(&settings, &frustum, &swept, &self.texels));
        let len = (frustum.camera.width * frustum.camera.height) as usize;
        let found = self.kept.as_ref().zip(key.as_ref()).and_then(|(kept, key)| kept.read(key, len));
        if let Some(found) = found.filter(|found| found.len() == len) {
            self.found.push((view, found));
            return Ok(());
        }
        let costs = self.source_costs(frustum, swept, &[], settings, progress)?;
        self.device.pick_disparity(&frustum, &costs, &mut self.disparities)?;
        self.unkept.extend(key.map(|key| (view, key)));
        Ok(())
    }
}
