//! Probes: the first pass along a few rays finds empty space, and the threshold below which space counts as empty.

use super::network::Workspace;
use super::options::MIN_SHARE;
use super::pass::{Evaluated, Probes, Renderer, pieces, rays_at_once};
use crate::FieldError;
use viewfuse_core::composite::Compositor;
use viewfuse_device::Device;

/// Candidate thresholds of the opacity below which a part of a ray counts as empty, the largest first. The last is
/// [`MIN_SHARE`], which is always allowed.
const SHARES: [f32; 5] = [1.0 / 16.0, 1.0 / 32.0, 1.0 / 64.0, 1.0 / 128.0, 1.0 / 256.0];

impl<D: Device> Renderer<'_, D> {
    /// The probes of a picture whose omissions need some. Their samples are no part of the picture's. Where none of them
    /// meets anything, there are twice as many a side, down to every second pixel: between the first ones a whole object
    /// may stand.
    pub(super) fn probes(
        &self,
        workspace: &mut Workspace<D>,
        evaluated: &mut Evaluated,
    ) -> Result<Option<Probes<D>>, FieldError> {
        let mut step = self.omissions.empty_space;
        if step <= 1 || self.omissions.nodes > 0 {
            return Ok(None);
        }
        let mut work = Evaluated::default();
        let probes = loop {
            let (probes, meets) = self.probe(workspace, step, &mut work)?;
            let denser = (step / 2).max(2);
            if meets || denser == step || self.probe_values(denser) > self.device.most_elements::<[f32; 2]>() {
                break probes;
            }
            step = denser;
        };
        evaluated.evaluated += work.evaluated;
        evaluated.unseen += work.unseen;
        Ok(Some(probes))
    }

    /// Columns and rows of probes.
    fn probe_grid(&self, step: u32) -> [u32; 2] {
        let [width, height] = [self.cast.camera.width, self.cast.camera.height];
        [width, height].map(|side| (side - 1).div_ceil(step) + 1)
    }

    /// Numbers of all their samples.
    fn probe_values(&self, step: u32) -> usize {
        let [columns, rows] = self.probe_grid(step).map(|count| count as usize);
        columns * rows * self.sampling.coarse_count as usize
    }

    /// Runs the first pass along one ray in every square of `step` pixels, and along those of the last row and column;
    /// and whether one of them meets something, which counts as so where no threshold is looked for.
    fn probe(
        &self,
        workspace: &mut Workspace<D>,
        step: u32,
        evaluated: &mut Evaluated,
    ) -> Result<(Probes<D>, bool), FieldError> {
        let (width, height) = (self.cast.camera.width, self.cast.camera.height);
        let [columns, rows] = self.probe_grid(step);
        let place = |index: u32, side: u32| (index * step).min(side - 1);
        let pixels: Vec<u32> =
            (0..columns * rows).map(|ray| place(ray / columns, height) * width + place(ray % columns, width)).collect();
        let count = self.sampling.coarse_count;
        let mut values = self.zeros(pixels.len() * count as usize)?;
        let mut first_ray = 0;
        let (mut changes, mut greatest) = ([0.0; SHARES.len()], 0.0_f32);
        for some in pixels.chunks(rays_at_once(self.device, &self.sampling)) {
            let rays = self.rays(some)?;
            self.progress.expect(pieces(workspace, rays.count * count));
            let samples = self.first_pass(workspace, &rays, count, None, evaluated)?;
            self.device.weigh_samples(&samples.block(first_ray), rays.count, &samples.values, &mut values)?;
            first_ray += rays.count;
            if self.omissions.probe_error > 0.0 {
                // The one choice that is made from whole samples on the host, in f64.
                let samples = self.device.download(&samples.values)?;
                greatest = samples.iter().map(|sample| -(-sample[3]).exp_m1()).fold(greatest, f32::max);
                for ray in samples.chunks(count as usize) {
                    let changed = SHARES.map(|share| change(ray, share, &self.background));
                    changes.iter_mut().zip(changed).for_each(|(sum, change)| *sum += change);
                }
            }
        }
        let most = f64::from(self.omissions.probe_error).powi(2) * pixels.len() as f64;
        let harmless = changes.iter().position(|change| *change < most);
        let least_share = harmless.map_or(MIN_SHARE, |index| SHARES[index]);
        let meets = self.omissions.probe_error <= 0.0 || greatest >= least_share;
        Ok((Probes { values, part_count: count, columns, rows, step, least_share }, meets))
    }
}

/// Mean square over the channels of the change of a ray's colour if samples with an opacity below `share` are left
/// out. Samples are colour and optical depth.
fn change(ray: &[[f32; 4]], share: f32, background: &[f32; 3]) -> f64 {
    let colour = |least: f32| {
        let mut compositor = Compositor::<3>::START;
        for [red, green, blue, optical_depth] in ray {
            if -(-optical_depth).exp_m1() >= least {
                compositor.add(&[*red, *green, *blue], *optical_depth, 0.0);
            }
        }
        compositor.finish(background, 0.0).channels
    };
    let differences = colour(0.0).into_iter().zip(colour(share)).map(|(all, kept)| f64::from(all - kept).powi(2));
    differences.sum::<f64>() / 3.0
}

#[cfg(test)]
mod tests {
    use super::change;

    const WHITE: [f32; 3] = [1.0; 3];

    fn mist(colour: [f32; 3], optical_depth: f32) -> Vec<[f32; 4]> {
        vec![[colour[0], colour[1], colour[2], optical_depth]; 64]
    }

    #[test]
    fn dark_mist_is_missed_and_white_mist_is_not() {
        // 64 parts that stop a hundredth each, together 1 - exp(-0.64).
        let missed = f64::from(1.0 - (-0.64_f32).exp());
        let found = change(&mist([0.0; 3], 0.01), 1.0 / 64.0, &WHITE);
        assert!((found - missed * missed).abs() < 1.0e-5, "{found}");
        assert!(change(&mist(WHITE, 0.01), 1.0 / 64.0, &WHITE) < 1.0e-12);
        // A share that the parts reach leaves nothing out.
        assert_eq!(change(&mist([0.0; 3], 0.01), 1.0 / 128.0, &WHITE), 0.0);
    }

    #[test]
    fn a_surface_behind_mist_shows_more_without_it() {
        let mut ray = mist(WHITE, 0.005);
        ray[40] = [0.0, 0.0, 0.0, 50.0];
        let expected = f64::from(1.0 - (-0.2_f32).exp()).powi(2);
        let found = change(&ray, 1.0 / 64.0, &WHITE);
        assert!((found - expected).abs() < 1.0e-5, "{found} {expected}");
    }
}
