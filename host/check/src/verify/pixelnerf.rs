//! PixelNeRF with deterministic initialisation: latents, points, rays. The official network at full size, or, where the
//! file's metadata say `width`, the small member of the family of that width.

use super::file::{File, compared, full};
use super::{Quantity, Report, VerifyError};
use viewfuse_core::depths::FineBlock;
use viewfuse_core::rays::{RayPoint, TargetRay};
use viewfuse_device::Device;
use viewfuse_field::pixelnerf::reference::{Reference, RenderedRays};
use viewfuse_field::pixelnerf::{Architecture, Omissions, Pass, PixelNerf, PixelNerfOptions, test_networks};
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;

/// Weights of the views by the names of the file.
const WEIGHTS: [&str; 3] = ["mean", "tilted", "one_hot"];
/// The weights that the file's rays were rendered with.
const RAY_WEIGHTS: &str = "tilted";
const PASSES: [(Pass, &str); 2] = [(Pass::Coarse, "coarse"), (Pass::Fine, "fine")];

/// Compares everything in the file.
pub(super) fn verify<D: Device>(
    file: &File<'_>,
    device: &D,
    report: &mut Report,
    _progress: &dyn Progress,
) -> Result<(), VerifyError> {
    if !file.has("latent_value") || !file.has("z_coarse") {
        return Ok(());
    }
    let architecture = match file.metadata("width").map(str::parse) {
        None => Architecture::published(),
        Some(Ok(width @ 1..=4096)) => Architecture::small(width),
        Some(_) => return Err(file.wrong("metadata", "'width' is no whole number from 1 to 4096")),
    };
    let checkpoint = test_networks::deterministic(&architecture);
    let failed = |message: String| file.wrong("pixelnerf", message);
    let options = |omissions| PixelNerfOptions { omissions, ..PixelNerfOptions::default() };
    let sources = file.sources("focal", |_| 1.0)?;
    let latent_layers = Omissions { latent_layers: true, ..Omissions::NONE };
    let field = PixelNerf::new(&checkpoint, options(Omissions::NONE)).map_err(|error| failed(error.to_string()))?;
    let exact = Comparison { file, suffix: "" };
    let mut reference = Reference::new(&field, device, &sources).map_err(|error| failed(full(&error)))?;
    exact.latents(&reference, &sources, report)?;
    exact.points(&mut reference, report)?;
    exact.rays(&mut reference, report)?;
    drop(reference);
    // The same with the latent layers moved to the grids: exact up to rounding, and held to the same tolerances.
    let field = field.with_options(options(latent_layers));
    let mut reference = Reference::new(&field, device, &sources).map_err(|error| failed(full(&error)))?;
    let mapped = Comparison { file, suffix: ", latent layers on the grid" };
    mapped.points(&mut reference, report)?;
    mapped.rays(&mut reference, report)?;
    ["tgt_pose", "weights", "poses"].into_iter().for_each(|name| file.cover(name));
    Ok(())
}

/// The rays of the file.
fn rays(file: &File<'_>) -> Result<Vec<TargetRay>, VerifyError> {
    let ray =
        |[x, y, z, a, b, c, near, far]: [f32; 8]| TargetRay { origin: [x, y, z], near, direction: [a, b, c], far };
    Ok(file.rows::<8>("rays")?.into_iter().map(ray).collect())
}

/// One way of computing, for comparison with the file.
struct Comparison<'a> {
    file: &'a File<'a>,
    suffix: &'static str,
}

impl Comparison<'_> {
    /// A quantity whose tolerance is a share of the largest reference value, if `relative`.
    fn compare(&self, name: &str, ours: &[f32], reference: &[f32], tolerance: f64, relative: bool) -> Quantity {
        compared(format!("PixelNeRF {name}{}", self.suffix), ours, reference, tolerance, relative)
    }

    fn failed<E: std::error::Error>(&self, error: E) -> VerifyError {
        self.file.wrong("pixelnerf", error.to_string())
    }

    fn latents<D: Device>(
        &self,
        reference: &Reference<'_, D>,
        sources: &SourceImages,
        report: &mut Report,
    ) -> Result<(), VerifyError> {
        let indices = self.file.indices("latent_index")?;
        let expected = self.file.floats("latent_value")?;
        let latents = reference.latents().map_err(|error| self.failed(error))?;
        let view_len = latents.len() / sources.images.len();
        let channels = reference.architecture().latent_channels();
        let pixels = view_len / channels;
        let mut ours = Vec::with_capacity(expected.len());
        for index in indices {
            // Theirs is (view, channel, row, column).
            let (view, rest) = (index / view_len, index % view_len);
            let at = view * view_len + rest % pixels * channels + rest / pixels;
            let value =
                latents.get(at).ok_or_else(|| self.file.wrong("latent_index", format!("{index} is too large")))?;
            ours.push(*value);
        }
        report.quantities.push(self.compare("latents", &ours, &expected, 1.0e-4, true));
        Ok(())
    }

    fn points<D: Device>(&self, reference: &mut Reference<'_, D>, report: &mut Report) -> Result<(), VerifyError> {
        let (positions, directions) = (self.file.rows::<3>("points")?, self.file.rows::<3>("viewdirs")?);
        let points: Vec<RayPoint> = positions
            .into_iter()
            .zip(directions)
            .zip(0..)
            .map(|((position, direction), sample)| RayPoint { position, length: 1.0, direction, sample })
            .collect();
        for weights_name in WEIGHTS {
            let weights = self.file.many(&format!("weights.{weights_name}"), reference.view_count())?;
            for (pass, pass_name) in PASSES {
                let expected = self.file.rows::<4>(&format!("points.{weights_name}.{pass_name}"))?;
                let ours = reference.radiance(pass, &weights, &points).map_err(|error| self.failed(error))?;
                let colours = |rows: &[[f32; 4]]| rows.iter().flat_map(|row| row[..3].to_vec()).collect::<Vec<f32>>();
                let densities = |rows: &[[f32; 4]]| rows.iter().map(|row| row[3]).collect::<Vec<f32>>();
                let name = |what: &str| format!("{what} of points, {weights_name} weights, {pass_name}");
                let [ours_of, theirs] = [&ours, &expected].map(|rows| (colours(rows), densities(rows)));
                report.quantities.push(self.compare(&name("colours"), &ours_of.0, &theirs.0, 2.0e-4, false));
                report.quantities.push(self.compare(&name("densities"), &ours_of.1, &theirs.1, 1.0e-3, true));
            }
        }
        Ok(())
    }

    fn rays<D: Device>(&self, reference: &mut Reference<'_, D>, report: &mut Report) -> Result<(), VerifyError> {
        let file = self.file;
        let rays = rays(file)?;
        let weights = file.many(&format!("weights.{RAY_WEIGHTS}"), reference.view_count())?;
        for (pass, name, depths) in [(Pass::Coarse, "coarse", "z_coarse"), (Pass::Fine, "fine", "z_all")] {
            let depths = file.many_a_row(depths, rays.len())?;
            let RenderedRays { weights: ours, colours, depths: seen } =
                reference.render_rays(pass, &weights, &rays, &depths).map_err(|error| self.failed(error))?;
            let compare = |what: &str, ours: &[f32]| -> Result<Quantity, VerifyError> {
                let key = format!("{name}_{what}");
                Ok(self.compare(&format!("{what} of rays, {name}"), ours, &file.floats(&key)?, 2.0e-4, false))
            };
            report.quantities.push(compare("weights", &ours)?);
            report.quantities.push(compare("rgb", colours.as_flattened())?);
            report.quantities.push(compare("depth", &seen)?);
        }
        if !self.suffix.is_empty() {
            return Ok(());
        }
        let (z_coarse, z_fine, z_depth) = (
            file.many_a_row("z_coarse", rays.len())?,
            file.many_a_row("z_fine", rays.len())?,
            file.many_a_row("z_depth", rays.len())?,
        );
        let (u, jitter) = (file.many("u_fine", z_fine.len())?, file.many("jitter_fine", z_fine.len())?);
        let normal = file.many("normal_depth", z_depth.len())?;
        let ray_count = rays.len();
        let (importance_count, depth_count) = (z_fine.len() / ray_count, z_depth.len() / ray_count);
        let draw = |ray: usize, index: usize| match index.checked_sub(importance_count) {
            None => [u[ray * importance_count + index], jitter[ray * importance_count + index]],
            Some(index) => [normal[ray * depth_count + index], 0.0],
        };
        let fine_count = importance_count + depth_count;
        let draws: Vec<[f32; 2]> =
            (0..ray_count * fine_count).map(|at| draw(at / fine_count, at % fine_count)).collect();
        let block = FineBlock {
            coarse_count: (z_coarse.len() / ray_count) as u32,
            importance_count: importance_count as u32,
            depth_count: depth_count as u32,
            depth_deviation: 0.01,
            ..FineBlock::default()
        };
        let coarse_weights = file.many("coarse_weights", z_coarse.len())?;
        let coarse_depth = file.many("coarse_depth", ray_count)?;
        let [fine, merged] = reference
            .fine_depths(&block, &rays, &z_coarse, &coarse_weights, &coarse_depth, &draws)
            .map_err(|error| self.failed(error))?;
        let expected: Vec<f32> = (0..ray_count)
            .flat_map(|ray| {
                let importance = &z_fine[ray * importance_count..(ray + 1) * importance_count];
                importance.iter().chain(&z_depth[ray * depth_count..(ray + 1) * depth_count]).copied()
            })
            .collect();
        report.quantities.push(self.compare("fine sample depths", &fine, &expected, 1.0e-5, false));
        report.quantities.push(self.compare("all depths in order", &merged, &file.floats("z_all")?, 1.0e-5, false));
        Ok(())
    }
}
