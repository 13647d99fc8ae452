//! Where along which rays to look, and what was seen there, one of which may be wrong.

use super::{Faulty, on_cpu_pixels};
use std::convert::Infallible;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Pixels, RayKernels, Rays};
use viewfuse_core::depths::{CoarseBlock, FineBlock};
use viewfuse_core::rays::{CastBlock, RayPoint};
use viewfuse_core::wanted::WantedBlock;
use viewfuse_vulkan::kernel::Kernel;

/// The same rays for the CPU.
fn on_cpu(rays: &Rays<Faulty>) -> Rays<Cpu> {
    Rays { count: rays.count, pixels: rays.pixels.clone(), rays: rays.rays.clone() }
}

impl RayKernels for Faulty {
    fn cast_rays(&self, block: &CastBlock, rays: &mut Rays<Self>) -> Result<(), Infallible> {
        let mut cast = on_cpu(rays);
        Cpu.cast_rays(block, &mut cast)?;
        rays.rays = cast.rays;
        self.spoil(Kernel::CastRays, rays.rays.iter_mut().flat_map(|ray| &mut ray.direction));
        Ok(())
    }

    fn coarse_depths(&self, block: &CoarseBlock, rays: &Rays<Self>, depths: &mut Vec<f32>) -> Result<(), Infallible> {
        Cpu.coarse_depths(block, &on_cpu(rays), depths)?;
        self.spoil(Kernel::CoarseDepths, depths);
        Ok(())
    }

    fn draw_chances(
        &self,
        block: &FineBlock,
        rays: &Rays<Self>,
        chances: &mut Vec<[f32; 2]>,
    ) -> Result<(), Infallible> {
        Cpu.draw_chances(block, &on_cpu(rays), chances)?;
        self.spoil(Kernel::DrawChances, chances.as_flattened_mut());
        Ok(())
    }

    fn fine_depths(
        &self,
        block: &FineBlock,
        rays: &Rays<Self>,
        seen: &Vec<[f32; 2]>,
        pixels: &Pixels<Self>,
        chances: &Vec<[f32; 2]>,
        depths: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.fine_depths(block, &on_cpu(rays), seen, &on_cpu_pixels(pixels), chances, depths)?;
        self.spoil(Kernel::FineDepths, depths);
        Ok(())
    }

    fn merge_depths(
        &self,
        block: &FineBlock,
        ray_count: u32,
        coarse: &Vec<f32>,
        fine: &Vec<f32>,
        merged: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.merge_depths(block, ray_count, coarse, fine, merged)?;
        self.spoil(Kernel::MergeDepths, merged);
        Ok(())
    }

    fn wanted_samples(
        &self,
        block: &WantedBlock,
        rays: &Rays<Self>,
        depths: &Vec<f32>,
        seen: &Vec<[f32; 2]>,
        wanted: &mut Vec<u32>,
    ) -> Result<(), Infallible> {
        Cpu.wanted_samples(block, &on_cpu(rays), depths, seen, wanted)?;
        // There is no thousandth of a yes: one answer in a thousand is the other one, from the first on.
        if self.kernel == Kernel::WantedSamples {
            wanted.iter_mut().step_by(1000).for_each(|wanted| *wanted = 1 - *wanted);
        }
        Ok(())
    }

    fn place_points(
        &self,
        sample_count: u32,
        point_count: u32,
        samples: &Vec<u32>,
        rays: &Rays<Self>,
        depths: &Vec<f32>,
        points: &mut Vec<RayPoint>,
    ) -> Result<(), Infallible> {
        Cpu.place_points(sample_count, point_count, samples, &on_cpu(rays), depths, points)?;
        self.spoil(Kernel::PlacePoints, points.iter_mut().flat_map(|point| &mut point.position));
        Ok(())
    }

    fn weigh_samples(
        &self,
        sample_count: u32,
        ray_count: u32,
        samples: &Vec<[f32; 4]>,
        seen: &mut Vec<[f32; 2]>,
    ) -> Result<(), Infallible> {
        Cpu.weigh_samples(sample_count, ray_count, samples, seen)?;
        self.spoil(Kernel::WeighSamples, seen.as_flattened_mut());
        Ok(())
    }
}
